//! Transmitting: answers first, then events, then blocks sent again, then new blocks, then log lines.
//!
//! A request is therefore never starved by samples: it waits for at most the one frame that is on its
//! way. When the link is slower than the samples, blocks wait in the ring, and what leaves it unsent is
//! reported as a range before the next block goes out.

use embassy_sync::blocking_mutex::raw::RawMutex;
use jointrig_protocol::block::{HEADER_PAYLOAD, RESENT};
use jointrig_protocol::event::Loss;
use jointrig_protocol::frame::{Kind, Writer};
use jointrig_protocol::hello::Hello;

use crate::Core;
use crate::board::ByteSink;
use crate::ring::Out;
use crate::state::State;

/// Runs for ever.
pub async fn transmit<M: RawMutex, S: ByteSink>(core: &Core<'_, M>, sink: &mut S) -> ! {
    let mut writer = Writer::new(Kind::Hello);
    loop {
        match core.next_frame(&mut writer) {
            Some(payload) => {
                // every frame that is built here fits: the golden vectors hold the largest of each kind
                if let Ok(frame) = writer.seal(payload) {
                    sink.write(frame).await;
                }
            }
            None => core.to_send.wait().await,
        }
    }
}

impl<M: RawMutex> Core<'_, M> {
    /// Writes the most urgent payload; its length, or `None` when there is nothing to send.
    fn next_frame(&self, writer: &mut Writer) -> Option<usize> {
        let ring_scans = self.ring_scans();
        self.with(|state| {
            if let Some(session) = state.hello_due.take() {
                writer.restart(Kind::Hello);
                let bytes = Hello::device(session, self.facts.boot, ring_scans).to_bytes();
                writer.payload_mut()[..bytes.len()].copy_from_slice(&bytes);
                return Some(bytes.len());
            }
            state.session?;
            while let Some(answer) = state.answers.pop_front() {
                if let Some(length) = write_value(writer, Kind::Answer, &answer) {
                    return Some(length);
                }
            }
            if state.ring.has_loss() {
                state.report_loss(Loss::LinkSlow);
            }
            while let Some(event) = state.events.pop_front() {
                if let Some(length) = write_value(writer, Kind::Event, &event) {
                    return Some(length);
                }
                state.counters.events_dropped += 1;
            }
            state.resent_block(writer).or_else(|| state.new_block(writer)).or_else(|| self.log_lines(writer))
        })
    }

    /// Lines wait until the next look, a tenth of a second at most: none is worth a wake-up of its own.
    fn log_lines(&self, writer: &mut Writer) -> Option<usize> {
        let length = self.logs?.take(writer.payload_mut())?;
        writer.restart(Kind::Log);
        Some(length)
    }
}

impl State<'_> {
    fn resent_block(&mut self, writer: &mut Writer) -> Option<usize> {
        while let Some(range) = self.resends.front_mut() {
            let end = range.first_scan + range.scans;
            match self.ring.at_or_after(range.first_scan, RESENT) {
                Some((out, after)) if out.header.first_scan < end => {
                    self.counters.scans_resent += u64::from(out.header.scans);
                    range.scans = end.saturating_sub(after);
                    range.first_scan = after;
                    let length = write_block(writer, &out);
                    if after >= end {
                        self.resends.pop_front();
                    }
                    return Some(length);
                }
                // it left the ring meanwhile: the host asks again and hears that it is gone
                _ => drop(self.resends.pop_front()),
            }
        }
        None
    }

    fn new_block(&mut self, writer: &mut Writer) -> Option<usize> {
        let out = self.ring.next_unsent()?;
        self.counters.scans_sent += u64::from(out.header.scans);
        Some(write_block(writer, &out))
    }
}

fn write_value<T: serde::Serialize>(writer: &mut Writer, kind: Kind, value: &T) -> Option<usize> {
    writer.restart(kind);
    postcard::to_slice(value, writer.payload_mut()).ok().map(|used| used.len())
}

fn write_block(writer: &mut Writer, out: &Out<'_>) -> usize {
    writer.restart(Kind::Samples);
    let payload = writer.payload_mut();
    payload[..HEADER_PAYLOAD].copy_from_slice(&out.header.to_bytes());
    payload[HEADER_PAYLOAD..HEADER_PAYLOAD + out.samples.len()].copy_from_slice(out.samples);
    HEADER_PAYLOAD + out.samples.len()
}

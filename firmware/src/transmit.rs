//! Transmitting: replies first, then lost scans, then other events, then retransmitted blocks, then
//! new blocks, then log lines.
//!
//! Samples therefore never starve a request: its reply waits for at most the one frame being sent.
//! When the link is slower than the samples, blocks wait in the ring; those that leave it unsent
//! are reported as a range before the next block is sent.

use embassy_sync::blocking_mutex::raw::RawMutex;
use jointrig_protocol::block::HEADER_PAYLOAD;
use jointrig_protocol::frame::{Kind, Writer};
use jointrig_protocol::hello::Hello;

use crate::Core;
use crate::board::ByteSink;
use crate::logs::Tap;
use crate::ring::Out;
use crate::state::State;

/// Runs forever.
pub async fn transmit<M: RawMutex, S: ByteSink>(core: &Core<'_, M>, sink: &mut S) -> ! {
    let mut writer = Writer::new(Kind::Hello);
    // whether the last bytes sent ended with a zero, which COBS requires before the next frame
    let mut ended = true;
    let mut more = true;
    loop {
        if !core::mem::replace(&mut more, true) {
            core.to_send.wait().await;
        }
        let Some(next) = core.next_frame(&mut writer) else {
            more = false;
            continue;
        };
        more = next.more;
        if !next.packet && !core::mem::replace(&mut ended, true) {
            sink.write(&[0]).await;
        }
        let sealed = if next.packet { writer.seal_packet(next.payload) } else { writer.seal(next.payload) };
        // every frame built here fits: the golden vectors contain the largest of each kind
        if let Ok(frame) = sealed {
            sink.write(frame).await;
            ended = !next.packet;
        }
    }
}

/// A frame that is written but not yet sealed.
struct Next {
    /// Length of its payload in bytes.
    payload: usize,
    /// Send as a packet instead of COBS.
    packet: bool,
    /// Something else may be waiting.
    more: bool,
}

impl<M: RawMutex> Core<'_, M> {
    /// Writes the most urgent payload; returns its length, or `None` when there is nothing to send.
    fn next_frame(&self, writer: &mut Writer) -> Option<Next> {
        self.with(|state| {
            if let Some(hello) = state.take_hello(self.facts.boot) {
                return Some(Next { payload: write_hello(&hello, writer), packet: false, more: true });
            }
            state.session()?;
            let payload = state.next_payload(writer).or_else(|| self.log_lines(writer))?;
            // on a link that keeps up, nothing is left after the newest block
            let more = state.is_behind() || self.logs.is_some_and(Tap::waits);
            Some(Next { payload, packet: state.sends_packets(), more })
        })
    }

    /// Writes log lines. Lines wait for the next periodic wake-up, a tenth of a second at most:
    /// they do not wake the task themselves.
    fn log_lines(&self, writer: &mut Writer) -> Option<usize> {
        let length = self.logs.filter(|tap| tap.waits())?.take(writer.payload_mut())?;
        writer.restart(Kind::Log);
        Some(length)
    }
}

impl State<'_> {
    /// Whether anything but log lines is waiting.
    fn is_behind(&self) -> bool {
        self.unsent_blocks() > 0 || self.has_words() || self.has_resends()
    }

    /// Writes the most urgent payload, log lines excluded.
    fn next_payload(&mut self, writer: &mut Writer) -> Option<usize> {
        if self.has_words()
            && let Some(length) = self.next_word(writer)
        {
            return Some(length);
        }
        if self.has_resends() { self.resent_block(writer) } else { self.new_block(writer) }
    }

    /// Writes the next reply or event.
    #[inline(never)]
    fn next_word(&mut self, writer: &mut Writer) -> Option<usize> {
        while let Some(answer) = self.take_answer() {
            writer.restart(Kind::Answer);
            if let Ok(length) = answer.write(writer.payload_mut()) {
                return Some(length);
            }
        }
        while let Some(event) = self.take_event() {
            writer.restart(Kind::Event);
            if let Ok(length) = event.write(writer.payload_mut()) {
                return Some(length);
            }
            self.safety().count_dropped_event();
        }
        None
    }

    #[inline(never)]
    fn resent_block(&mut self, writer: &mut Writer) -> Option<usize> {
        if let Some(out) = self.take_resent() {
            return Some(write_block(writer, &out));
        }
        self.new_block(writer)
    }

    fn new_block(&mut self, writer: &mut Writer) -> Option<usize> {
        Some(write_block(writer, &self.take_unsent()?))
    }
}

fn write_hello(hello: &Hello, writer: &mut Writer) -> usize {
    writer.restart(Kind::Hello);
    let bytes = hello.to_bytes();
    writer.payload_mut()[..bytes.len()].copy_from_slice(&bytes);
    bytes.len()
}

fn write_block(writer: &mut Writer, out: &Out<'_>) -> usize {
    writer.restart(Kind::Samples);
    let (head, samples) = writer.payload_mut().split_at_mut(HEADER_PAYLOAD);
    head.copy_from_slice(&out.header.to_bytes());
    let length = out.samples.len().min(samples.len());
    samples[..length].copy_from_slice(&out.samples[..length]);
    HEADER_PAYLOAD + length
}

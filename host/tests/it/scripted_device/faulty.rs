//! A link that loses, damages, duplicates and truncates frames.
//!
//! It wraps any [`Transport`] and damages a seeded fraction of the *frames* of both directions, so
//! that tests can show that a session delivers the same samples whatever the link does.

use std::collections::VecDeque;
use std::io;
use std::time::Duration;

use jointrig::device::transport::Transport;

/// Fraction of the frames affected by each fault, 0 to 1, in each direction.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// The frame is lost.
    pub drop: f64,
    /// One bit of it flips.
    pub corrupt: f64,
    /// It arrives twice.
    pub duplicate: f64,
    /// Its second half is lost, including its end: it runs into the next frame.
    pub truncate: f64,
}

/// A transport that damages a fraction of the frames.
pub struct Faulty<T> {
    inner: T,
    faults: Faults,
    random: u64,
    to_host: Line,
    to_device: Line,
}

#[derive(Default)]
struct Line {
    partial: Vec<u8>,
    ready: VecDeque<u8>,
}

impl<T: Transport> Faulty<T> {
    /// Damages the traffic over `inner`; the same seed damages the same frames of the same traffic.
    pub fn new(inner: T, faults: Faults, seed: u64) -> Self {
        Self { inner, faults, random: seed, to_host: Line::default(), to_device: Line::default() }
    }

    /// splitmix64, as a number from 0 to 1.
    fn draw(&mut self) -> f64 {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.random;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn pass(&mut self, mut line: Line, bytes: &[u8]) -> Line {
        for byte in bytes {
            line.partial.push(*byte);
            if *byte == 0 {
                let frame = std::mem::take(&mut line.partial);
                self.spoil(frame, &mut line.ready);
            }
        }
        line
    }

    fn spoil(&mut self, mut frame: Vec<u8>, out: &mut VecDeque<u8>) {
        let faults = self.faults;
        let draw = self.draw();
        let mut edge = 0.0;
        let [drop, corrupt, duplicate, truncate] =
            [faults.drop, faults.corrupt, faults.duplicate, faults.truncate].map(|share| {
                let hit = (edge..edge + share).contains(&draw);
                edge += share;
                hit
            });
        if drop {
            return;
        }
        if corrupt {
            let place = ((self.draw() * frame.len() as f64) as usize).min(frame.len() - 1);
            let bit = (self.draw() * 8.0) as u32;
            frame[place] ^= 1_u8.wrapping_shl(bit);
        }
        if truncate {
            frame.truncate(frame.len() / 2);
        }
        if duplicate {
            out.extend(&frame);
        }
        out.extend(frame);
    }
}

impl<T: Transport> Transport for Faulty<T> {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if self.to_host.ready.is_empty() {
            let got = self.inner.read(buf, timeout)?;
            let line = std::mem::take(&mut self.to_host);
            self.to_host = self.pass(line, &buf[..got]);
        }
        let count = buf.len().min(self.to_host.ready.len());
        for (place, byte) in buf.iter_mut().zip(self.to_host.ready.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        let line = std::mem::take(&mut self.to_device);
        self.to_device = self.pass(line, bytes);
        let ready: Vec<u8> = self.to_device.ready.drain(..).collect();
        self.inner.write_all(&ready)
    }
}

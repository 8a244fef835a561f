//! Queued transfers for the controller's bytes, so that the controller never waits for this
//! program.
//!
//! At high speed each frame is a short packet and ends a transfer: 16 channels at 51.2 kHz are 3400
//! transfers per second, 1.7 MB/s. [`TRANSFERS`] transfers stay queued, enough for about 37 ms; the
//! controller's ring covers longer delays of the host.

use std::io;
use std::time::Duration;

use nusb::transfer::TransferError;

/// Bytes of one transfer: whole packets at either speed, and one whole frame.
pub(super) const TRANSFER_BYTES: usize = 512;

/// Transfers queued at any time.
const TRANSFERS: usize = 128;

/// A bulk IN endpoint.
pub(super) trait Incoming: Send {
    /// Queues another transfer of [`TRANSFER_BYTES`].
    fn ask(&mut self);

    /// Waits at most `timeout` for the oldest queued transfer and appends its bytes, even if it
    /// failed; `None` when it has not finished.
    fn finished(&mut self, timeout: Duration, bytes: &mut Vec<u8>) -> Option<Result<(), TransferError>>;
}

/// A byte stream made of transfers.
pub(super) struct Queue<I> {
    end: I,
    queued: usize,
    bytes: Vec<u8>,
    /// Number of bytes already returned.
    taken: usize,
    failed: Option<TransferError>,
}

impl<I: Incoming> Queue<I> {
    pub fn new(end: I) -> Self {
        let mut queue = Self { end, queued: 0, bytes: Vec::new(), taken: 0, failed: None };
        queue.fill();
        queue
    }

    /// Reads the available bytes as [`super::Transport::read`] does. A failure is reported after
    /// the bytes before it.
    pub fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        let mut patience = timeout;
        while self.bytes.len() - self.taken < buf.len() && self.failed.is_none() && self.collect(patience) {
            // wait only for the first byte; an empty transfer has none
            if self.bytes.len() > self.taken {
                patience = Duration::ZERO;
            }
        }
        if self.taken == self.bytes.len()
            && let Some(error) = self.failed
        {
            return Err(broken(error));
        }
        let there = &self.bytes[self.taken..];
        let used = there.len().min(buf.len());
        buf[..used].copy_from_slice(&there[..used]);
        self.taken += used;
        if self.taken == self.bytes.len() {
            self.bytes.clear();
            self.taken = 0;
        }
        Ok(used)
    }

    /// Takes one finished transfer and queues another one; returns whether there was one.
    fn collect(&mut self, timeout: Duration) -> bool {
        let Some(status) = self.end.finished(timeout, &mut self.bytes) else { return false };
        self.queued -= 1;
        match status {
            Ok(()) => self.fill(),
            Err(error) => self.failed = Some(error),
        }
        true
    }

    fn fill(&mut self) {
        while self.queued < TRANSFERS {
            self.end.ask();
            self.queued += 1;
        }
    }
}

/// Converts a transfer's failure to an error worded for the operator.
pub(super) fn broken(error: TransferError) -> io::Error {
    match error {
        TransferError::Disconnected => io::Error::new(
            io::ErrorKind::NotConnected,
            "the controller is gone from the bus: unplugged, without power, or restarting",
        ),
        // while a cable is pulled this error occurs briefly before the bus reports the
        // disconnection
        TransferError::Fault => io::Error::new(
            io::ErrorKind::ConnectionAborted,
            "the bus does not reach the controller: unplugged, or a bad cable or hub",
        ),
        TransferError::Stall => io::Error::new(
            io::ErrorKind::ConnectionReset,
            "the controller refused the transfer: unplug it and plug it in again",
        ),
        other => io::Error::other(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::VecDeque;

    use jointrig_protocol::frame::Kind;
    use jointrig_protocol::golden;
    use jointrig_protocol::packet::Reader;
    use proptest::prelude::*;

    /// An endpoint that delivers the given transfers one after another, and then nothing.
    #[derive(Default)]
    struct Script {
        transfers: VecDeque<(Vec<u8>, Result<(), TransferError>)>,
        queued: usize,
        fewest_queued: usize,
        waited: Vec<Duration>,
    }

    impl Script {
        fn of(transfers: impl IntoIterator<Item = (Vec<u8>, Result<(), TransferError>)>) -> Self {
            Self { transfers: transfers.into_iter().collect(), fewest_queued: usize::MAX, ..Self::default() }
        }
    }

    impl Incoming for Script {
        fn ask(&mut self) {
            self.queued += 1;
        }

        fn finished(&mut self, timeout: Duration, bytes: &mut Vec<u8>) -> Option<Result<(), TransferError>> {
            self.waited.push(timeout);
            self.fewest_queued = self.fewest_queued.min(self.queued);
            let (brought, status) = self.transfers.pop_front()?;
            assert!(self.queued > 0, "a transfer finished that was never queued");
            assert!(brought.len() <= TRANSFER_BYTES);
            self.queued -= 1;
            bytes.extend(brought);
            Some(status)
        }
    }

    const PATIENCE: Duration = Duration::from_millis(20);

    #[test]
    fn every_finished_transfer_is_queued_again_at_once() {
        let mut queue = Queue::new(Script::of((0..1000).map(|_| (vec![1; 503], Ok(())))));
        assert_eq!(queue.end.queued, TRANSFERS);
        let mut buf = vec![0; 65_536];
        let mut got = 0;
        while got < 503_000 {
            got += queue.read(&mut buf, PATIENCE).expect("no failure");
        }
        assert_eq!((queue.end.fewest_queued, queue.end.queued), (TRANSFERS, TRANSFERS));
    }

    #[test]
    fn only_the_first_byte_is_waited_for() {
        let empty = || (Vec::new(), Ok(()));
        let mut queue = Queue::new(Script::of([empty(), empty(), (vec![1], Ok(())), (vec![2], Ok(()))]));
        let mut buf = [0; 8];
        assert_eq!(queue.read(&mut buf, PATIENCE).expect("bytes"), 2);
        assert_eq!(queue.end.waited, [PATIENCE, PATIENCE, PATIENCE, Duration::ZERO, Duration::ZERO]);
        assert_eq!(queue.read(&mut buf, PATIENCE).expect("nothing in time"), 0);
    }

    #[test]
    fn a_failure_comes_after_the_bytes_before_it_and_stays() {
        let mut queue =
            Queue::new(Script::of([(vec![1, 2], Ok(())), (vec![3], Err(TransferError::Disconnected))]));
        let mut buf = [0; 2];
        assert_eq!(queue.read(&mut buf, PATIENCE).expect("bytes"), 2);
        assert_eq!(queue.read(&mut buf, PATIENCE).expect("what the broken transfer brought"), 1);
        for _ in 0..2 {
            let error = queue.read(&mut buf, PATIENCE).expect_err("gone");
            assert_eq!(error.kind(), io::ErrorKind::NotConnected);
            assert!(error.to_string().contains("unplugged"), "{error}");
        }
    }

    proptest! {
        /// Transfers of any lengths, read in pieces of any size, give the same frames.
        #[test]
        fn frames_survive_any_split(
            lengths in prop::collection::vec(0..=TRANSFER_BYTES, 1..40),
            portion in 1..2000_usize,
        ) {
            let golden = golden::COMMITTED;
            let mut wire: VecDeque<u8> = golden.iter().flat_map(|(_, wire)| wire.iter().copied()).collect();
            let mut transfers = Vec::new();
            for length in lengths.iter().copied().cycle().chain([1]) {
                let length = length.min(wire.len());
                transfers.push((wire.drain(..length).collect::<Vec<_>>(), Ok(())));
                if transfers.len() > 5000 || wire.is_empty() {
                    break;
                }
            }
            transfers.extend(wire.make_contiguous().chunks(TRANSFER_BYTES).map(|rest| (rest.to_vec(), Ok(()))));
            let mut queue = Queue::new(Script::of(transfers));
            let mut reader = Reader::new();
            let mut kinds: Vec<Kind> = Vec::new();
            let mut buf = vec![0; portion];
            loop {
                let got = queue.read(&mut buf, PATIENCE).expect("no failure");
                let mut rest = &buf[..got];
                while !rest.is_empty() {
                    let (used, found) = reader.feed(rest);
                    rest = &rest[used..];
                    kinds.extend(found.map(|frame| frame.expect("undamaged").kind));
                }
                if got == 0 {
                    break;
                }
            }
            prop_assert_eq!(kinds.len(), golden.len());
        }
    }
}

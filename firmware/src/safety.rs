//! Monitors whether the relay that supplies the coil's 24 V (K1) follows the guard chain.
//!
//! Its force-guided contacts cannot contradict each other: while a power contact is welded, the
//! normally closed contact stays open (EN 61810-3). A board therefore reads that contact back. Each
//! time the chain opens, the relay must be seen to drop, or no further motion is allowed. After a
//! start it must have been seen to drop once, because its earlier state is unknown.

/// Longest time in which the relay may drop or pull in, µs: about 20 ms with a diode and Zener
/// diode across its coil, and the same again for bouncing contacts.
pub const WITHIN_US: u64 = 50_000;

/// RelayFault of the relay.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RelayFault {
    /// It has not been seen to drop since the start, or since a brief opening of the chain.
    Unproven,
    /// The chain opened and the relay did not drop: a contact is welded, or the wire of its return
    /// contact is disconnected.
    Stays,
    /// The chain closed and the relay did not pull in.
    Rests,
}

impl RelayFault {
    /// The fault, and what the operator must do.
    #[must_use]
    pub fn sentence(self) -> &'static str {
        match self {
            RelayFault::Unproven => {
                "open the guard once: K1 was not seen to drop since the start or the last opening"
            }
            RelayFault::Stays => {
                "K1 does not drop: welded, or its return contact is off. Replace it, start the board again"
            }
            RelayFault::Rests => {
                "K1 does not pull though guard and stop are closed: its coil or the chain. Start the board again"
            }
        }
    }
}

/// State of the relay, as its return contact shows it.
#[derive(Clone, Copy, Debug)]
pub struct Relay {
    chain_closed: bool,
    /// Time of the last change of the chain, µs.
    since_us: u64,
    /// Seen to drop since the chain last opened.
    proven: bool,
    failed: Option<RelayFault>,
}

impl Default for Relay {
    fn default() -> Self {
        Self::new()
    }
}

impl Relay {
    /// State after a start: unknown.
    #[must_use]
    pub const fn new() -> Self {
        Self { chain_closed: false, since_us: 0, proven: false, failed: None }
    }

    /// Evaluates the present states of chain and return contact, and returns whether motion is
    /// allowed.
    ///
    /// # Errors
    /// The fault of the relay. A failure stays until the next start.
    pub fn see(&mut self, chain_closed: bool, dropped: bool, now_us: u64) -> Result<bool, RelayFault> {
        if chain_closed != self.chain_closed {
            (self.chain_closed, self.since_us) = (chain_closed, now_us);
            if !chain_closed {
                self.proven = false;
            }
        }
        let late = now_us.saturating_sub(self.since_us) > WITHIN_US;
        self.proven |= !chain_closed && dropped;
        if self.failed.is_none() && late && chain_closed == dropped {
            self.failed = Some(if chain_closed { RelayFault::Rests } else { RelayFault::Stays });
        }
        match self.failed {
            Some(fault) => Err(fault),
            None if chain_closed && !self.proven => Err(RelayFault::Unproven),
            None => Ok(chain_closed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Evaluates every ms of these intervals: (until ms, chain closed, dropped); returns the last
    /// verdict.
    fn after(stretches: &[(u64, bool, bool)]) -> Result<bool, RelayFault> {
        let mut relay = Relay::new();
        let (mut at, mut last) = (0, Ok(false));
        for (until, chain_closed, dropped) in stretches {
            while at < *until {
                last = relay.see(*chain_closed, *dropped, 1000 * at);
                at += 1;
            }
        }
        last
    }

    #[test]
    fn after_a_start_the_guard_must_be_opened_once() {
        assert_eq!(after(&[(10_000, true, false)]), Err(RelayFault::Unproven));
        assert_eq!(after(&[(100, false, true)]), Ok(false));
        assert_eq!(
            after(&[(100, true, false), (120, false, false), (200, false, true), (300, true, false)]),
            Ok(true)
        );
    }

    #[test]
    fn a_weld_is_found_at_the_next_opening_and_stays_found() {
        let works = [(100, false, true), (120, true, true), (1_000, true, false)];
        assert_eq!(after(&works), Ok(true));
        let welded = [&works[..], &[(1_040, false, false)]].concat();
        assert_eq!(after(&welded), Ok(false), "it may take its time");
        let welded = [&works[..], &[(1_060, false, false)]].concat();
        assert_eq!(after(&welded), Err(RelayFault::Stays));
        let closed_again = [&welded[..], &[(2_000, true, false)]].concat();
        assert_eq!(after(&closed_again), Err(RelayFault::Stays));
        // the guard opens and closes before the relay could have dropped: its state is unknown, and
        // motion is not allowed
        let shortly = [&works[..], &[(1_010, false, false), (1_500, true, false)]].concat();
        assert_eq!(after(&shortly), Err(RelayFault::Unproven));
    }

    #[test]
    fn a_relay_that_does_not_pull_is_found() {
        assert_eq!(after(&[(100, false, true), (150, true, true)]), Ok(true));
        assert_eq!(after(&[(100, false, true), (160, true, true)]), Err(RelayFault::Rests));
    }

    #[test]
    fn a_return_contact_that_is_off_is_taken_for_a_weld() {
        assert_eq!(after(&[(60, false, false)]), Err(RelayFault::Stays));
    }

    #[test]
    fn sentences_fit_an_event() {
        for fault in [RelayFault::Unproven, RelayFault::Stays, RelayFault::Rests] {
            assert!(fault.sentence().len() <= jointrig_protocol::limits::SENTENCE_BYTES);
        }
    }
}

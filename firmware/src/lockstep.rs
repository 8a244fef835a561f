//! Lockstep: how an emulated board and the simulator that serves it share memory and take turns.
//!
//! The emulated board has real memory of its own and 16 MB that a process of the PC can map. What a
//! wired board does with converters, coil, inputs and a USB port, it does through that memory: it
//! writes an [`Ask`], rings, and stands still until the simulator has written a [`Reply`]. One of
//! the two runs at any instant, and the board's time is what the reply says. So no clock of the PC
//! enters any result, and the memory needs no other guard.
//!
//! | offset | bytes | written by | what |
//! |---|---|---|---|
//! | [`MAGIC_AT`] | 4 | simulator, once | [`MAGIC`]: somebody serves this memory |
//! | [`ASK_AT`] | 64 | board | [`Ask`] |
//! | [`REPLY_AT`] | 64 | simulator | [`Reply`] |
//! | [`TEXT_AT`] | 4096 | whoever has the turn | [`Setup`], a stage order and its refusal, a last sentence |
//! | [`BLOCK_AT`] | 896 | simulator | a [`Delivery`], then the words of both converters |
//! | [`SEEN_AT`] | 28 | simulator | what came to the sync port, with a [`Delivery`] that says so |
//! | [`DRIVE_AT`] | 480 | board | codes for the shaker's drive |
//! | [`TO_DEVICE_AT`] | 64 Ki | simulator | bytes for the board, a ring |
//! | [`TO_HOST_AT`] | 64 Ki | board | bytes for the host, a ring |
//! | [`LOG_AT`] | 64 Ki | board | log lines, encoded as for the link ([`crate::logs`]), a ring |
//!
//! Heads and tails count bytes since the start, modulo 2³²; everything is little-endian.

use crate::ad7606b::alignment::{Clock, Moment};
use crate::ad7606b::trouble::Trouble;
use crate::board::Seen;
use crate::ruler::{Ago, Span};
use heapless::Vec;
use jointrig_protocol::channel::{Channel, Name};
use jointrig_protocol::limits::MAX_CHANNELS;
use serde::{Deserialize, Serialize};

/// Where the board finds the memory.
pub const BASE: usize = 0x8000_0000;
/// Its size: QEMU insists on exactly this much.
pub const BYTES: usize = 16 << 20;
/// Changes with this layout, so that an image and a simulator of different sources refuse each
/// other.
pub const MAGIC: u32 = 0x4A52_4C06;
/// Where [`MAGIC`] stands.
pub const MAGIC_AT: usize = 0;
/// Where the board's words stand.
pub const ASK_AT: usize = 0x40;
/// Where the simulator's words stand.
pub const REPLY_AT: usize = 0x80;
/// Where longer messages stand, their length in [`Ask::argument`] or [`Reply::length`].
pub const TEXT_AT: usize = 0x1000;
/// The longest of them.
pub const TEXT_BYTES: usize = 0x1000;
/// Where a block of scans stands.
pub const BLOCK_AT: usize = 0x2000;
/// Output of the shaker's drive at the largest code, V.
pub const DRIVE_FULL_SCALE_V: f32 = 10.0;
/// Where codes for the shaker's drive stand, each of 16 bits.
pub const DRIVE_AT: usize = 0x3000;
/// Where slow values stand ([`Slow`](jointrig_protocol::slow::Slow) in postcard), behind their
/// length as a word.
pub const SLOW_AT: usize = 0x5000;
/// The longest of them.
pub const SLOW_BYTES: usize = 0x100;
/// Where a [`Seen`] stands.
pub const SEEN_AT: usize = 0x5800;
/// Its words.
pub const SEEN_WORDS: usize = 7;
/// Counts of the simulated board's crystal in a scan, of which [`Seen::span`] speaks.
pub const PERIOD: u32 = 3125;
/// Slow values have been measured; it counts once, with the next block.
pub const SLOW_MEASURED: u32 = 128;
/// Where the ring of bytes for the board begins.
pub const TO_DEVICE_AT: usize = 0x1_0000;
/// Where the ring of bytes for the host begins.
pub const TO_HOST_AT: usize = 0x2_0000;
/// Where the ring of log lines begins.
pub const LOG_AT: usize = 0x3_0000;
/// The length of each ring, a power of two.
pub const RING_BYTES: u32 = 0x1_0000;
/// An instant that never comes.
pub const NEVER: u64 = u64::MAX;

/// What the board wants when it rings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Op {
    /// It has started and needs its [`Setup`]; the argument is the low word of its
    /// [`schema::HASH`](jointrig_protocol::schema::HASH).
    Start = 1,
    /// All tasks wait: for a block, an alarm, bytes, or room for bytes. With an argument of 1 bytes
    /// come and go by the UART, which the simulator does not see: it answers soon, whatever has
    /// come.
    Idle = 2,
    /// The coil on, for as many µs as the argument says.
    Pulse = 3,
    /// The coil off.
    Off = 4,
    /// The stage order of as many bytes as the argument says; the reply's length is that of a
    /// refusal, or 0.
    Stage = 5,
    /// The firmware has panicked; a sentence of as many bytes as the argument says tells why.
    Panic = 6,
    /// As many codes for the shaker's drive as the argument says: for the scans of the next block.
    Play = 7,
    /// The shaker's drive to rest.
    Rest = 8,
    /// Both converters' rings start anew with the next scan; the reply's length is that scan's
    /// number since the start.
    Join = 9,
    /// The external clock times the scans from now on (argument 1) or the board's own (0); the
    /// reply's length is 0, 1 when none comes to the input, 2 when it is of another rate.
    Clock = 10,
    /// The sync output rises, and falls with the next block; the reply's length is when: in parts
    /// of 2¹⁶ of a scan after the newest scan's successor.
    Mark = 11,
}

impl Op {
    /// The wish that a word means.
    #[must_use]
    pub const fn from_word(word: u32) -> Option<Self> {
        Some(match word {
            1 => Self::Start,
            2 => Self::Idle,
            3 => Self::Pulse,
            4 => Self::Off,
            5 => Self::Stage,
            6 => Self::Panic,
            7 => Self::Play,
            8 => Self::Rest,
            9 => Self::Join,
            10 => Self::Clock,
            11 => Self::Mark,
            _ => return None,
        })
    }
}

/// The guard is closed.
pub const INTERLOCK_CLOSED: u32 = 1;
/// The emergency stop is pressed.
pub const EMERGENCY_STOP: u32 = 2;
/// Somebody turns the reset key; it counts once, with the next block.
pub const LOCAL_RESET: u32 = 4;
/// The clock of the scans waits for the host's acknowledgements.
pub const HELD: u32 = 8;
/// For tests: the acquisition task must panic.
pub const MUST_PANIC: u32 = 16;
/// For tests: it must read where no memory is.
pub const MUST_FAULT: u32 = 32;
/// For tests: it must use up its stack.
pub const MUST_OVERFLOW: u32 = 64;

/// Words of an ask or a reply.
pub const WORDS: usize = 10;

/// The board's words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ask {
    /// An [`Op`].
    pub op: u32,
    /// Belongs to the wish.
    pub argument: u32,
    /// The next alarm, µs; [`NEVER`] for none.
    pub alarm_us: u64,
    /// The instant of the block that is waited for, µs; [`NEVER`] when the converters rest.
    pub block_us: u64,
    /// Bytes taken from the ring for the board.
    pub to_device_tail: u32,
    /// Bytes put into the ring for the host.
    pub to_host_head: u32,
    /// Whether a frame waits for room in it.
    pub to_host_full: u32,
    /// Bytes put into the ring of logs.
    pub log_head: u32,
}

impl Ask {
    /// No wish, nothing moved, nothing waited for.
    pub const NOTHING: Self = Self {
        op: 0,
        argument: 0,
        alarm_us: NEVER,
        block_us: NEVER,
        to_device_tail: 0,
        to_host_head: 0,
        to_host_full: 0,
        log_head: 0,
    };

    /// As they stand in memory.
    #[must_use]
    pub const fn to_words(&self) -> [u32; WORDS] {
        [
            self.op,
            self.argument,
            self.alarm_us as u32,
            (self.alarm_us >> 32) as u32,
            self.block_us as u32,
            (self.block_us >> 32) as u32,
            self.to_device_tail,
            self.to_host_head,
            self.to_host_full,
            self.log_head,
        ]
    }

    /// From memory.
    #[must_use]
    pub const fn from_words(words: &[u32; WORDS]) -> Self {
        Self {
            op: words[0],
            argument: words[1],
            alarm_us: joined(words[2], words[3]),
            block_us: joined(words[4], words[5]),
            to_device_tail: words[6],
            to_host_head: words[7],
            to_host_full: words[8],
            log_head: words[9],
        }
    }
}

/// The simulator's words.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reply {
    /// The board's time, µs.
    pub now_us: u64,
    /// Bits: the inputs, and how the board is run.
    pub inputs: u32,
    /// Blocks delivered since the start.
    pub blocks: u32,
    /// Bytes put into the ring for the board.
    pub to_device_head: u32,
    /// Bytes taken from the ring for the host.
    pub to_host_tail: u32,
    /// Bytes taken from the ring of logs.
    pub log_tail: u32,
    /// Bytes of text.
    pub length: u32,
    /// To [`Op::Play`]: the drive has run dry, and took nothing.
    pub ran_dry: u32,
    /// How often the link was cut since the start.
    pub cuts: u32,
}

impl Reply {
    /// As they stand in memory.
    #[must_use]
    pub const fn to_words(&self) -> [u32; WORDS] {
        [
            self.now_us as u32,
            (self.now_us >> 32) as u32,
            self.inputs,
            self.blocks,
            self.to_device_head,
            self.to_host_tail,
            self.log_tail,
            self.length,
            self.ran_dry,
            self.cuts,
        ]
    }

    /// From memory.
    #[must_use]
    pub const fn from_words(words: &[u32; WORDS]) -> Self {
        Self {
            now_us: joined(words[0], words[1]),
            inputs: words[2],
            blocks: words[3],
            to_device_head: words[4],
            to_host_tail: words[5],
            log_tail: words[6],
            length: words[7],
            ran_dry: words[8],
            cuts: words[9],
        }
    }
}

const fn joined(low: u32, high: u32) -> u64 {
    (high as u64) << 32 | low as u64
}

/// Bytes of a [`Delivery`].
pub const DELIVERY_BYTES: usize = 32;

/// Counts of the emulated converters' timer in a period: as many parts as the phases of a
/// [`Moment`] need to tell apart.
pub const CLOCK: Clock = Clock { settled: 1, read_from: 10, read_by: 15 };
/// Blocks in each of the emulated converters' rings, as on the wired board.
pub const RING_BLOCKS: u32 = 8;

/// What stands before a block: after it come the words of both converters, the first's and then the
/// second's, little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Delivery {
    /// Scans of which words stand behind it.
    pub scans: u32,
    /// What went wrong, if anything: nothing is there then.
    pub trouble: Option<Trouble>,
    /// Periods of the clock that have begun since the start.
    pub periods: u32,
    /// What the board reads off when it has the block, and again until it can tell: the phase of
    /// every second look is a quiet one.
    pub moment: Moment,
    /// Something came to the sync port and stands at [`SEEN_AT`].
    pub seen: bool,
}

impl Delivery {
    /// As it stands in memory.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; DELIVERY_BYTES] {
        let trouble = match self.trouble {
            None => 0,
            Some(Trouble::Silent(..)) => 1,
            Some(Trouble::Crc) => 2,
            Some(Trouble::Overrun) => 3,
            Some(Trouble::Dma) => 4,
            // the board finds out by itself
            Some(Trouble::Slipped(..)) => 5,
        };
        let [first, second] = self.moment.words;
        let seen = u32::from(self.seen);
        let words =
            [self.scans, trouble, self.periods, self.moment.periods, self.moment.phase, first, second, seen];
        let mut bytes = [0; DELIVERY_BYTES];
        for (place, word) in bytes.as_chunks_mut().0.iter_mut().zip(words) {
            *place = u32::to_le_bytes(word);
        }
        bytes
    }

    /// From memory. The emulated converters are silent from the start.
    #[must_use]
    pub fn from_bytes(bytes: &[u8; DELIVERY_BYTES]) -> Self {
        let word = |place: usize| bytes.as_chunks().0.get(place).map_or(0, |word| u32::from_le_bytes(*word));
        let trouble = match word(1) {
            1 => Some(Trouble::Silent(0, 0)),
            2 => Some(Trouble::Crc),
            3 => Some(Trouble::Overrun),
            4 => Some(Trouble::Dma),
            5 => Some(Trouble::Slipped(0, 0)),
            _ => None,
        };
        let moment = Moment { periods: word(3), phase: word(4), words: [word(5), word(6)] };
        Self { scans: word(0), trouble, periods: word(2), moment, seen: word(7) != 0 }
    }
}

/// What came to the sync port, as it stands in memory.
#[must_use]
pub fn seen_to_words(seen: &Seen) -> [u32; SEEN_WORDS] {
    let (edge, span) = (seen.edge.unwrap_or_default(), seen.span.unwrap_or_default());
    [
        u32::from(seen.edge.is_some()),
        edge.scans.cast_unsigned(),
        u32::from(edge.part),
        seen.lost,
        u32::from(seen.span.is_some()),
        span.scans,
        span.counts,
    ]
}

/// From memory.
#[must_use]
pub fn seen_from_words([edge, scans, part, lost, span, of, counts]: [u32; SEEN_WORDS]) -> Seen {
    Seen {
        edge: (edge != 0).then_some(Ago { scans: scans.cast_signed(), part: part as u16 }),
        lost,
        span: (span != 0).then_some(Span { scans: of, counts }),
    }
}

/// What an emulated board is told at its start, in postcard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setup {
    /// Serial number.
    pub serial: Name,
    /// Scans per second.
    pub scan_rate_hz: u32,
    /// Count of starts.
    pub boot: u32,
    /// Blocks that the ring must hold.
    pub slots: u32,
    /// The channels of a scan.
    pub channels: Vec<Channel, MAX_CHANNELS>,
}

/// Writes a message into `buffer`; `None` when it does not fit.
pub fn to_text<'a, T: Serialize>(message: &T, buffer: &'a mut [u8]) -> Option<&'a [u8]> {
    postcard::to_slice(message, buffer).ok().map(|used| &*used)
}

/// Reads a message; `None` when it is not one.
pub fn from_text<'a, T: Deserialize<'a>>(text: &'a [u8]) -> Option<T> {
    postcard::from_bytes(text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_come_back_as_they_went() {
        let ask = Ask {
            op: Op::Stage as u32,
            argument: 7,
            alarm_us: 0x1_0000_0002,
            block_us: NEVER,
            to_device_tail: 3,
            to_host_head: 4,
            to_host_full: 1,
            log_head: u32::MAX,
        };
        assert_eq!(Ask::from_words(&ask.to_words()), ask);
        assert_eq!(Op::from_word(ask.op), Some(Op::Stage));
        assert_eq!(Op::from_word(0), None);
        for trouble in [None, Some(Trouble::Silent(0, 0)), Some(Trouble::Crc), Some(Trouble::Slipped(0, 0))] {
            let moment = Moment { periods: 7, phase: 16, words: [207, 216] };
            for seen in [false, true] {
                let delivery = Delivery { scans: 24, trouble, periods: 8, moment, seen };
                assert_eq!(Delivery::from_bytes(&delivery.to_bytes()), delivery);
            }
        }
        for edge in [None, Some(Ago { scans: -3, part: 0xFFFF })] {
            for span in [None, Some(Span { scans: 15, counts: 46_875 })] {
                let seen = Seen { edge, lost: 2, span };
                assert_eq!(seen_from_words(seen_to_words(&seen)), seen);
            }
        }
        let reply = Reply {
            now_us: 0xFFFF_FFFF_0000_0001,
            inputs: INTERLOCK_CLOSED | HELD,
            blocks: 9,
            to_device_head: 1,
            to_host_tail: 2,
            log_tail: 3,
            length: 4,
            ran_dry: 1,
            cuts: 6,
        };
        assert_eq!(Reply::from_words(&reply.to_words()), reply);
    }
}

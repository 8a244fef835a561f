//! Lockstep: how an emulated board and the simulator that serves it share memory and take turns.
//!
//! The emulated board has its own memory and 16 MB that a process on the PC can map. Where a wired
//! board uses converters, coil, inputs and a USB port, the emulated board uses this memory: it
//! writes an [`Ask`], signals the simulator, and halts until the simulator has written a [`Reply`].
//! Only one of the two runs at any time, and the board's time is the one in the reply. Therefore
//! the PC's clock does not affect any result, and the memory needs no other protection.
//!
//! | offset | bytes | written by | content |
//! |---|---|---|---|
//! | [`MAGIC_AT`] | 4 | simulator, once | [`MAGIC`]: this memory is served |
//! | [`ASK_AT`] | 64 | board | [`Ask`] |
//! | [`REPLY_AT`] | 64 | simulator | [`Reply`] |
//! | [`TEXT_AT`] | 4096 | both, in turn | [`Setup`], stage request, refusal or panic message |
//! | [`BLOCK_AT`] | 896 | simulator | a [`Delivery`], then the words of both converters |
//! | [`SEEN_AT`] | 28 | simulator | events at the sync port, if the [`Delivery`] announces them |
//! | [`DRIVE_AT`] | 480 | board | codes for the shaker's drive |
//! | [`TO_DEVICE_AT`] | 64 Ki | simulator | bytes for the board, a ring |
//! | [`TO_HOST_AT`] | 64 Ki | board | bytes for the host, a ring |
//! | [`LOG_AT`] | 64 Ki | board | log lines, encoded as for the link ([`crate::logs`]), a ring |
//!
//! Heads and tails count bytes since the start, modulo 2³²; everything is little-endian.

use crate::ad7606b::reader::{Clock, Moment, Trouble};
use crate::board::Seen;
use crate::ruler::{Ago, Span};
use heapless::Vec;
use jointrig_protocol::channel::{Channel, Name};
use jointrig_protocol::limits::MAX_CHANNELS;
use serde::{Deserialize, Serialize};

/// Address of the shared memory on the board.
pub const BASE: usize = 0x8000_0000;
/// Size of the shared memory: QEMU requires exactly this size.
pub const BYTES: usize = 16 << 20;
/// Changes with this layout, so that an image and a simulator built from different sources refuse
/// each other.
pub const MAGIC: u32 = 0x4A52_4C06;
/// Offset of [`MAGIC`].
pub const MAGIC_AT: usize = 0;
/// Offset of the board's [`Ask`].
pub const ASK_AT: usize = 0x40;
/// Offset of the simulator's [`Reply`].
pub const REPLY_AT: usize = 0x80;
/// Offset of longer messages; their length is in [`Ask::argument`] or [`Reply::length`].
pub const TEXT_AT: usize = 0x1000;
/// Longest such message.
pub const TEXT_BYTES: usize = 0x1000;
/// Offset of a block of scans.
pub const BLOCK_AT: usize = 0x2000;
/// Output of the shaker's drive at the largest code, V.
pub const DRIVE_FULL_SCALE_V: f32 = 10.0;
/// Offset of the codes for the shaker's drive, 16 bits each.
pub const DRIVE_AT: usize = 0x3000;
/// Offset of the slow values ([`Slow`](jointrig_protocol::slow::Slow) in postcard), preceded by
/// their length as a word.
pub const SLOW_AT: usize = 0x5000;
/// Longest encoded slow values.
pub const SLOW_BYTES: usize = 0x100;
/// Offset of a [`Seen`].
pub const SEEN_AT: usize = 0x5800;
/// Its length in words.
pub const SEEN_WORDS: usize = 7;
/// Counts of the simulated board's crystal per scan, the unit of [`Seen::span`].
pub const PERIOD: u32 = 3125;
/// Input bit: slow values have been measured; valid once, with the next block.
pub const SLOW_MEASURED: u32 = 128;
/// Offset of the ring of bytes for the board.
pub const TO_DEVICE_AT: usize = 0x1_0000;
/// Offset of the ring of bytes for the host.
pub const TO_HOST_AT: usize = 0x2_0000;
/// Offset of the ring of log lines.
pub const LOG_AT: usize = 0x3_0000;
/// The length of each ring, a power of two.
pub const RING_BYTES: u32 = 0x1_0000;
/// An instant that is never reached.
pub const NEVER: u64 = u64::MAX;

/// Operation that the board requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Op {
    /// The board has started and needs its [`Setup`]; the argument is the low word of its
    /// [`schema::HASH`](jointrig_protocol::schema::HASH).
    Start = 1,
    /// All tasks wait: for a block, an alarm, bytes, or space for bytes. With an argument of 1,
    /// bytes are exchanged over the UART, which the simulator does not see; it then replies soon in
    /// any case.
    Idle = 2,
    /// Switch the coil on, for the number of µs in the argument.
    Pulse = 3,
    /// Switch the coil off.
    Off = 4,
    /// A stage request; the argument is its length in bytes. The reply's length is that of a
    /// refusal, or 0.
    Stage = 5,
    /// The firmware has panicked; the argument is the length of the message in bytes.
    Panic = 6,
    /// Codes for the shaker's drive; the argument is their number. They are for the scans of the
    /// next block.
    Play = 7,
    /// Bring the shaker's drive to rest.
    Rest = 8,
    /// Restart both converters' rings with the next scan; the reply's length is that scan's number
    /// since the start.
    Join = 9,
    /// Select the external clock (argument 1) or the board's own (0) for the scans from now on. The
    /// reply's length is 0, or 1 when no clock is present at the input, or 2 when it has another
    /// rate.
    Clock = 10,
    /// Raise the sync output; it falls with the next block. The reply's length is the instant, in
    /// units of 2⁻¹⁶ of a scan after the scan that follows the newest one.
    Mark = 11,
}

impl Op {
    /// The operation for a word.
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
/// The reset key is being turned; valid once, with the next block.
pub const LOCAL_RESET: u32 = 4;
/// The scan clock waits for the host's acknowledgements.
pub const HELD: u32 = 8;
/// For tests: the acquisition task must panic.
pub const MUST_PANIC: u32 = 16;
/// For tests: it must read an address without memory.
pub const MUST_FAULT: u32 = 32;
/// For tests: it must overflow its stack.
pub const MUST_OVERFLOW: u32 = 64;

/// Words in an ask or a reply.
pub const WORDS: usize = 10;

/// Message of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ask {
    /// An [`Op`].
    pub op: u32,
    /// Argument of the operation.
    pub argument: u32,
    /// The next alarm, µs; [`NEVER`] for none.
    pub alarm_us: u64,
    /// The instant of the awaited block, µs; [`NEVER`] when the converters are stopped.
    pub block_us: u64,
    /// Bytes taken from the ring of bytes for the board.
    pub to_device_tail: u32,
    /// Bytes put into the ring of bytes for the host.
    pub to_host_head: u32,
    /// Whether a frame waits for space in it.
    pub to_host_full: u32,
    /// Bytes put into the ring of logs.
    pub log_head: u32,
}

impl Ask {
    /// No operation, nothing transferred, nothing awaited.
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

    /// Encodes for the shared memory.
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

    /// Decodes from the shared memory.
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

/// Message of the simulator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reply {
    /// The board's time, µs.
    pub now_us: u64,
    /// Bits: the inputs, and the run mode of the board.
    pub inputs: u32,
    /// Blocks delivered since the start.
    pub blocks: u32,
    /// Bytes put into the ring of bytes for the board.
    pub to_device_head: u32,
    /// Bytes taken from the ring of bytes for the host.
    pub to_host_tail: u32,
    /// Bytes taken from the ring of logs.
    pub log_tail: u32,
    /// Length of the text in bytes.
    pub length: u32,
    /// Reply to [`Op::Play`]: the drive has run dry and accepted nothing.
    pub ran_dry: u32,
    /// Number of times the link was cut since the start.
    pub cuts: u32,
}

impl Reply {
    /// Encodes for the shared memory.
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

    /// Decodes from the shared memory.
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

/// Timing of the emulated converters' clock: a period has only as many counts as are needed to
/// distinguish the phases of a [`Moment`].
pub const CLOCK: Clock = Clock { settled: 1, read_from: 10, read_by: 15 };
/// Blocks in each of the emulated converters' rings, as on the wired board.
pub const RING_BLOCKS: u32 = 8;

/// Header of a block; the words of both converters follow it, first converter 1, then converter 2,
/// little-endian.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Delivery {
    /// Scans whose words follow.
    pub scans: u32,
    /// A fault, if any; no words follow then.
    pub trouble: Option<Trouble>,
    /// Periods of the clock begun since the start.
    pub periods: u32,
    /// The values that the board reads after receiving the block, repeatedly until it can decide;
    /// every second reading has a phase outside the read-out.
    pub moment: Moment,
    /// Events at the sync port are stored at [`SEEN_AT`].
    pub seen: bool,
}

impl Delivery {
    /// Encodes for the shared memory.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; DELIVERY_BYTES] {
        let trouble = match self.trouble {
            None => 0,
            Some(Trouble::Silent(..)) => 1,
            Some(Trouble::Crc) => 2,
            Some(Trouble::Overrun) => 3,
            Some(Trouble::Dma) => 4,
            // detected by the board itself
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

    /// Decodes from the shared memory. Emulated converters that are silent have been so since the
    /// start, hence the zero counts.
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

/// Encodes events at the sync port for the shared memory.
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

/// Decodes events at the sync port.
#[must_use]
pub fn seen_from_words([edge, scans, part, lost, span, of, counts]: [u32; SEEN_WORDS]) -> Seen {
    Seen {
        edge: (edge != 0).then_some(Ago { scans: scans.cast_signed(), part: part as u16 }),
        lost,
        span: (span != 0).then_some(Span { scans: of, counts }),
    }
}

/// Start-up data of an emulated board, in postcard.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setup {
    /// Serial number.
    pub serial: Name,
    /// Scans per second.
    pub scan_rate_hz: u32,
    /// Number of this start.
    pub boot: u32,
    /// Number of blocks that the ring must hold.
    pub slots: u32,
    /// The channels of a scan.
    pub channels: Vec<Channel, MAX_CHANNELS>,
}

/// Serialises a message into `buffer`; `None` when it does not fit.
pub fn to_text<'a, T: Serialize>(message: &T, buffer: &'a mut [u8]) -> Option<&'a [u8]> {
    postcard::to_slice(message, buffer).ok().map(|used| &*used)
}

/// Deserialises a message; `None` when it is invalid.
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

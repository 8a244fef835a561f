//! The interface that a board must implement: scans, a coil, a drive, two inputs, bytes in, bytes
//! out, and optionally a stage.
//!
//! The interface is small on purpose. Every decision that does not need hardware is made above it,
//! where it can be tested on a PC; the traits here cover what only hardware can do. A board groups
//! its parts under [`Board`], so that one name refers to all of them, and passes each part to the
//! task that uses it.

use embassy_sync::blocking_mutex::raw::RawMutex;
use jointrig_protocol::answer::Refusal;
use jointrig_protocol::limits::BLOCK_SAMPLE_BYTES;
use jointrig_protocol::request::Stage as Place;
use jointrig_protocol::slow::Slow;
use jointrig_protocol::sync::{Clock, ClockFault};

use crate::ruler::{Ago, Span};

/// The parts of one board.
pub trait Board {
    /// Protects the data shared by the tasks: a critical section on a controller whose tasks run at
    /// several priorities, no protection in the simulator.
    type Mutex: RawMutex;
    /// The converters.
    type Scans: Scans;
    /// The hammer's coil.
    type Coil: Coil;
    /// The shaker's drive.
    type Drive: Drive;
    /// Interlock, emergency stop, local reset.
    type Inputs: Inputs;
    /// Bytes from the host.
    type Source: ByteSource;
    /// Bytes to the host.
    type Sink: ByteSink;
    /// Positions hammer and laser.
    type Stage: Stage;
}

/// A block of scans as the converters delivered it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Delivered {
    /// Scans in the block; at most as many as fit one block.
    pub scans: u8,
    /// Scans that were lost between the last block and this one.
    pub missed: u32,
    /// Whether any code may be beyond half of the converters' range; if not, the check for the ends
    /// of the range is skipped.
    pub loud: bool,
}

/// The converters, which sample all channels on one edge of a hardware timer.
pub trait Scans {
    /// Whether the scan clock can be held (a simulated front end). It then never runs more than
    /// half a ring ahead of the host's acknowledgement, so that nothing depends on the host's
    /// speed.
    fn can_be_held(&self) -> bool {
        false
    }

    /// Waits for the next block and writes it: scan by scan, channel by channel, little-endian 16
    /// bit.
    ///
    /// The sampling instants are set by the timer; a late call uses buffer space but does not
    /// change the timing.
    fn next(&mut self, block: &mut [u8; BLOCK_SAMPLE_BYTES]) -> impl Future<Output = Delivered>;

    /// Counts of the board's own crystal per nominal scan, the unit of [`Seen::span`].
    const PERIOD: u32 = 1;

    /// Activity of sync input and external clock since the last call; called after each block. The
    /// call also ends a pulse of the sync output.
    #[inline]
    fn seen(&mut self) -> Option<Seen> {
        None
    }

    /// Selects the clock that times the scans from now on. The count of scans continues. If the
    /// external clock fails, scans continue with the board's own crystal, slightly slower, so that
    /// the failure is visible in [`Seen::span`].
    ///
    /// # Errors
    /// No usable clock signal at the input; the board's own clock continues.
    fn clock(&mut self, clock: Clock) -> Result<(), ClockFault> {
        match clock {
            Clock::Internal => Ok(()),
            Clock::External { .. } => Err(ClockFault::Absent),
        }
    }

    /// Raises the sync output until the next call of [`Scans::seen`], and returns the instant.
    /// `None` on a board without a sync output.
    fn mark(&mut self) -> Option<Ago> {
        None
    }
}

/// Activity of sync input and external clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// The newest edge at the sync input.
    pub edge: Option<Ago>,
    /// Edges that followed another too fast for their instants to be known; a lower bound.
    pub lost: u32,
    /// Duration of some scans timed by an external clock.
    pub span: Option<Span>,
}

/// The coil that pulls the hammer's bolt.
pub trait Coil {
    /// Longest pulse, µs: the hardware ends any pulse by then, independently of the software.
    fn cap_us(&self) -> u32;

    /// Energises the coil once, from the next scan on, for `width_us` (already checked against the
    /// cap). The hardware must end the pulse.
    fn pulse(&mut self, width_us: u32);

    /// De-energises the coil immediately.
    fn off(&mut self);
}

/// The shaker's drive: a converter that outputs one code per scan, timed by the scan timer.
pub trait Drive {
    /// Output voltage at the largest code, V; 0 when the board has no shaker drive.
    fn full_scale_v(&self) -> f32;

    /// Takes as many codes as the block that was just delivered has scans. They are output without
    /// a gap after the previous codes; after the last code the output is at rest (0 V).
    ///
    /// An empty slice marks the end of a motion: codes given before are still output, and the next
    /// codes begin a new motion, whenever they come.
    ///
    /// # Errors
    /// [`RanDry`] when the converter has already passed the end of the previous codes: it is at
    /// rest and has accepted nothing.
    fn play(&mut self, codes: &[i16]) -> Result<(), RanDry>;

    /// Goes to rest immediately and discards all codes given before.
    fn rest(&mut self);
}

/// Codes were given to the drive too late.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RanDry;

/// A board without a shaker.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoDrive;

impl Drive for NoDrive {
    fn full_scale_v(&self) -> f32 {
        0.0
    }

    fn play(&mut self, _codes: &[i16]) -> Result<(), RanDry> {
        Err(RanDry)
    }

    fn rest(&mut self) {}
}

/// Inputs at the rig that a host cannot override.
pub trait Inputs {
    /// Whether the guard is closed.
    fn interlock_closed(&mut self) -> bool;
    /// Whether the emergency stop is pressed.
    fn emergency_stop(&mut self) -> bool;
    /// Whether a released emergency stop is being reset at the rig.
    fn local_reset(&mut self) -> bool;
    /// A fault of the guard chain to be reported to the host; each fault is returned once.
    fn fault(&mut self) -> Option<&'static str> {
        None
    }
    /// The specimen's temperature and the bias of sensors fed with a constant current, if measured
    /// since the last call (about ten times a second). `None` on a board that has neither.
    fn slow(&mut self) -> Option<Slow> {
        None
    }
}

/// Bytes from the host.
pub trait ByteSource {
    /// Waits for at least one byte and returns how many were written to `buffer`; 0 when the link
    /// was cut. A partly received frame is then dropped, and everything that moves comes to rest.
    fn read(&mut self, buffer: &mut [u8]) -> impl Future<Output = usize>;
}

/// Bytes to the host.
pub trait ByteSink {
    /// Waits until the link has accepted all bytes (one whole frame) or was cut.
    fn write(&mut self, frame: &[u8]) -> impl Future<Output = ()>;
}

/// Positions hammer and laser. Only a simulated rig can be positioned through the link.
pub trait Stage {
    /// Whether [`Stage::go`] can succeed.
    const PRESENT: bool;

    /// Positions hammer and laser, effective from the next scan.
    ///
    /// # Errors
    /// A [`Refusal`] for the host.
    fn go(&mut self, place: &Place) -> Result<(), Refusal>;
}

/// A rig whose hammer and laser are positioned manually.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoStage;

impl Stage for NoStage {
    const PRESENT: bool = false;

    fn go(&mut self, _place: &Place) -> Result<(), Refusal> {
        Err(Refusal::Unsupported)
    }
}

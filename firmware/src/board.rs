//! What a board must bring: scans, a coil, a drive, two inputs, bytes in, bytes out, and perhaps a
//! stage.
//!
//! The contract is small on purpose. Everything that can be decided above it is decided above it,
//! where a PC can test it; what stands here is what only hardware can do. A board groups its parts
//! under [`Board`] so that one name says them all, and hands each part to the task that uses it.

use embassy_sync::blocking_mutex::raw::RawMutex;
use jointrig_protocol::answer::Refusal;
use jointrig_protocol::limits::BLOCK_SAMPLE_BYTES;
use jointrig_protocol::request::Stage as Place;
use jointrig_protocol::slow::Slow;
use jointrig_protocol::sync::{Clock, ClockFault};

use crate::ruler::{Ago, Span};

/// The parts of one board.
pub trait Board {
    /// Guards what the tasks share: a critical section on a controller whose tasks run at several
    /// priorities, nothing in the simulator.
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
    /// Who moves hammer and laser.
    type Stage: Stage;
}

/// A block of scans as the converters delivered it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Delivered {
    /// Scans in the block, at most what fits it.
    pub scans: u8,
    /// Scans that were lost between the last block and this one.
    pub missed: u32,
    /// Whether any code may be beyond half of the converters' range; if not, none is looked at for
    /// its end.
    pub loud: bool,
}

/// The converters, sampling all channels on one edge of a hardware timer.
pub trait Scans {
    /// Whether the clock of the scans can be held (a simulated front end). It then never runs more
    /// than half a ring ahead of the host's acknowledgement, so that nothing depends on the host's
    /// speed.
    fn can_be_held(&self) -> bool {
        false
    }

    /// Waits for the next block and writes it: scan by scan, channel by channel, little-endian 16
    /// bit.
    ///
    /// The sampling instants are the timer's; being late here costs buffer space, never
    /// punctuality.
    fn next(&mut self, block: &mut [u8; BLOCK_SAMPLE_BYTES]) -> impl Future<Output = Delivered>;

    /// Counts of the board's own crystal in a nominal scan, of which [`Seen::span`] speaks.
    const PERIOD: u32 = 1;

    /// What sync input and external clock have done since this was asked last; asked after each
    /// block. Asking also ends a pulse of the sync output.
    #[inline]
    fn seen(&mut self) -> Option<Seen> {
        None
    }

    /// Lets this time the scans from now on. The count of scans goes on, and so do the scans when
    /// the clock fails: by the board's own crystal, a little slower, so that the failure shows in
    /// [`Seen::span`].
    ///
    /// # Errors
    /// Nothing that could be a clock comes to the input; the board's own goes on.
    fn clock(&mut self, clock: Clock) -> Result<(), ClockFault> {
        match clock {
            Clock::Internal => Ok(()),
            Clock::External { .. } => Err(ClockFault::Absent),
        }
    }

    /// Raises the sync output, until [`Scans::seen`] is asked next; when that was. None on a board
    /// without one.
    fn mark(&mut self) -> Option<Ago> {
        None
    }
}

/// What sync input and external clock have done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// The newest edge at the sync input.
    pub edge: Option<Ago>,
    /// Edges that came too fast after another for their instants to be known: at least so many.
    pub lost: u32,
    /// How long scans took that an external clock timed.
    pub span: Option<Span>,
}

/// The coil that pulls the hammer's bolt.
pub trait Coil {
    /// Longest pulse, µs: the hardware ends any pulse by then, whatever the software does.
    fn cap_us(&self) -> u32;

    /// Energises the coil once, from the next scan on, for `width_us` (already checked against the
    /// cap). The end of the pulse must be the hardware's doing.
    fn pulse(&mut self, width_us: u32);

    /// De-energises the coil at once.
    fn off(&mut self);
}

/// The shaker's drive: a converter that plays one code per scan, from the scans' own timer.
pub trait Drive {
    /// Output at the largest code, V; 0 when the board drives no shaker.
    fn full_scale_v(&self) -> f32;

    /// Takes the codes of as many scans as the block that was just delivered had. They are played
    /// without a gap after those given before; what follows the last code given is rest (0 V).
    ///
    /// No codes at all say that a motion ends here: what was given is still played, and the next
    /// codes begin another one, whenever they come.
    ///
    /// # Errors
    /// [`RanDry`] when the converter has already passed the end of what was given before: it rests,
    /// and took nothing.
    fn play(&mut self, codes: &[i16]) -> Result<(), RanDry>;

    /// To rest at once, whatever was given before.
    fn rest(&mut self);
}

/// The drive was given its codes too late.
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

/// Inputs at the rig that no host can overrule.
pub trait Inputs {
    /// Whether the guard is closed.
    fn interlock_closed(&mut self) -> bool;
    /// Whether the emergency stop is pressed.
    fn emergency_stop(&mut self) -> bool;
    /// Whether somebody at the rig resets a released emergency stop.
    fn local_reset(&mut self) -> bool;
    /// What is wrong with the guard chain, for the host: once for each thing that is.
    fn fault(&mut self) -> Option<&'static str> {
        None
    }
    /// The specimen's temperature and the bias of sensors that are fed with a constant current,
    /// when they were measured since this was asked last: some ten times a second. None on a board
    /// that has neither.
    fn slow(&mut self) -> Option<Slow> {
        None
    }
}

/// Bytes from the host.
pub trait ByteSource {
    /// Waits for at least one byte and returns how many were written; 0 when the link was cut: what
    /// was gathered of a frame is dropped, and everything that moves comes to rest.
    fn read(&mut self, buffer: &mut [u8]) -> impl Future<Output = usize>;
}

/// Bytes to the host.
pub trait ByteSink {
    /// Waits until the link has taken all bytes (one whole frame), or was cut.
    fn write(&mut self, frame: &[u8]) -> impl Future<Output = ()>;
}

/// Who moves hammer and laser. Only a simulated rig can be told through the link.
pub trait Stage {
    /// Whether [`Stage::go`] can succeed.
    const PRESENT: bool;

    /// Puts hammer and laser in place, from the next scan on.
    ///
    /// # Errors
    /// A [`Refusal`] for the host.
    fn go(&mut self, place: &Place) -> Result<(), Refusal>;
}

/// A rig whose hammer and laser are moved by people.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoStage;

impl Stage for NoStage {
    const PRESENT: bool = false;

    fn go(&mut self, _place: &Place) -> Result<(), Refusal> {
        Err(Refusal::Unsupported)
    }
}

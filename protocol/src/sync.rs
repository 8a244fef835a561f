//! Synchronisation with another recorder, by its clock or by edges that both record.
//!
//! Every instant is expressed in scans, which are the only time base for results. An edge that
//! another recorder also records has a scan index here and a time there; two such edges relate the
//! two clocks.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Largest allowed deviation of an external clock from its nominal rate, in ppm, measured against
/// the controller's crystal: crystals of recorders are accurate to 50 ppm, and the controller's own
/// adds another 50 ppm.
pub const CLOCK_TOLERANCE_PPM: u32 = 200;

/// The clock that times the scans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Clock {
    /// The controller's own crystal.
    #[default]
    Internal,
    /// The clock input: one rising edge for each scan.
    External {
        /// Its nominal rate, Hz; equal to the scan rate.
        rate_hz: u32,
    },
}

/// Fault of the external clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ClockFault {
    /// It is still being measured.
    Unproven,
    /// No edges arrive at the input.
    Absent,
    /// Edges arrive, but their rate deviates from the nominal one by more than
    /// [`CLOCK_TOLERANCE_PPM`].
    Rate,
    /// It was good, then stopped or left the tolerance while it timed the scans.
    Lost,
}

impl core::fmt::Display for ClockFault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Unproven => f.write_str("the external clock is still being measured; ask again"),
            Self::Absent => f.write_str(
                "no external clock: no edges come to the clock input; connect and start the other recorder's clock, or measure with \
                 sync.clock = \"internal\"",
            ),
            Self::Rate => write!(
                f,
                "the external clock is not within {CLOCK_TOLERANCE_PPM} ppm of one edge for each scan; set the other recorder to the \
                 plan's rate"
            ),
            Self::Lost => write!(
                f,
                "the external clock was lost: it stopped, or left {CLOCK_TOLERANCE_PPM} ppm, while it timed the scans; check cable and \
                 source, then run the same command again"
            ),
        }
    }
}

/// An instant, in scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Moment {
    /// The last scan taken at or before the instant.
    pub scan: u64,
    /// Fraction of a scan that had passed since then, in units of 2⁻¹⁶.
    pub part: u16,
}

impl Moment {
    /// The instant in scans; exact up to scan 2³⁷ (a month at 51.2 kHz).
    #[must_use]
    pub fn scans(&self) -> f64 {
        self.scan as f64 + f64::from(self.part) / 65_536.0
    }
}

/// Source of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Line {
    /// A rising edge at the sync input.
    Input,
    /// The sync output rose because the hammer's coil was switched on.
    Fired,
    /// The sync output rose because the hammer's force exceeded the trigger level.
    Trigger,
    /// The sync output rose because the host asked for it.
    Asked,
}

/// An edge at the sync input or output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Edge {
    /// Source of the edge.
    pub line: Line,
    /// Its number since the device started, from 1. Edges of the input that came too fast to be
    /// resolved are counted too; pulses of the output are counted separately. A jump shows how many
    /// are missing.
    pub number: u32,
    /// Its instant.
    pub at: Moment,
}

/// Present state of clock and edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Sync {
    /// The clock that times the scans.
    pub clock: Clock,
    /// Fault of the external clock that was requested last; nothing can be started until a clock is
    /// requested again.
    pub fault: Option<ClockFault>,
    /// Relative deviation of the external clock from the controller's crystal, in ppm, positive
    /// when faster; 0 with the internal clock.
    pub ppm: f32,
    /// Edges at the input since the device started.
    pub edges: u32,
    /// Edges among these that followed another edge too fast to be resolved. A lower bound: the
    /// hardware reports that there were some, not how many.
    pub edges_lost: u32,
    /// Pulses of the output since the device started.
    pub pulses: u32,
}

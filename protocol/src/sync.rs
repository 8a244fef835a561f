//! Sync: in step with another recorder, by its clock or by edges that both see.
//!
//! Every instant is told in scans, which are the only clock for results: an edge that another recorder also sees has a scan index here and
//! a time there, and two such edges tie the two clocks together.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// By how much an external clock may differ from its nominal rate, as the controller's own crystal measures it, in parts of a million: crystals
/// of recorders are good to 50, and the controller's adds its own 50.
pub const CLOCK_TOLERANCE_PPM: u32 = 200;

/// What times the scans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Clock {
    /// The controller's own crystal.
    #[default]
    Internal,
    /// The clock input: one rising edge for each scan.
    External {
        /// Its nominal rate, Hz: that of the scans.
        rate_hz: u32,
    },
}

/// What is wrong with the external clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ClockFault {
    /// It is still being measured.
    Unproven,
    /// No edges come to the input.
    Absent,
    /// Edges come, and their rate is more than [`CLOCK_TOLERANCE_PPM`] away from the nominal one.
    Rate,
    /// It was good, and stopped or left the tolerance while it timed the scans.
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
    /// The last scan that was taken at it or before it.
    pub scan: u64,
    /// The part of a scan that had passed since, in parts of 2¹⁶.
    pub part: u16,
}

impl Moment {
    /// In scans; exact up to scan 2³⁷ (a month at 51.2 kHz).
    #[must_use]
    pub fn scans(&self) -> f64 {
        self.scan as f64 + f64::from(self.part) / 65_536.0
    }
}

/// Which edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Line {
    /// A rising edge at the sync input.
    Input,
    /// The sync output rose because the hammer's coil was switched on.
    Fired,
    /// The sync output rose because the hammer's force passed the trigger's level.
    Trigger,
    /// The sync output rose because the host asked for it.
    Asked,
}

/// An edge at the sync input or output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Edge {
    /// Which.
    pub line: Line,
    /// Its number since the device started, from 1: edges of the input that came too fast to be told count too, and pulses of the
    /// output are counted apart. A jump tells what is missing.
    pub number: u32,
    /// When.
    pub at: Moment,
}

/// Clock and edges as they are now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, Schema)]
pub struct Sync {
    /// What times the scans.
    pub clock: Clock,
    /// What is wrong with the external clock that was asked for last; nothing can be started until a clock is asked for anew.
    pub fault: Option<ClockFault>,
    /// How much faster the external clock is than the controller's crystal says, in parts of a million; 0 with the internal one.
    pub ppm: f32,
    /// Edges at the input since the device started.
    pub edges: u32,
    /// Those of them that came too fast after another to be told. At least so many: the hardware says that there were some, not how many.
    pub edges_lost: u32,
    /// Pulses of the output since the device started.
    pub pulses: u32,
}

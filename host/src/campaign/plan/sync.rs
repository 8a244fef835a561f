//! Synchronisation with another recorder.

use jointrig_protocol::sync::Clock;
use serde::Deserialize;
use toml::Spanned;

use super::Plan;

/// Synchronisation with another recorder; if absent, the device's own clock times the scans, and no
/// edges are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SyncPlan {
    /// The clock that times the scans.
    pub clock: ClockSource,
}

/// The clock that times the scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClockSource {
    /// The device's own crystal.
    Internal,
    /// The device's clock input, one edge per scan at `record.rate_hz`.
    External,
}

impl Plan {
    /// The clock to select; `None` if the plan does not specify one.
    pub fn clock(&self) -> Option<Clock> {
        self.sync.as_ref().map(Spanned::get_ref).map(|own| match own.clock {
            ClockSource::Internal => Clock::Internal,
            ClockSource::External => Clock::External { rate_hz: self.record.get_ref().rate_hz },
        })
    }
}

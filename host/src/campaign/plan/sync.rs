//! In step with another recorder.

use jointrig_protocol::sync::Clock;
use serde::Deserialize;
use toml::Spanned;

use super::Plan;

/// In step with another recorder; without it, the device's own clock times the scans, and no edge is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SyncPlan {
    /// What times the scans.
    pub clock: ClockSource,
}

/// What times the scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ClockSource {
    /// The device's own crystal.
    Internal,
    /// The device's clock input, one edge for each scan: `record.rate_hz`.
    External,
}

impl Plan {
    /// What is to time the scans; none where the plan does not speak of it.
    pub fn clock(&self) -> Option<Clock> {
        self.sync.as_ref().map(Spanned::get_ref).map(|own| match own.clock {
            ClockSource::Internal => Clock::Internal,
            ClockSource::External => Clock::External { rate_hz: self.record.get_ref().rate_hz },
        })
    }
}

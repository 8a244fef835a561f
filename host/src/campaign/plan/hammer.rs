//! Who swings the hammer.

use serde::Deserialize;
use toml::Spanned;

use super::Plan;
use super::faults::Faults;

/// Default waiting time for a person to strike, s.
const PATIENCE_S: f64 = 600.0;
/// Longest permitted waiting time for a person to strike, s: a day.
const LONGEST_S: f64 = 86_400.0;

/// The hammer; if absent, the device's coil swings it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HammerPlan {
    /// Who swings it.
    pub by: Swung,
    /// How long to wait for a person to strike, s; ten minutes if absent.
    pub patience_s: Option<f64>,
}

/// Who swings the hammer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Swung {
    /// The device's coil, commanded by the host.
    Coil,
    /// A person: the host waits for the force.
    Hand,
}

impl Plan {
    /// How long to wait for a person to strike, s; `None` if the coil swings the hammer.
    pub fn by_hand(&self) -> Option<f64> {
        let own = self.hammer.as_ref().map(Spanned::get_ref).filter(|own| own.by == Swung::Hand)?;
        Some(own.patience_s.unwrap_or(PATIENCE_S))
    }

    pub(super) fn check_hammer(&self, faults: &mut Faults) {
        let Some(own) = &self.hammer else { return };
        let at = own.span().start;
        faults.unless(
            own.get_ref().patience_s.is_none_or(|patience_s| (1.0..=LONGEST_S).contains(&patience_s)),
            at,
            format!("hammer.patience_s must be 1 to {LONGEST_S}"),
        );
        faults.unless(
            self.by_hand().is_none() || self.force.get_ref().softer.is_none(),
            at,
            "force.softer needs the coil: nobody hits twice as he means to (hammer.by)",
        );
    }
}

//! Checks for a hidden resonance that only one specimen takes part in.

use crate::hysteresis::compliance::{CLEAR, over_noise};
use crate::hysteresis::compliance::{ContactCompliance, ImaginaryPeak};
use crate::hysteresis::phase_split::{Curve, PhaseSplit};
use crate::results::{FrfCurve, Role};

/// If the phase between the specimens stays below this, nothing is hidden.
const QUIET: f64 = 0.25;

/// Verdict from Δx/T between 100 and 400 Hz.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HiddenResonance {
    /// The contact's signals are not available.
    NoSignals,
    /// Too few lines.
    TooFewLines,
    /// A resonance of one specimen in its clamp, and the phases that identify the specimen, if the
    /// curves needed for it are available.
    Found(ImaginaryPeak, Option<PhaseSplit>),
    /// Both specimens move in phase with the force.
    Quiet(ImaginaryPeak),
    /// Some phase difference, but not significant against the noise.
    Unclear(ImaginaryPeak),
}

impl HiddenResonance {
    /// Searches one compliance.
    pub fn in_compliance(contact: &ContactCompliance) -> Self {
        match contact.imaginary_peak() {
            None => Self::TooFewLines,
            Some(peak) if peak.stands_out() => Self::Found(peak, None),
            Some(peak) if peak.over_level < QUIET => Self::Quiet(peak),
            Some(peak) => Self::Unclear(peak),
        }
    }

    /// The clearest verdict from hits and sweeps; among equals, that of the hits. A peak from the
    /// hits must be present in each of several `groups` of them, if there are enough.
    pub fn of(
        hits: Option<&ContactCompliance>,
        groups: &[ContactCompliance],
        sweeps: &[ContactCompliance],
    ) -> Self {
        let of_hits = match hits.map_or(Self::NoSignals, Self::in_compliance) {
            Self::Found(peak, _)
                if over_noise(groups, peak.frequency_hz).is_some_and(|over| over < CLEAR) =>
            {
                Self::Unclear(peak)
            }
            other => other,
        };
        let rank = |found: &Self| match found.ok() {
            Some(false) => 2,
            Some(true) => 1,
            None => 0,
        };
        // max_by_key returns the last of equal elements
        sweeps.iter().map(Self::in_compliance).chain([of_hits]).max_by_key(rank).unwrap_or(of_hits)
    }

    /// Adds the phases of specimens and arms, if a resonance was found and all curves are
    /// available.
    #[must_use]
    pub fn with_phases(self, curves: &[FrfCurve]) -> Self {
        match self {
            Self::Found(peak, _) => Self::Found(peak, split(curves, peak.frequency_hz)),
            other => other,
        }
    }

    /// Passed, failed, or `None` if undecided.
    pub fn ok(&self) -> Option<bool> {
        match self {
            Self::Found(..) => Some(false),
            Self::Quiet(_) => Some(true),
            Self::NoSignals | Self::TooFewLines | Self::Unclear(_) => None,
        }
    }

    /// Frequency of the resonance, Hz.
    pub fn resonance_hz(&self) -> Option<f64> {
        if let Self::Found(peak, _) = self { Some(peak.frequency_hz) } else { None }
    }
}

fn split(curves: &[FrfCurve], resonance_hz: f64) -> Option<PhaseSplit> {
    let of = |role: Role| {
        curves.iter().find(|c| c.role == role).map(|c| Curve {
            first_hz: c.first_hz,
            step_hz: c.step_hz,
            magnitude: &c.magnitude_m_per_n,
            phase_deg: &c.phase_deg,
        })
    };
    let specimens = [of(Role::SpecimenA)?, of(Role::SpecimenB)?];
    PhaseSplit::near(specimens, [of(Role::ArmA)?, of(Role::ArmB)?], resonance_hz)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_all_the_curves_the_finding_stays_as_it_was() {
        let peak = ImaginaryPeak { frequency_hz: 192.0, over_level: 0.9, over_median: 9.0 };
        for found in [HiddenResonance::Quiet(peak), HiddenResonance::Found(peak, None)] {
            assert_eq!(found.with_phases(&[]), found);
        }
    }
}

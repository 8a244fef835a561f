//! What a reader must know before using a number.

use super::number::short;
use crate::analyse::{ImpactLoops, NoFit, SlopeIs};
use crate::substructuring::direct::Direct;

/// Noise above this part of the stiffness is told.
const LOUD: f64 = 0.3;

/// That noise alone moves a line by much of what the lines say; both in N/m.
pub fn loud_noise(median: f64, noise: f64) -> Option<String> {
    (noise > LOUD * median.abs()).then(|| {
        format!(
            "noise alone moves k_z of a line by {:.1} N/µm (median): {:.0} % of what the lines say",
            noise * 1e-6,
            100.0 * noise / median.abs()
        )
    })
}

/// What T/Δx is, and is not.
pub fn direct(found: &Direct) -> Vec<String> {
    let mut warnings = vec![
        "T is the load cells' sum, not the force at the contact: the static arm's inertia adds some per cent, growing with the frequency's square".to_owned(),
    ];
    if found.is_drowned() {
        warnings.push("Δx is buried in noise here: no stiffness can be read from it".to_owned());
    }
    warnings
}

/// What the slope of first cycles is, and what it may be called.
pub fn impact_loops(found: &ImpactLoops) -> Vec<String> {
    let mut warnings = vec![
        "Slope over the first cycle of a decay: every mode that the hit excites is in it, also the specimen's tilt on its clamp.".to_owned(),
    ];
    if found.open > 0 {
        warnings.push(format!(
            "In {} of {} first cycles a straight line explains less than 90 % of T: local modes open those loops.",
            found.open,
            found.records.len()
        ));
    }
    if found.slope_n_per_m.mean < 0.0 {
        warnings.push("A negative slope: the polarity of a vibrometer or of the load cells is wrong.".into());
    }
    match found.slope_is {
        SlopeIs::Contact | SlopeIs::NotStraight => {}
        SlopeIs::Resonant(f) => warnings.push(format!(
            "This slope is k_eq, not k_T: a resonance of one specimen at {} Hz is excited by every hit and moves Δx without the force.",
            short(f)
        )),
        SlopeIs::Undecided => warnings.push(
            "This slope is called k_eq: whether a resonance of one specimen is in it cannot be told from these records.".into(),
        ),
    }
    warnings
}

/// What a resonance of one specimen does to a loop that still looks stuck.
pub fn beside_resonance(frequency_hz: f64, resonance_hz: f64) -> String {
    let (way, effect) = if frequency_hz < resonance_hz { ("adds to", "low") } else { ("takes from", "high") };
    format!(
        "a resonance of one specimen at {} Hz {way} Δx here: this k_T reads {effect}, by more the nearer it is",
        short(resonance_hz)
    )
}

/// Why there is no fit.
pub fn no_fit(why: &NoFit) -> String {
    match why {
        NoFit::ImportWithoutVariance => {
            "it needs the variance of A, B and AJB, and FRFs from elsewhere came without".into()
        }
        NoFit::FileWithoutVariance(name) => format!(
            "{name} has no array `variance`, and `fit` weighs every cell with its noise: store it (`jointrig frf --out` does), or state --noise FRACTION"
        ),
        NoFit::Failed(error) => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resonance_moves_k_t_the_other_way_on_its_other_side() {
        assert!(beside_resonance(250.0, 192.0).contains("reads high"));
        assert!(beside_resonance(100.0, 192.0).contains("reads low"));
    }
}

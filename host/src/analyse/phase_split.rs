//! Whose resonance it is that hides: the phase of each specimen against its own arm, from the same impact (the paper's Fig. 8).

use crate::results::number::{decimals, short};
use crate::results::{Check, FrfCurve, Role};
use num_complex::Complex;

/// The split is looked for within this many Hz of the resonance: the phase turns fastest beside the peak of Δx/T.
const NEAR_HZ: f64 = 8.0;
/// Lines within ± this many Hz are averaged.
const AVERAGE_HZ: f64 = 0.75;
/// A smaller turn of the phase is noise, degrees.
const CLEAR_DEG: f64 = 5.0;

/// Phase differences at one frequency, degrees, −180…180.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PhaseSplit {
    frequency_hz: f64,
    /// Specimen A against specimen B.
    specimens: f64,
    /// Specimen A against arm A.
    a: f64,
    /// Specimen B against arm B.
    b: f64,
    /// Arm A against arm B.
    arms: f64,
}

/// The check with the phases that tell whose resonance it is; as it was where the curves are not all there.
pub fn with_phases(check: Check, curves: &[FrfCurve]) -> Check {
    let (Some(false), Some(resonance_hz)) = (check.ok, check.frequency_hz) else { return check };
    let Some(split) = split(curves, resonance_hz) else { return check };
    let (mine, other) = (split.a.abs(), split.b.abs());
    let whose = match () {
        () if mine > CLEAR_DEG && mine > 2.0 * other => " So it is specimen A that moves in its clamp.",
        () if other > CLEAR_DEG && other > 2.0 * mine => " So it is specimen B that moves in its clamp.",
        () => "",
    };
    let degrees = |value: f64| decimals(value, 0);
    let phases = format!(
        " At {} Hz specimen A turns by {}° against specimen B; against their own arms A turns by {}° and B by {}°, and the arms by {}° \
         against each other.{whose}",
        short(split.frequency_hz),
        degrees(split.specimens),
        degrees(split.a),
        degrees(split.b),
        degrees(split.arms)
    );
    Check { meaning: check.meaning + &phases, ..check }
        .with("phase_specimen_a_to_b_deg", split.specimens)
        .with("phase_specimen_a_to_arm_deg", split.a)
        .with("phase_specimen_b_to_arm_deg", split.b)
        .with("phase_arm_a_to_b_deg", split.arms)
}

/// Where x_A and x_B are furthest out of phase near `resonance_hz`.
fn split(curves: &[FrfCurve], resonance_hz: f64) -> Option<PhaseSplit> {
    let of = |role: Role| curves.iter().find(|c| c.role == role);
    let [x_a, x_b, arm_a, arm_b] =
        [of(Role::SpecimenA)?, of(Role::SpecimenB)?, of(Role::ArmA)?, of(Role::ArmB)?];
    let near =
        (0..x_a.phase_deg.len()).map(|l| x_a.frequency_hz(l)).filter(|f| (f - resonance_hz).abs() <= NEAR_HZ);
    near.filter_map(|f| {
        Some(PhaseSplit {
            frequency_hz: f,
            specimens: turned(x_a, x_b, f)?,
            a: turned(x_a, arm_a, f)?,
            b: turned(x_b, arm_b, f)?,
            arms: turned(arm_a, arm_b, f)?,
        })
    })
    .max_by(|x, y| x.specimens.abs().total_cmp(&y.specimens.abs()))
}

/// Phase of one curve against another around a frequency, degrees; none off their lines.
fn turned(curve: &FrfCurve, against: &FrfCurve, frequency_hz: f64) -> Option<f64> {
    let mean = |c: &FrfCurve| {
        let lines =
            (0..c.phase_deg.len()).filter(|&l| (c.frequency_hz(l) - frequency_hz).abs() <= AVERAGE_HZ);
        let sum: Complex<f64> =
            lines.map(|l| Complex::from_polar(c.magnitude_m_per_n[l], c.phase_deg[l].to_radians())).sum();
        (sum.norm() > 0.0).then_some(sum)
    };
    let phase = (mean(curve)? * mean(against)?.conj()).arg().to_degrees();
    phase.is_finite().then_some(phase)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Everything moves alike but one specimen, which has a mode of its own at 192 Hz.
    fn curves(own: Role) -> Vec<FrfCurve> {
        let role = |role: Role| {
            let (magnitude_m_per_n, phase_deg) = (0..400)
                .map(|l| {
                    let f = 100.0 + 0.5 * f64::from(l);
                    let alike = Complex::from_polar(1e-8, -0.01 * f);
                    let ratio = Complex::new(1.0 - (f / 192.0).powi(2), 0.02 * f / 192.0);
                    let y = if role == own { alike * (1.0 + 0.02 * ratio.inv()) } else { alike };
                    (y.norm(), y.arg().to_degrees())
                })
                .unzip();
            FrfCurve {
                configuration: "AJB".into(),
                role,
                output: String::new(),
                input: "I_MZ".into(),
                hits: 3,
                first_hz: 100.0,
                step_hz: 0.5,
                magnitude_m_per_n,
                phase_deg,
                coherence: Vec::new(),
            }
        };
        [Role::SpecimenA, Role::SpecimenB, Role::ArmA, Role::ArmB].map(role).into()
    }

    fn found() -> Check {
        Check::new("hidden-resonance", Some(false), "A resonance hides.").at(192.0)
    }

    #[test]
    fn the_specimen_that_leaves_its_arm_is_named() {
        for (own, name) in [(Role::SpecimenA, "specimen A"), (Role::SpecimenB, "specimen B")] {
            let check = with_phases(found(), &curves(own));
            assert!(check.meaning.contains(&format!("it is {name} that moves")), "{}", check.meaning);
            // the mode adds ±45° where it is half as large as at its peak: ratio 1 against 1
            assert!(check.values["phase_specimen_a_to_b_deg"].abs() > 25.0, "{check:?}");
            assert!(check.values["phase_arm_a_to_b_deg"].abs() < 1e-9, "{check:?}");
        }
    }

    #[test]
    fn a_check_that_passed_or_lacks_a_curve_stays_as_it_was() {
        let quiet = Check::new("hidden-resonance", Some(true), "Nothing hides.");
        assert_eq!(with_phases(quiet.clone(), &curves(Role::SpecimenA)), quiet);
        assert_eq!(with_phases(found(), &curves(Role::SpecimenA)[..3]), found());
    }
}

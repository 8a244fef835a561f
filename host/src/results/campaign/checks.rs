//! Whether the numbers may be believed: clamp in series, hidden resonance.

use crate::hysteresis::compliance::ContactCompliance;
use crate::identified::SCATTER_OF_LINES;
use crate::results::number::{micro, short};
use crate::results::{Check, Joint, OverCycles, Results, Statistics};
use crate::substructuring::Dof;
use crate::substructuring::joint::NORMAL_95;

/// Loops stiffer than FBS by more than this: something between arm and specimen gives way.
const SERIES_RATIO: f64 = 1.5;

/// A scatter of T/Δx over lines below this fraction of its mean is clear enough to compare with.
const CLEAR: f64 = 0.3;

/// Name of the check on what lies between the arms and the contact.
pub const SERIES_COMPLIANCE: &str = "series-compliance";
/// Name of the check on resonances of one specimen alone.
pub const HIDDEN_RESONANCE: &str = "hidden-resonance";

/// What FBS sees between the arms over the main band: the recommended estimate where it identified something, or the
/// headline's method.
pub fn between_the_arms(results: &Results) -> Option<Statistics> {
    let z = results.quoted().and_then(|r| r.joint.get(&Dof::Z)).filter(|z| z.identified);
    z.map(|z| Statistics { mean: z.stiffness, std: z.std, median: z.stiffness, ci95: Some(z.ci95) })
        .or_else(|| results.headline_joint().and_then(|j| j.sliding_stiffness()).copied())
}

/// What the specimens' own vibrometers see: T/Δx in frequency where it is clear, or the impacts' loops.
pub fn at_the_specimens(direct: Option<&Joint>, loops: Option<OverCycles>) -> Option<OverCycles> {
    direct
        .and_then(|joint| Some((joint.sliding_stiffness()?, joint.lines)))
        .filter(|(k, _)| k.std < CLEAR * k.mean)
        .map(|(k, lines)| OverCycles { mean: k.mean, std: k.std, cycles: lines, ci95: None })
        .or(loops)
}

/// Compares what FBS sees between the arms with what the loops see at the specimens.
///
/// A flexible clamp lies between the arms' points and the contact, but not between the laser spots and the
/// contact: then 1/k_FBS = 1/k_T + 1/k_clamp.
pub fn series_compliance(fbs: Option<&Statistics>, loops: Option<OverCycles>) -> Check {
    let name = SERIES_COMPLIANCE;
    let (Some(fbs), Some(loops)) = (fbs, loops) else {
        return Check::new(
            name,
            None,
            "FBS and loops are both needed to tell whether clamp and contact are in series; only one of them is here. An FBS value \
             taken on the arms is k_T only if the clamps are much stiffer than the contact.",
        );
    };
    let (k_fbs, k_loops) = (fbs.mean, loops.mean);
    if k_fbs <= 0.0 || k_loops <= 0.0 || fbs.std > SCATTER_OF_LINES * k_fbs {
        return Check::new(
            name,
            None,
            "FBS did not identify a stiffness well enough to compare it with the loops: its scatter is larger than its value.",
        );
    }
    let ratio = k_loops / k_fbs;
    let with = |check: Check| {
        check
            .with("ratio", ratio)
            .with("fbs_stiffness_n_per_m", k_fbs)
            .with("loop_stiffness_n_per_m", k_loops)
    };
    if ratio > SERIES_RATIO {
        let compliance = 1.0 / k_fbs - 1.0 / k_loops;
        // independent measurements: the compliances' variances add
        let std = (fbs.std / (k_fbs * k_fbs)).hypot(loops.std / (k_loops * k_loops));
        let series = 1.0 / compliance;
        let [low, high] = [compliance + NORMAL_95 * std, compliance - NORMAL_95 * std].map(|c| 1.0 / c);
        let meaning = format!(
            "The contact measured at the specimens is {} times stiffer than what FBS sees between the arms ({} against {} N/µm). Clamp and contact are in series, and the clamp gives way: \
             the FBS value is not k_T. What lies between arms and contact has about {} N/µm by itself \
             (95 % {}…{}).",
            short(ratio),
            short(micro(k_loops)),
            short(micro(k_fbs)),
            short(micro(series)),
            short(micro(low)),
            if high > 0.0 { short(micro(high)) } else { "∞".into() }
        );
        return with(
            Check::new(name, Some(false), meaning)
                .with("series_stiffness_n_per_m", series)
                .with("series_stiffness_low_n_per_m", low)
                .with("series_stiffness_high_n_per_m", if high > 0.0 { high } else { f64::INFINITY })
                .with("series_compliance_m_per_n", compliance)
                .with("series_compliance_std_m_per_n", std),
        );
    }
    if ratio < 1.0 / SERIES_RATIO {
        let meaning = format!(
            "The contact measured at the specimens is softer than what FBS sees between the arms ({} against {} N/µm): no series compliance explains that. Look at the loops' shape \
             and at the FBS methods' agreement first.",
            short(micro(k_loops)),
            short(micro(k_fbs))
        );
        return with(Check::new(name, None, meaning));
    }
    let meaning = format!(
        "FBS on the arms and the vibrometers at the specimens see stiffness of one size ({} and {} N/µm): nothing soft lies between arm and contact, so the FBS value may be \
         read as k_T.",
        short(micro(k_fbs)),
        short(micro(k_loops))
    );
    with(Check::new(name, Some(true), meaning))
}

/// Looks for a resonance that only one specimen takes part in.
pub fn hidden_resonance(contact: Option<&ContactCompliance>) -> Check {
    let name = HIDDEN_RESONANCE;
    let Some(contact) = contact else {
        return Check::new(
            name,
            None,
            "Hits along z on A with both specimens' vibrometers and the load cells are needed to look for it.",
        );
    };
    let Some(peak) = contact.imaginary_peak() else {
        return Check::new(name, None, "Too few lines between 100 and 400 Hz to look for it.");
    };
    let check = |ok, meaning: String| {
        Check::new(name, ok, meaning).at(peak.frequency_hz).with("peak_over_level", peak.over_level)
    };
    if peak.stands_out() {
        return check(
            Some(false),
            format!(
                "Specimen A and specimen B move out of phase near {} Hz, while the force does not: a resonance of one specimen in its clamp. Loops near it \
                 become ellipses whose slope is k_eq, not k_T.",
                short(peak.frequency_hz)
            ),
        );
    }
    if peak.over_level < 0.25 {
        let mut quiet = Check::new(
            name,
            Some(true),
            "Both specimens move in phase with the force between 100 and 400 Hz: no resonance hides there.",
        );
        quiet = quiet.with("peak_over_level", peak.over_level);
        return quiet;
    }
    check(
        None,
        format!(
            "There is some phase between the specimens near {} Hz, but it does not stand out enough from the noise to call it a resonance.",
            short(peak.frequency_hz)
        ),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fbs(mean: f64, std: f64) -> Statistics {
        Statistics { mean, std, median: mean, ci95: None }
    }

    fn loops(mean: f64) -> OverCycles {
        OverCycles { mean, std: 4e6, cycles: 70, ci95: None }
    }

    #[test]
    fn a_soft_clamp_is_named_with_its_stiffness() {
        // the default rig: contact 180, clamp 31.2 N/µm
        let k = 1.0 / (1.0 / 180e6 + 1.0 / 31.2e6);
        let check = series_compliance(Some(&fbs(k, 1e6)), Some(loops(180e6)));
        assert_eq!(check.ok, Some(false));
        assert!((check.values["series_stiffness_n_per_m"] / 31.2e6 - 1.0).abs() < 1e-9);
        assert!(check.meaning.contains("not k_T") && check.meaning.contains("in series"));
        // σ of the two compliances: 1e6/26.59e6² and 4e6/180e6², in quadrature 1.42e-9 m/N of 32.05e-9
        let [low, high] = ["low", "high"].map(|end| check.values[&format!("series_stiffness_{end}_n_per_m")]);
        assert!((low / 28.7e6 - 1.0).abs() < 0.01 && (high / 34.2e6 - 1.0).abs() < 0.01, "{low:e} {high:e}");
    }

    #[test]
    fn a_stiff_clamp_passes_and_noise_decides_nothing() {
        assert_eq!(series_compliance(Some(&fbs(179e6, 9e6)), Some(loops(181e6))).ok, Some(true));
        assert_eq!(series_compliance(Some(&fbs(26e6, 45e6)), Some(loops(181e6))).ok, None);
        assert_eq!(series_compliance(Some(&fbs(280e6, 4e6)), Some(loops(150e6))).ok, None);
        assert_eq!(series_compliance(None, Some(loops(181e6))).ok, None);
        assert_eq!(series_compliance(Some(&fbs(26e6, 1e6)), None).ok, None);
    }
}

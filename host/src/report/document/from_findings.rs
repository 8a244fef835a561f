//! Converts the findings on the joint to the format of the results.

use crate::analyse::{Findings, Row, Substructured};
use crate::report::words::warning_sentences;
use crate::results::{DIRECT, Goodness, Joint, JointSpectrum, Refusal, SpectrumCurve, rounded};
use crate::substructuring::direct::Direct;
use crate::substructuring::fit::{self, Fitted};
use crate::substructuring::{BandStatistic, Dof, JointRow};
use std::collections::BTreeMap;

/// The rows, and what was refused: line-by-line methods, fits, T/Δx.
pub fn rows(found: &Findings) -> (Vec<Joint>, Vec<Refusal>) {
    let of_frfs = found.substructured.as_ref();
    let mut joint: Vec<Joint> = of_frfs.iter().flat_map(|s| &s.rows).map(by_line).collect();
    let refusal = |method: &str, idms, reason| Refusal { method: method.into(), idms, reason };
    let mut refused: Vec<Refusal> = (of_frfs.iter().flat_map(|s| &s.refused))
        .map(|r| refusal(r.method.name(), r.idms, r.reason.clone()))
        .collect();
    for one in &found.fits {
        match &one.outcome {
            Ok(fitted) => joint.push(by_fit(fitted)),
            Err(why) => refused.push(refusal(fit::NAME, one.idms.count(), warning_sentences::no_fit(why))),
        }
    }
    joint.extend(found.contact.as_ref().and_then(|contact| contact.direct.as_ref()).map(at_the_specimens));
    (joint, refused)
}

fn by_line(row: &Row) -> Joint {
    let mut joint = of_row(&row.joint);
    joint.noise_n_per_m = row.noise_n_per_m.iter().map(|(dof, noise)| (dof.name().into(), *noise)).collect();
    if let Some((k, noise)) = joint.sliding_stiffness().zip(joint.noise_n_per_m.get("z")) {
        joint.warnings.extend(warning_sentences::loud_noise(k.median, *noise));
    }
    joint
}

fn by_fit(fitted: &Fitted) -> Joint {
    let goodness = Goodness {
        chi_square_per_dof: fitted.chi_square_per_dof,
        largest_error: fitted.largest_error,
        settled: fitted.converged,
    };
    Joint { goodness: Some(goodness), ..of_row(&fitted.row()) }
}

fn at_the_specimens(found: &Direct) -> Joint {
    let along_z = |s| BTreeMap::from([("z".to_owned(), s)]);
    Joint {
        method: DIRECT.into(),
        band_hz: found.band_hz,
        stiffness_n_per_m: along_z(found.stiffness_n_per_m),
        damping_n_s_per_m: along_z(found.damping_n_s_per_m),
        lines: found.lines,
        warnings: warning_sentences::direct(found),
        ..Joint::default()
    }
}

fn of_row(row: &JointRow) -> Joint {
    let finite = |s: &BandStatistic| s.mean.is_finite() && s.std.is_finite();
    let split = |all: &BTreeMap<Dof, BandStatistic>, is: fn(Dof) -> bool| {
        all.iter()
            .filter(|(dof, s)| is(**dof) && finite(s))
            .map(|(dof, s)| (dof.name().to_owned(), *s))
            .collect::<BTreeMap<String, BandStatistic>>()
    };
    let coupling = |all: &BTreeMap<String, BandStatistic>| {
        all.iter().filter(|(_, s)| finite(s)).map(|(pair, s)| (pair.clone(), *s)).collect()
    };
    Joint {
        method: row.method.clone(),
        idms: row.idms,
        modes: row.modes.clone(),
        band_hz: row.band_hz,
        stiffness_n_per_m: split(&row.stiffness_n_per_m, Dof::is_translation),
        damping_n_s_per_m: split(&row.damping_n_s_per_m, Dof::is_translation),
        stiffness_n_m_per_rad: split(&row.stiffness_n_per_m, Dof::is_rotation),
        damping_n_m_s_per_rad: split(&row.damping_n_s_per_m, Dof::is_rotation),
        stiffness_flexible_si: split(&row.stiffness_n_per_m, Dof::is_flexible),
        coupling_si: coupling(&row.coupling_si),
        coupling_damping_si: coupling(&row.coupling_damping_si),
        lines: row.lines,
        warnings: row.warnings.clone(),
        ..Joint::default()
    }
}

/// Significant digits of a curve: FRFs have six digits.
const DIGITS: i32 = 6;
/// Digits of a line's standard deviation, which a few hits determine to a tenth at best.
const NOISE_DIGITS: i32 = 3;
/// Digits of a line's damping, which scatters more than its stiffness; all means are computed
/// before rounding.
const DAMPING_DIGITS: i32 = 4;

/// Translations line by line, as shown in the figures. `None` if nothing was identified.
pub fn spectrum(found: &Substructured) -> Option<JointSpectrum> {
    let mut curves = Vec::new();
    for (spectrum, noise) in &found.spectra {
        for (dof, stiffness) in spectrum.stiffness_n_per_m.iter().filter(|(dof, _)| dof.is_translation()) {
            let noise = noise.as_ref().and_then(|noise| noise.stiffness_n_per_m.get(dof));
            curves.push(SpectrumCurve {
                method: spectrum.method.clone(),
                idms: spectrum.idms,
                dof: dof.name().into(),
                stiffness_n_per_m: column(Some(stiffness), DIGITS),
                stiffness_noise_n_per_m: column(noise, NOISE_DIGITS),
                damping_n_s_per_m: column(spectrum.damping_n_s_per_m.get(dof), DAMPING_DIGITS),
            });
        }
    }
    let frequency_hz = found.frequency_hz.clone();
    (!frequency_hz.is_empty()).then_some(JointSpectrum { frequency_hz, curves })
}

fn column(values: Option<&Vec<f64>>, digits: i32) -> Vec<Option<f64>> {
    values.map_or_else(Vec::new, |v| v.iter().map(|v| v.is_finite().then(|| rounded(*v, digits))).collect())
}

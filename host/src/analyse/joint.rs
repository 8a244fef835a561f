//! The identified joint in the shape of the results.

use super::line_noise;
use crate::results::{Goodness, Joint, JointSpectrum, Refusal, SpectrumCurve, rounded};
use crate::substructuring::fit::Fitted;
use crate::substructuring::identify::Identification;
use crate::substructuring::idm::Dof;
use crate::substructuring::joint::{BandStatistic, JointRow};
use crate::substructuring::line_noise::LineNoise;
use std::collections::BTreeMap;

impl From<&JointRow> for Joint {
    fn from(row: &JointRow) -> Self {
        let split = |all: &BTreeMap<Dof, BandStatistic>, is: fn(Dof) -> bool| {
            all.iter()
                .filter(|(dof, s)| is(**dof) && s.mean.is_finite() && s.std.is_finite())
                .map(|(dof, s)| (dof.name().to_owned(), *s))
                .collect::<BTreeMap<String, BandStatistic>>()
        };
        Joint {
            method: row.method.clone(),
            idms: row.idms,
            modes: row.modes.clone(),
            band_hz: row.band_hz.into(),
            stiffness_n_per_m: split(&row.stiffness_n_per_m, Dof::is_translation),
            damping_n_s_per_m: split(&row.damping_n_s_per_m, Dof::is_translation),
            stiffness_n_m_per_rad: split(&row.stiffness_n_per_m, Dof::is_rotation),
            damping_n_m_s_per_rad: split(&row.damping_n_s_per_m, Dof::is_rotation),
            stiffness_flexible_si: split(&row.stiffness_n_per_m, Dof::is_flexible),
            coupling_si: finite(&row.coupling_si),
            coupling_damping_si: finite(&row.coupling_damping_si),
            lines: row.lines,
            noise_n_per_m: BTreeMap::new(),
            goodness: None,
            warnings: row.warnings.clone(),
        }
    }
}

impl From<&Fitted> for Joint {
    fn from(fitted: &Fitted) -> Self {
        let goodness = Goodness {
            chi_square_per_dof: fitted.chi_square_per_dof,
            largest_error: fitted.largest_error,
            settled: fitted.converged,
        };
        Joint { goodness: Some(goodness), ..Joint::from(&fitted.row()) }
    }
}

/// Without what is no number.
fn finite(all: &BTreeMap<String, BandStatistic>) -> BTreeMap<String, BandStatistic> {
    all.iter()
        .filter(|(_, s)| s.mean.is_finite() && s.std.is_finite())
        .map(|(pair, s)| (pair.clone(), *s))
        .collect()
}

/// Rows, spectra (translations only: they are what the figures show) and refusals.
///
/// `noise` belongs to the spectra, in their order.
pub(super) fn shaped(
    found: &Identification,
    noise: &[Option<LineNoise>],
) -> (Vec<Joint>, Option<JointSpectrum>, Vec<Refusal>) {
    let spectra = || found.spectra.iter().zip(noise);
    let joint = (found.joint.iter())
        .map(|row| {
            let mut joint = Joint::from(row);
            let own = spectra().find(|(s, _)| s.method == row.method && s.modes == row.modes);
            if let Some((spectrum, Some(noise))) = own {
                line_noise::in_row(&mut joint, &spectrum.frequency_hz, noise);
            }
            joint
        })
        .collect();
    let refused = found
        .refused
        .iter()
        .map(|r| Refusal { method: r.method.name().into(), idms: r.idms, reason: r.reason.clone() })
        .collect();
    let spectrum = found.spectra.first().map(|first| JointSpectrum {
        frequency_hz: first.frequency_hz.clone(),
        curves: spectra()
            .flat_map(|(s, noise)| {
                let of_k = |dof: &Dof| noise.as_ref().and_then(|noise| noise.stiffness_n_per_m.get(dof));
                let curve = |dof: &Dof| SpectrumCurve {
                    method: s.method.clone(),
                    idms: s.idms,
                    dof: dof.name().into(),
                    stiffness_n_per_m: column(s.stiffness_n_per_m.get(dof)),
                    stiffness_noise_n_per_m: column(of_k(dof)),
                    damping_n_s_per_m: column(s.damping_n_s_per_m.get(dof)),
                };
                let translations: Vec<&Dof> =
                    s.stiffness_n_per_m.keys().filter(|dof| dof.is_translation()).collect();
                translations.into_iter().map(curve).collect::<Vec<_>>()
            })
            .collect(),
    });
    (joint, spectrum, refused)
}

fn column(values: Option<&Vec<f64>>) -> Vec<Option<f64>> {
    values.map_or_else(Vec::new, |v| v.iter().map(|v| v.is_finite().then(|| rounded(*v, 6))).collect())
}

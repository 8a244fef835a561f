//! How much of a line-by-line method's scatter is the FRFs' noise.

use crate::results::Joint;
use crate::substructuring::identify::Identification;
use crate::substructuring::joint::median;
use crate::substructuring::line_noise::LineNoise;
use crate::substructuring::noise::FrfNoise;
use crate::substructuring::{FrfMatrix, Geometry, IdmSet, Method, line_noise};

/// Noise above this part of the stiffness is told in words.
const LOUD: f64 = 0.3;

/// The propagated noise of every spectrum of `found`, in their order; none where one of the three came without its variance.
pub fn of(
    frfs: [&FrfMatrix; 3],
    noises: [Option<&FrfNoise>; 3],
    geometry: &Geometry,
    found: &Identification,
) -> Vec<Option<LineNoise>> {
    let spectra = &found.spectra;
    let [Some(a), Some(b), Some(ajb)] = noises else { return vec![None; spectra.len()] };
    spectra
        .chunk_by(|one, next| one.modes == next.modes)
        .flat_map(|of_set| {
            let methods: Vec<Method> = of_set.iter().filter_map(|s| s.method.parse().ok()).collect();
            let idms = IdmSet::of(&of_set[0].modes).filter(|_| methods.len() == of_set.len());
            // what is refused here was refused by `identify` before, with the reason
            idms.and_then(|idms| line_noise(frfs, [a, b, ajb], geometry, &methods, idms).ok()).map_or_else(
                || vec![None; of_set.len()],
                |all| all.into_iter().map(|(_, noise)| noise.ok()).collect(),
            )
        })
        .collect()
}

/// The median over the row's band, and a warning where it is loud.
pub fn in_row(row: &mut Joint, frequency_hz: &[f64], noise: &LineNoise) {
    let [low, high] = row.band_hz;
    for (dof, of_k) in noise.stiffness_n_per_m.iter().filter(|(dof, _)| dof.is_translation()) {
        let inside: Vec<f64> = (frequency_hz.iter().zip(of_k))
            .filter(|(f, v)| (low..=high).contains(*f) && v.is_finite())
            .map(|(_, v)| *v)
            .collect();
        if !inside.is_empty() {
            row.noise_n_per_m.insert(dof.name().into(), median(&inside));
        }
    }
    let Some((k, noise)) = row.sliding_stiffness().zip(row.noise_n_per_m.get("z")) else { return };
    if *noise > LOUD * k.median.abs() {
        row.warnings.push(format!(
            "noise alone moves k_z of a line by {:.1} N/µm (median): {:.0} % of what the lines say",
            noise * 1e-6,
            100.0 * noise / k.median.abs()
        ));
    }
}

//! How much of a line-by-line method's scatter is the FRFs' noise.

use crate::results::{Joint, JointSpectrum, Results, rounded};
use crate::substructuring::identify::Identification;
use crate::substructuring::joint::median;
use crate::substructuring::line_noise::LineNoise;
use crate::substructuring::noise::FrfNoise;
use crate::substructuring::{Dof, FrfMatrix, Geometry, IdmSet, Method, line_noise};

/// Noise above this part of the stiffness is told in words.
const LOUD: f64 = 0.3;

/// Puts the propagated noise of every line beside the spectra, and its median beside the joint's rows; nothing where one of
/// the three came without its variance.
pub fn fill(
    results: &mut Results,
    frfs: [&FrfMatrix; 3],
    noises: [Option<&FrfNoise>; 3],
    geometry: &Geometry,
    found: &Identification,
) {
    let [Some(a), Some(b), Some(ajb)] = noises else { return };
    let Some(spectrum) = &mut results.joint_spectrum else { return };
    let mut sets: Vec<&[Dof]> = found.spectra.iter().map(|s| &s.modes[..]).collect();
    sets.dedup();
    for modes in sets {
        let Some(idms) = IdmSet::of(modes) else { continue };
        let methods: Vec<Method> = (found.spectra.iter())
            .filter(|s| s.modes == modes)
            .filter_map(|s| s.method.parse().ok())
            .collect();
        // refused is what `identify` refused before, with the reason
        let Ok(all) = line_noise(frfs, [a, b, ajb], geometry, &methods, idms) else { return };
        for (method, noise) in all.into_iter().filter_map(|(method, noise)| Some((method, noise.ok()?))) {
            beside(spectrum, method, idms.count(), &noise);
            let own = |j: &&mut Joint| j.method == method.name() && j.modes == modes;
            for row in results.joint.iter_mut().filter(own) {
                in_row(row, &spectrum.frequency_hz, &noise);
            }
        }
    }
}

fn beside(spectrum: &mut JointSpectrum, method: Method, idms: usize, noise: &LineNoise) {
    for (dof, of_k) in &noise.stiffness_n_per_m {
        let own = |c: &&mut crate::results::SpectrumCurve| {
            c.method == method.name() && c.idms == idms && c.dof == dof.name()
        };
        for curve in spectrum.curves.iter_mut().filter(own) {
            curve.stiffness_noise_n_per_m =
                of_k.iter().map(|v| v.is_finite().then(|| rounded(*v, 3))).collect();
        }
    }
}

fn in_row(row: &mut Joint, frequency_hz: &[f64], noise: &LineNoise) {
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

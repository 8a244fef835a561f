//! The fit over the main band, from all three configurations and their noise.

use crate::results::{Joint, MAIN_BAND, Refusal, Results};
use crate::substructuring::fit;
use crate::substructuring::frf::FrfMatrix;
use crate::substructuring::geometry::Geometry;
use crate::substructuring::idm::IdmSet;
use crate::substructuring::noise::FrfNoise;

/// Adds the fit to the joint's rows, or the reason why there is none to what was refused.
pub fn fill(
    results: &mut Results,
    geometry: &Geometry,
    frfs: &[Option<FrfMatrix>; 3],
    noises: &[Option<FrfNoise>; 3],
) {
    // what is missing of the three is said already
    let [Some(a), Some(b), Some(ajb)] = frfs else { return };
    let mut refuse = |reason: String| {
        results.refused.push(Refusal { method: fit::NAME.into(), idms: IdmSet::Six.count(), reason });
    };
    let [Some(noise_a), Some(noise_b), Some(noise_ajb)] = noises else {
        return refuse("it needs the variance of A, B and AJB, and FRFs from elsewhere came without".into());
    };
    let found = fit::fit(
        fit::Noisy { frf: a, noise: noise_a },
        fit::Noisy { frf: b, noise: noise_b },
        fit::Noisy { frf: ajb, noise: noise_ajb },
        geometry,
        IdmSet::Six,
        MAIN_BAND,
        &fit::Options::default(),
    );
    match found {
        Ok(fitted) => results.joint.push(Joint::from(&fitted)),
        Err(error) => refuse(error.to_string()),
    }
}

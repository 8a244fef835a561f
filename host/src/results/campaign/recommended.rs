//! The estimates to quote, and the bootstrap over hits where it was asked for.

use super::{BANDS_HZ, Wanted};
use crate::results::{Bootstrap, MAIN_BAND_HZ, Results};
use crate::substructuring::Band;
use crate::substructuring::averaged::{Averaged, AveragedError, CellHits, Prepared, Priors};
use crate::substructuring::frf::FrfMatrix;
use crate::substructuring::geometry::Geometry;
use crate::substructuring::idm::IdmSet;
use crate::substructuring::noise::FrfNoise;

/// The bootstrap's seed: the same file gives the same figures.
const SEED: u64 = 1;

/// The estimates to quote, with their intervals, from the assembly alone.
pub fn fill(
    results: &mut Results,
    geometry: &Geometry,
    ajb: &FrfMatrix,
    noise: Option<&FrfNoise>,
    hits: &[CellHits],
    wanted: Wanted,
) {
    let priors = Priors::default();
    results.source.settings.insert("priors".into(), serde_json::json!(priors));
    for [low_hz, high_hz] in BANDS_HZ {
        let band = Band { low_hz, high_hz };
        match Prepared::of(ajb, noise, geometry, IdmSet::Six, band, &priors) {
            Ok(prepared) => {
                let estimate = prepared.estimate();
                if wanted.replicates > 0 && [low_hz, high_hz] == MAIN_BAND_HZ {
                    match draw(&prepared, &estimate, hits, wanted.replicates) {
                        Ok(drawn) => results.bootstrap = Some(drawn),
                        Err(error) => results.missing.push(format!("No bootstrap over hits: {error}.")),
                    }
                }
                results.recommended.push(estimate);
            }
            Err(error) => {
                results.missing.push(format!("No estimate with an interval by Eq. A.1: {error}."));
                return;
            }
        }
    }
}

/// The bootstrap, and the estimate with its scatter.
fn draw(
    prepared: &Prepared,
    estimate: &Averaged,
    hits: &[CellHits],
    replicates: usize,
) -> Result<Bootstrap, AveragedError> {
    let drawn = prepared.bootstrap(hits, replicates, SEED)?;
    let joint = estimate
        .joint
        .iter()
        .filter_map(|(dof, whole)| Some((*dof, whole.with_hits(drawn.get(dof)?))))
        .collect();
    Ok(Bootstrap { band_hz: estimate.band_hz, replicates, seed: SEED, hits: drawn, joint })
}

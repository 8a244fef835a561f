//! The estimates to quote, and the bootstrap over hits if it was requested.

use super::missing::Missing;
use super::wanted::BANDS;
use crate::frf::Frf;
use crate::results::{Bootstrap, MAIN_BAND};
use crate::substructuring::averaged::{Averaged, AveragedError, CellHits, Prepared, Priors};
use crate::substructuring::{Geometry, IdmSet};

/// Seed of the bootstrap; fixed, so that the same file gives the same figures.
const SEED: u64 = 1;

/// The estimates to quote.
#[derive(Debug, Default)]
pub struct Recommended {
    /// One for each band.
    pub estimates: Vec<Averaged>,
    /// The bootstrap over hits, for the main band.
    pub bootstrap: Option<Bootstrap>,
    /// Results that are not available.
    pub missing: Vec<Missing>,
}

/// The estimates to quote, with their intervals, from the assembly only; `replicates` is the number
/// of bootstrap replicates.
pub fn recommended(
    geometry: &Geometry,
    ajb: &Frf,
    priors: &Priors,
    hits: &[CellHits],
    replicates: usize,
) -> Recommended {
    let mut found = Recommended::default();
    for band in BANDS {
        match Prepared::of(ajb, geometry, IdmSet::Six, band, priors) {
            Ok(prepared) => {
                let estimate = prepared.estimate();
                if replicates > 0 && band == MAIN_BAND {
                    match draw(&prepared, &estimate, hits, replicates) {
                        Ok(drawn) => found.bootstrap = Some(drawn),
                        Err(error) => found.missing.push(Missing::Bootstrap(error)),
                    }
                }
                found.estimates.push(estimate);
            }
            Err(error) => {
                found.missing.push(Missing::Estimate(error));
                break;
            }
        }
    }
    found
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

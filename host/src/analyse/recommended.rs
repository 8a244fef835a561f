//! The estimates to quote, and the bootstrap over hits where it was asked for.

use super::missing::Missing;
use super::wanted::BANDS;
use crate::results::{Bootstrap, MAIN_BAND};
use crate::substructuring::averaged::{Averaged, AveragedError, CellHits, Prepared, Priors};
use crate::substructuring::{Frf, Geometry, IdmSet};

/// The bootstrap's seed: the same file gives the same figures.
const SEED: u64 = 1;

/// The estimates to quote.
#[derive(Debug, Default)]
pub struct Recommended {
    /// One for each band.
    pub estimates: Vec<Averaged>,
    /// Hits drawn anew, over the main band.
    pub bootstrap: Option<Bootstrap>,
    /// What there is not.
    pub missing: Vec<Missing>,
}

/// The estimates to quote, with their intervals, from the assembly alone; `replicates` of the bootstrap.
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

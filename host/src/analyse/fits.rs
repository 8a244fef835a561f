//! Fits of K and C to all three configurations and their noise.

use crate::structure::Structure;
use crate::substructuring::fit::{FitError, Fitted, Options, fit};
use crate::substructuring::{Band, Frf, Geometry, IdmSet};

/// A requested fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// Its interface deformation modes.
    pub idms: IdmSet,
    /// Its result.
    pub outcome: Result<Fitted, NoFit>,
}

/// Why there is no fit.
#[derive(Debug, Clone, PartialEq)]
pub enum NoFit {
    /// FRFs that were imported into the campaign came without their variance.
    ImportWithoutVariance,
    /// The file of this configuration has no variance.
    FileWithoutVariance(Structure),
    /// The fit failed.
    Failed(FitError),
}

/// The fit with each set of modes over each band; the FRFs are those of A, B and AJB, with their
/// variance.
pub fn fits(
    [a, b, ajb]: [&Frf; 3],
    geometry: &Geometry,
    sets: &[IdmSet],
    bands: &[Band],
    options: &Options,
) -> Vec<Fit> {
    let of = |idms: IdmSet, band: Band| {
        let outcome = fit(a, b, ajb, geometry, idms, band, options).map_err(NoFit::Failed);
        Fit { idms, outcome }
    };
    sets.iter()
        .flat_map(|set| bands.iter().map(move |band| (*set, *band)))
        .map(|(set, band)| of(set, band))
        .collect()
}

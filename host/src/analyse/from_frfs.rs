//! From FRFs of A, B and the assembly to joint and interface; used for campaigns and by `identify`:
//! the decoupling methods, the estimates to quote with their bootstrap over hits, and the fits of K
//! and C to all three configurations and their noise.

use super::cell::BANDS;
use super::checks::{BackCoupled, InternalsFound, SameStructures};
use super::missing::Missing;
use crate::results::{Bootstrap, MAIN_BAND};
use crate::structure::Structure;
use crate::substructuring::averaged::{Averaged, AveragedError, CellHits, Prepared, Priors};
use crate::substructuring::cmif::{Cmif, cmif};
use crate::substructuring::explained::Explained;
use crate::substructuring::fit::{FitError, Fitted, Options, fit};
use crate::substructuring::geometry::{Configuration, Grouping, Point};
use crate::substructuring::line_noise::LineNoise;
use crate::substructuring::{
    Band, Dof, Frf, FrfError, Geometry, Identification, IdmSet, JointRow, JointSpectrum, Method, Refused,
    VirtualPointQuality, line_noise,
};
use std::collections::BTreeMap;

/// Results from the FRFs.
#[derive(Debug, Clone, PartialEq)]
pub struct Substructured {
    /// One row per method, IDM set and band.
    pub rows: Vec<Row>,
    /// The lines, Hz; empty if nothing was identified.
    pub frequency_hz: Vec<f64>,
    /// Stiffness and damping over these lines, with their noise if known.
    pub spectra: Vec<(JointSpectrum, Option<LineNoise>)>,
    /// Methods that refused this data.
    pub refused: Vec<Refused>,
    /// Quality of A's and B's virtual points.
    pub virtual_points: Vec<VirtualPointQuality>,
    /// The motions added by coupling.
    pub cmif: Result<Cmif, FrfError>,
    /// n_i and n_c.
    pub internals: Option<InternalsFound>,
    /// Whether A and B are the same alone and in the assembly.
    pub same_structures: Option<SameStructures>,
    /// Whether A and B with the joint reproduce the assembly.
    pub back_coupled: Option<BackCoupled>,
}

/// A row of the joint.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Its values.
    pub joint: JointRow,
    /// Standard deviation of the stiffness of one line due to the FRFs' noise alone, N/m: median
    /// over the band; empty if not known.
    pub noise_n_per_m: BTreeMap<Dof, f64>,
}

impl Substructured {
    /// Results for joint and interface from the FRFs from which `found` was identified; `frfs` are
    /// those of A, B and AJB.
    pub fn of(frfs: [&Frf; 3], geometry: &Geometry, priors: &Priors, found: Identification) -> Self {
        let [a, b, ajb] = frfs;
        let [a, b, ajb] = [(a, &geometry.a), (b, &geometry.b), (ajb, &geometry.ajb)]
            .map(|(frf, points)| without_spares(frf, points));
        let cmif = cmif(&a, &b, &ajb, geometry);
        let (internals, same_structures) = (InternalsFound::of(&found), SameStructures::of(&found));
        let back_coupled = back_coupled(frfs, geometry, priors, &found);
        let noise = noise_of_lines(frfs, geometry, &found.spectra);
        let spectra: Vec<_> = found.spectra.into_iter().zip(noise).collect();
        Self {
            rows: found.joint.into_iter().map(|joint| with_noise(joint, &spectra)).collect(),
            frequency_hz: spectra.first().map_or_else(Vec::new, |(s, _)| s.frequency_hz.clone()),
            spectra,
            refused: found.refused,
            virtual_points: found.virtual_points,
            cmif,
            internals,
            same_structures,
            back_coupled,
        }
    }
}

fn with_noise(joint: JointRow, spectra: &[(JointSpectrum, Option<LineNoise>)]) -> Row {
    let own = spectra.iter().find(|(s, _)| s.method == joint.method && s.modes == joint.modes);
    let noise_n_per_m = match own {
        Some((spectrum, Some(noise))) => noise.stiffness_over(&spectrum.frequency_hz, joint.band_hz),
        _ => BTreeMap::new(),
    };
    Row { joint, noise_n_per_m }
}

/// The propagated noise of every spectrum, in order; `None` if one of the three lacks its variance.
fn noise_of_lines(frfs: [&Frf; 3], geometry: &Geometry, spectra: &[JointSpectrum]) -> Vec<Option<LineNoise>> {
    if frfs.iter().any(|frf| frf.variance().is_none()) {
        return vec![None; spectra.len()];
    }
    spectra
        .chunk_by(|one, next| one.modes == next.modes)
        .flat_map(|of_set| {
            let methods: Vec<Method> = of_set.iter().filter_map(|s| s.method.parse().ok()).collect();
            let idms = IdmSet::of(&of_set[0].modes).filter(|_| methods.len() == of_set.len());
            // a refusal here was already reported by `identify`, with the reason
            idms.and_then(|idms| line_noise(frfs, geometry, &methods, idms).ok()).map_or_else(
                || vec![None; of_set.len()],
                |all| all.into_iter().map(|(_, noise)| noise.ok()).collect(),
            )
        })
        .collect()
}

/// The assembly recomputed by coupling, with the largest set of modes requested for Eq. (A.1);
/// `None` if it was not requested.
fn back_coupled(
    frfs: [&Frf; 3],
    geometry: &Geometry,
    priors: &Priors,
    found: &Identification,
) -> Option<BackCoupled> {
    let by_inverse = found.spectra.iter().filter(|s| s.method == Method::Inverse.name());
    let idms = IdmSet::of(&by_inverse.max_by_key(|s| s.idms)?.modes)?;
    BackCoupled::of(&Explained::of(frfs, geometry, idms, MAIN_BAND, priors)?)
}

/// The matrix without the spare responses of A, which may contain NaN, and without points on
/// specimens, which are not on an arm.
fn without_spares(frf: &Frf, points: &Configuration) -> Frf {
    let is = |points: &[Point], names: &[String], name: &String, what: fn(Grouping) -> bool| {
        points.iter().zip(names).any(|(p, n)| n == name && what(p.grouping))
    };
    let (outputs, inputs) = (points.output_names(), points.input_names());
    let spare = |name: &&String| {
        let left_out = |g: Grouping| g == Grouping::InternalA || g.is_specimen();
        is(&points.channels, &outputs, name, left_out)
    };
    let on_specimen = |name: &&String| is(&points.impacts, &inputs, name, Grouping::is_specimen);
    let kept: Vec<String> = frf.outputs().iter().filter(|name| !spare(name)).cloned().collect();
    let hit: Vec<String> = frf.inputs().iter().filter(|name| !on_specimen(name)).cloned().collect();
    // the names were taken from this matrix, so the selection succeeds
    frf.select(&kept, &hit).unwrap_or_else(|_| frf.clone())
}

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

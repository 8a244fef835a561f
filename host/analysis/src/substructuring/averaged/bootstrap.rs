//! Bootstrap over hits: the scatter of the hits themselves, without any model of the noise.
//!
//! Every replicate draws the hits of each cell again, with replacement, forms H1, reduces,
//! decouples and averages as the estimate does, with the estimate's weights. Hits of different
//! cells are independent; the axes of one sensor share theirs. Errors that repeat in every hit
//! (positions, angles) do not appear here: the estimate's geometric part has to be added.

use super::{AveragedError, DofEstimate, Line, Prepared, compliance, invert};
use crate::parallel::prelude::*;
use crate::substructuring::idm::Dof;
use crate::substructuring::interface_data::balance;
use crate::substructuring::joint_over_bands::stiffness_and_damping;
use nalgebra::{Complex, DMatrix};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;
use serde::Serialize;
use std::collections::BTreeMap;

/// Spectra of the hits of one impact measured by one sensor, on the lines of the FRFs.
#[derive(Debug, Clone, PartialEq)]
pub struct CellHits {
    /// Name of the input.
    pub input: String,
    /// Names of the outputs: the sensor's axes.
    pub outputs: Vec<String>,
    /// |F|² per line and hit \[line\]\[hit\].
    pub auto: Vec<Vec<f64>>,
    /// X F* per line, output and hit \[line\]\[output\]\[hit\].
    pub cross: Vec<Vec<Vec<Complex<f64>>>>,
}

/// Statistics of the replicates for one degree of freedom. N/m; N m/rad for rotations.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Replicates {
    /// Mean of the replicates minus the estimate from all hits, before any correction: the bias due
    /// to noise.
    pub bias: f64,
    /// Standard deviation of the replicates.
    pub std: f64,
    /// Median of the replicates.
    pub median: f64,
    /// Middle 95 % of the replicates, mirrored about the estimate (basic bootstrap): interval of
    /// the true value as far as the hits determine it.
    pub ci95: [f64; 2],
}

fn hits(cell: &CellHits) -> usize {
    cell.auto.first().map_or(0, Vec::len)
}

/// How often a replicate uses each hit: \[replicate\]\[hit\], with the hits of all cells one after
/// the other.
struct Draws {
    counts: Vec<Vec<f64>>,
}

impl Draws {
    fn new(cells: &[CellHits], replicates: usize, seed: u64) -> Draws {
        let counts = (0..replicates)
            .map(|replicate| {
                let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed.wrapping_add(replicate as u64));
                cells
                    .iter()
                    .flat_map(|cell| {
                        let mut counts = vec![0.0; hits(cell)];
                        for _ in 0..counts.len() {
                            counts[stream.random_range(0..hits(cell))] += 1.0;
                        }
                        counts
                    })
                    .collect()
            })
            .collect();
        Draws { counts }
    }
}

impl Prepared {
    /// The bootstrap of this estimate; `cells` must hold every cell of the interface on the lines
    /// of the estimate's band.
    ///
    /// Deterministic in `seed`; parallel over lines.
    ///
    /// # Errors
    /// [`AveragedError::Hits`] if a cell is missing, or its spectra have other lines.
    pub fn bootstrap(
        &self,
        cells: &[CellHits],
        replicates: usize,
        seed: u64,
    ) -> Result<BTreeMap<Dof, Replicates>, AveragedError> {
        let places = self.places(cells)?;
        let draws = Draws::new(cells, replicates, seed);
        let n = self.idms.count();
        let lines = self.impedance.len();
        // one line's cells stay in the cache for all replicates
        let by_line: Vec<Vec<Complex<f64>>> = (0..lines)
            .into_par_iter()
            .map(|l| {
                let (rows, columns) = self.assembly.cells[l].shape();
                let to_receptance = self.assembly.s[l].powi(-self.order_of_s);
                let mut y: Line = DMatrix::zeros(rows, columns);
                let mut out = vec![Complex::default(); replicates * n];
                for (replicate, counts) in draws.counts.iter().enumerate() {
                    let mut counts = counts.as_slice();
                    for (cell, place) in cells.iter().zip(&places) {
                        let own;
                        (own, counts) = counts.split_at(hits(cell));
                        let auto: f64 = cell.auto[l].iter().zip(own).map(|(a, w)| a * w).sum();
                        let to_h1 = to_receptance / auto;
                        for (&(row, column), cross) in place.iter().zip(&cell.cross[l]) {
                            let sum: Complex<f64> = cross.iter().zip(own).map(|(x, w)| x * *w).sum();
                            y[(row, column)] = sum * to_h1;
                        }
                    }
                    let z = invert(&self.assembly.layout.reduce(&y));
                    for d in 0..n {
                        // a replicate that is singular at a line takes the value of all hits there
                        let value = z
                            .as_ref()
                            .map_or_else(|_| compliance(&self.impedance[l], d), |z| compliance(z, d));
                        out[replicate * n + d] = value * self.weights[d][l];
                    }
                }
                out
            })
            .collect();
        Ok(self
            .idms
            .dofs()
            .iter()
            .enumerate()
            .map(|(d, &dof)| {
                let s = self.mean_s(d);
                let stiffness =
                    |y: Complex<f64>| stiffness_and_damping(y.inv(), s).0 * balance(self.idms)[d].powi(2);
                let plug_in = stiffness(
                    (0..lines)
                        .map(|l| compliance(&self.impedance[l], d) * self.weights[d][l])
                        .sum::<Complex<f64>>(),
                );
                let all: Vec<f64> = (0..replicates)
                    .map(|r| stiffness(by_line.iter().map(|line| line[r * n + d]).sum::<Complex<f64>>()))
                    .collect();
                (dof, Replicates::of(all, plug_in))
            })
            .collect())
    }

    /// Row and column of each cell's outputs among the interface cells.
    fn places(&self, cells: &[CellHits]) -> Result<Vec<Vec<(usize, usize)>>, AveragedError> {
        let lines = self.impedance.len();
        let mut seen = 0;
        let places = cells
            .iter()
            .map(|cell| {
                if cell.auto.len() != lines || cell.cross.len() != lines {
                    let reason =
                        format!("{} has {} lines, the estimate {lines}", cell.input, cell.auto.len());
                    return Err(AveragedError::Hits { reason });
                }
                let missing = |name: &str| AveragedError::Hits {
                    reason: format!("{name} is not a cell of the interface"),
                };
                let column = self
                    .assembly
                    .inputs
                    .iter()
                    .position(|i| *i == cell.input)
                    .ok_or_else(|| missing(&cell.input))?;
                cell.outputs
                    .iter()
                    .map(|output| {
                        seen += 1;
                        let row = self
                            .assembly
                            .outputs
                            .iter()
                            .position(|o| o == output)
                            .ok_or_else(|| missing(output))?;
                        Ok((row, column))
                    })
                    .collect()
            })
            .collect::<Result<Vec<Vec<_>>, _>>()?;
        let wanted = self.assembly.outputs.len() * self.assembly.inputs.len();
        if seen != wanted {
            return Err(AveragedError::Hits {
                reason: format!("{seen} of {wanted} interface cells are there"),
            });
        }
        Ok(places)
    }
}

impl Replicates {
    fn of(mut all: Vec<f64>, plug_in: f64) -> Replicates {
        all.sort_by(f64::total_cmp);
        let n = all.len() as f64;
        let mean = all.iter().sum::<f64>() / n;
        let quantile = |q: f64| all[((q * n) as usize).min(all.len() - 1)];
        Replicates {
            bias: mean - plug_in,
            std: (all.iter().map(|k| (k - mean).powi(2)).sum::<f64>() / n).sqrt(),
            median: quantile(0.5),
            ci95: [2.0 * plug_in - quantile(0.975), 2.0 * plug_in - quantile(0.025)],
        }
    }
}

impl DofEstimate {
    /// The estimate with the bootstrap's scatter instead of the propagated noise.
    #[must_use]
    pub fn with_hits(self, hits: &Replicates) -> DofEstimate {
        self.with_noise(hits.std)
    }
}

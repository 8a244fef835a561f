//! Sums over all lines of all blocks, by frequency bin.

use super::ContactError;
use super::block::Block;
use super::line::{Normal, Residual};
use crate::parallel::prelude::*;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;

/// Width of the bins whose lines are summed and judged together, Hz.
pub const BIN_HZ: f64 = 25.0;

/// Motion at every line of every block.
pub type Motion = Vec<Vec<DVector<Complex<f64>>>>;

/// The lines of one block in one bin.
#[derive(Debug, Clone)]
pub struct Bin {
    /// Index of the block.
    pub block: usize,
    /// Its lowest frequency, Hz.
    pub low_hz: f64,
    /// Normal equations of its lines.
    pub normal: Normal,
    /// Residuals of each row at each line, divided by the noise.
    pub residuals: Vec<Residual>,
    motion: Vec<DVector<Complex<f64>>>,
}

/// Evaluates all blocks, bin by bin.
pub fn evaluate(blocks: &[Block], p: &[f64], before: Option<&Motion>) -> Result<Vec<Bin>, ContactError> {
    let mut tasks: Vec<(usize, std::ops::Range<usize>)> = Vec::new();
    for (b, block) in blocks.iter().enumerate() {
        let mut from = 0;
        while let Some(first) = block.lines.get(from) {
            let end_hz = (first.frequency_hz / BIN_HZ).floor() * BIN_HZ + BIN_HZ;
            let to = from + block.lines[from..].partition_point(|line| line.frequency_hz < end_hz);
            tasks.push((b, from..to));
            from = to;
        }
    }
    let bins: Vec<Option<Bin>> =
        tasks.into_par_iter().map(|(b, lines)| bin(blocks, b, lines, p, before)).collect();
    bins.into_iter().collect::<Option<Vec<Bin>>>().ok_or_else(|| {
        ContactError::NotIdentified("the points do not tell how arm B and specimen A move".into())
    })
}

fn bin(
    blocks: &[Block],
    b: usize,
    lines: std::ops::Range<usize>,
    p: &[f64],
    before: Option<&Motion>,
) -> Option<Bin> {
    let block = &blocks[b];
    let low_hz = (block.lines[lines.start].frequency_hz / BIN_HZ).floor() * BIN_HZ;
    let mut normal = Normal::none(block.parameters.len());
    let mut motion = Vec::with_capacity(lines.len());
    let mut residuals = Vec::with_capacity(lines.len());
    for line in lines {
        let shifts = before.filter(|_| !block.shifted_by.is_empty()).map(|motion| {
            [0, 1].map(|axis| {
                let mut shift = DVector::zeros(block.latent());
                for (other, weights) in &block.shifted_by {
                    if let Some(moved) = motion[*other].get(line) {
                        shift += moved * Complex::from(weights[axis]);
                    }
                }
                shift
            })
        });
        let (moved, residual) = normal.add(block, line, p, shifts.as_ref())?;
        motion.push(moved);
        residuals.push(residual);
    }
    Some(Bin { block: b, low_hz, normal, residuals, motion })
}

/// The best-fitting motion of each line, by block.
pub fn motions(blocks: &[Block], bins: &[Bin]) -> Motion {
    let mut all: Motion = vec![Vec::new(); blocks.len()];
    for bin in bins {
        all[bin.block].extend(bin.motion.iter().cloned());
    }
    all
}

/// Information matrix and gradient of all bins together, for `count` parameters.
pub fn summed<'a>(
    blocks: &[Block],
    bins: impl Iterator<Item = (usize, &'a Normal)>,
    count: usize,
    shared: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let mut information = DMatrix::zeros(count, count);
    let mut gradient = DVector::zeros(count);
    let weight = shared.recip();
    for (block, normal) in bins {
        let own = &blocks[block].parameters;
        for (i, to) in own.iter().enumerate() {
            gradient[*to] += weight * normal.gradient[i];
            for (j, other) in own.iter().enumerate() {
                information[(*to, *other)] += weight * normal.information[(i, j)];
            }
        }
    }
    (information, gradient)
}

//! One line of a block: the motion is eliminated, and the residual determines the parameters.

use super::block::{Block, BlockLine};
use super::model::{LineModel, Sparse};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex;

/// Kinds of rows whose residuals are summed separately.
pub const KINDS: usize = 6;

/// Normal equations of some lines of one block: r is the residual of the best-fitting motion, J its
/// derivative by the block's parameters, all divided by the noise's standard deviation.
#[derive(Debug, Clone)]
pub struct Normal {
    /// Re(Jᴴ J), over the block's parameters.
    pub information: DMatrix<f64>,
    /// Re(Jᴴ r).
    pub gradient: DVector<f64>,
    /// Σ |r|².
    pub chi_square: f64,
    /// Number of complex degrees of freedom in r.
    pub freedom: f64,
    /// Σ |r|², its expected value, and Σ |signal|², by kind of row: T, spot B, spot A, arm B,
    /// specimen A, specimen B.
    pub kinds: [[f64; 3]; KINDS],
}

/// The residual at one line.
#[derive(Debug, Clone)]
pub struct Residual {
    /// Index of the block's line.
    pub line: usize,
    /// r divided by the noise's standard deviation, and the expected value of |r|², by row.
    pub rows: Vec<(Complex<f64>, f64)>,
}

/// One line with the motion eliminated, divided by the noise.
pub struct Eliminated {
    /// Q of the weighted map.
    pub q: DMatrix<Complex<f64>>,
    /// R of the weighted map.
    pub r: DMatrix<Complex<f64>>,
    /// The best-fitting motion.
    pub motion: DVector<Complex<f64>>,
    /// Its residual.
    pub residual: DVector<Complex<f64>>,
}

/// Eliminates the motion described by `map` after removing the effect of the hammer's shifts; none
/// if the rows do not determine the motion.
pub fn eliminated(
    block: &Block,
    line: &BlockLine,
    map: &DMatrix<Complex<f64>>,
    offsets: &[Complex<f64>],
    p: &[f64],
    shifts: Option<&[DVector<Complex<f64>>; 2]>,
) -> Option<Eliminated> {
    let mut seen = DVector::from_fn(map.nrows(), |r, _| line.value[r] - offsets[r]);
    if let Some(shifts) = shifts {
        let moved = shifts.each_ref().map(|shift| map * shift);
        for (r, row) in block.rows.iter().enumerate() {
            if let Some(at) = block.cells[row.cell].shift {
                seen[r] -= moved[0][r] * p[at] + moved[1][r] * p[at + 1];
            }
        }
    }
    for (r, weight) in line.weight.iter().enumerate() {
        seen[r] *= *weight;
    }
    let (q, r) = factors(map, line);
    let projected = q.ad_mul(&seen);
    let motion = r.solve_upper_triangular(&projected)?;
    let residual = seen - &q * projected;
    Some(Eliminated { q, r, motion, residual })
}

/// Q and R of the map divided by the noise.
fn factors(map: &DMatrix<Complex<f64>>, line: &BlockLine) -> (DMatrix<Complex<f64>>, DMatrix<Complex<f64>>) {
    let weighed = DMatrix::from_fn(map.nrows(), map.ncols(), |r, c| map[(r, c)] * line.weight[r]);
    let factors = weighed.qr();
    (factors.q(), factors.unpack_r())
}

impl Normal {
    /// Zero sums for this many `parameters`.
    pub fn none(parameters: usize) -> Self {
        Normal {
            information: DMatrix::zeros(parameters, parameters),
            gradient: DVector::zeros(parameters),
            chi_square: 0.0,
            freedom: 0.0,
            kinds: [[0.0; 3]; KINDS],
        }
    }

    /// Adds one line; returns the best-fitting motion and its residual. None if the rows do not
    /// determine the motion.
    pub fn add(
        &mut self,
        block: &Block,
        line: usize,
        p: &[f64],
        shifts: Option<&[DVector<Complex<f64>>; 2]>,
    ) -> Option<(DVector<Complex<f64>>, Residual)> {
        let (index, line) = (line, &block.lines[line]);
        let model = LineModel::new(block, p, line.s);
        let (map, offsets) = model.map();
        let rows = map.nrows();
        let Eliminated { q, motion, residual, .. } = eliminated(block, line, &map, &offsets, p, shifts)?;

        self.chi_square += residual.norm_squared();
        self.freedom += (rows - map.ncols()) as f64;
        let mut left_of_rows = Vec::with_capacity(rows);
        for (r, row) in block.rows.iter().enumerate() {
            let kind = if row.channel < 3 { row.channel } else { 3 + block.cells[row.cell].group as usize };
            let (left, free) = (residual[r].norm_sqr(), 1.0 - q.row(r).norm_squared());
            // compared with the noise alone, without the allowance for unexplained signal
            self.kinds[kind][0] += left * (line.weight[r] * line.sigma[r]).powi(-2);
            self.kinds[kind][1] += free;
            left_of_rows.push((residual[r], free));
            self.kinds[kind][2] += (line.value[r] / line.sigma[r]).norm_sqr();
        }
        self.add_derivatives(&model.derivatives(&motion, shifts, &map), &line.weight, &q, &residual);
        Some((motion, Residual { line: index, rows: left_of_rows }))
    }

    /// Adds what noise alone contributes to the information of one line: the motion is estimated
    /// from noisy signals, which enlarges products with it. Adds nothing if the rows do not
    /// determine the motion.
    pub fn add_of_noise(&mut self, block: &Block, line: usize, p: &[f64]) {
        let line = &block.lines[line];
        let model = LineModel::new(block, p, line.s).of_motion();
        let (map, _) = model.map();
        let (rows, latent) = (map.nrows(), map.ncols());
        let (q, r) = factors(&map, line);
        // the motion's covariance is R⁻¹ R⁻ᴴ: each column of R⁻¹ is a motion due to noise
        let identity = DMatrix::identity(latent, latent);
        let Some(made) = r.solve_upper_triangular(&identity) else { return };
        let nothing = DVector::zeros(rows);
        for motion in made.column_iter() {
            let derivatives = model.derivatives(&motion.into_owned(), None, &map);
            self.add_derivatives(&derivatives, &line.weight, &q, &nothing);
        }
    }

    /// J = −(1 − Q Qᴴ) D with D sparse: Jᴴ J = Dᴴ D − (Qᴴ D)ᴴ (Qᴴ D), and Jᴴ r = −Dᴴ r.
    fn add_derivatives(
        &mut self,
        derivatives: &[Sparse],
        weight: &[f64],
        q: &DMatrix<Complex<f64>>,
        residual: &DVector<Complex<f64>>,
    ) {
        let parameters = self.gradient.len();
        let mut seen = DMatrix::<Complex<f64>>::zeros(q.ncols(), parameters);
        for (r, row) in derivatives.iter().enumerate() {
            for (i, value) in row {
                let value = value * weight[r];
                self.gradient[*i] -= (value.conj() * residual[r]).re;
                for (c, at) in seen.column_mut(*i).iter_mut().enumerate() {
                    *at += q[(r, c)].conj() * value;
                }
                for (j, other) in row {
                    self.information[(*i, *j)] += (value.conj() * other).re * weight[r];
                }
            }
        }
        // real parts stacked above imaginary parts, so that a single real matrix product suffices,
        // which is fast
        let height = seen.nrows();
        let stacked = DMatrix::from_fn(2 * height, parameters, |r, c| {
            if r < height { seen[(r, c)].re } else { seen[(r - height, c)].im }
        });
        self.information.gemm(-1.0, &stacked.transpose(), &stacked, 1.0);
    }
}

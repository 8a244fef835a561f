//! Tests the assumptions of the estimate on its residuals.
//!
//! Residuals of a cell beyond its noise: aim errors that other impacts do not show, a bad hit, a
//! misplaced point.
//!
//! Such residuals are proportional to the signal. They are therefore counted as noise proportional
//! to it, separately for each cell and instrument, with the fraction that brings the residual to
//! its expected value. An outlying cell thus gets less weight; the weights of the others stay the
//! same.
//!
//! The band in which the model holds: beyond it an arm or a specimen bends, or the load cells'
//! calibration ends.
//!
//! The bodies are rigid up to their first bending mode, whose frequency is unknown before the
//! measurement. The residuals of a fit over the whole band show it: if they contradict the model at
//! one end of the band, the lines there carry no information on the contact and are left out. Only
//! the ends are removed. A contradiction in the middle means that a point is misplaced or loose,
//! and stays a doubt.

use super::block::Block;
use super::line::Residual;
use super::parameters::{COMPLIANCE, Cause, Parameters};
use super::solver::{BIN_HZ, Bin, Solution};
use crate::band::Band;
use crate::substructuring::geometry::Grouping;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

/// χ² per degree of freedom above which a kind of signal contradicts the model, allowing for the
/// uncertainty of the noise itself.
const CONTRADICTED: f64 = 10.0;
/// Standard deviations by which one of about a hundred stated quantities may be off.
const BEYOND: f64 = 5.0;
/// Standard deviations by which two readings of k_T may differ.
const APART: f64 = 4.0;

/// The residual of some signals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SignalResidual {
    /// χ² per degree of freedom: 1 where only noise is left.
    pub chi_square: f64,
    /// Rms of the residual relative to the signals' rms, both weighted by the noise.
    pub part: f64,
}

/// Signals that are judged together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signals {
    /// All signals of the hits on B alone: they test the force's form.
    Calibration,
    /// The points on specimen A.
    SpecimenA,
    /// The spots in the assembly.
    Spots,
}

impl Signals {
    /// All kinds of signals.
    pub const ALL: [Self; 3] = [Self::Calibration, Self::SpecimenA, Self::Spots];

    /// Indices of their kinds of rows.
    fn kinds(self) -> &'static [usize] {
        match self {
            Self::Calibration => &[0, 1, 3, 5],
            Self::SpecimenA => &[4],
            Self::Spots => &[1, 2],
        }
    }

    /// The assumption that they contradict.
    fn doubt(self) -> Doubt {
        match self {
            Self::Calibration => Doubt::Force,
            Self::SpecimenA => Doubt::SpecimenA,
            Self::Spots => Doubt::Spots,
        }
    }

    /// Fraction of the signal that may remain unexplained in addition to noise. Aim errors leave
    /// about a per cent of a strong local mode, which the misfit in the interval covers; a
    /// misplaced or loose point leaves more.
    fn unexplained(self) -> f64 {
        match self {
            Self::Calibration => 0.01,
            Self::SpecimenA => 0.04,
            Self::Spots => 0.02,
        }
    }

    /// The model's residual of these signals in some bins.
    pub fn left<'a>(self, blocks: &[Block], bins: impl Iterator<Item = &'a Bin>) -> SignalResidual {
        let alone = self == Self::Calibration;
        // if the effect of the hammer's aim is only partly known, its errors are not the points'
        // fault: such impacts are left out
        let judged =
            |block: &Block| block.aim_known || !blocks.iter().any(|b| b.aim_known && b.along_z.is_none());
        let own = bins.filter(|bin| {
            let block = &blocks[bin.block];
            block.along_z.is_some() == alone && (alone || judged(block))
        });
        let kinds = own.flat_map(|bin| self.kinds().iter().map(move |k| bin.normal.kinds[*k]));
        let [chi, expected, signal] =
            kinds.fold([0.0; 3], |sum: [f64; 3], of| std::array::from_fn(|i| sum[i] + of[i]));
        SignalResidual {
            chi_square: if expected > 1e-9 { chi / expected } else { 0.0 },
            part: if signal > 0.0 { (chi / signal).sqrt() } else { 0.0 },
        }
    }

    /// Whether this residual contradicts the model.
    pub fn contradict(self, left: SignalResidual) -> bool {
        left.chi_square > CONTRADICTED && left.part > self.unexplained()
    }
}

/// The quantity that deviates most from its stated value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Farthest {
    /// Name of the position, angle, gain or delay.
    pub what: String,
    /// Its deviation, in stated standard deviations.
    pub deviations: f64,
}

/// How well each assumption holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// Residual of the force's form in the hits on B alone.
    pub calibration: SignalResidual,
    /// Residual of specimen A's points as points of a rigid body.
    pub specimen_a: SignalResidual,
    /// Residual of the spots.
    pub spots: SignalResidual,
    /// χ² per degree of freedom of k_T(f) being a single number.
    pub flatness_chi_square: f64,
    /// The position, angle, gain or delay that deviates most from its stated value; none if nothing
    /// is stated.
    pub farthest: Option<Farthest>,
    /// Difference between the compliance from hits on A and from hits on the moving mass, in
    /// standard deviations; none if only one was hit.
    pub sides_apart: Option<f64>,
}

/// An assumption that does not hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Doubt {
    /// The form does not reproduce the force in the hits on B alone.
    Force,
    /// Specimen A does not move as a rigid body, or a point is misplaced.
    SpecimenA,
    /// A spot does not move with its body.
    Spots,
    /// A position, angle, gain or delay deviates from its stated value by more than its stated
    /// error allows.
    Stated,
    /// k_T changes with frequency.
    Flatness,
    /// k_T depends on where the structure is hit.
    Sides,
}

/// The compliance from a subset of the lines, with all other parameters from all lines: its
/// difference from the overall estimate, and its standard deviation.
#[derive(Debug, Clone, Copy)]
pub struct Part {
    /// Deviation, m/N.
    pub deviation: f64,
    /// Standard deviation, m/N.
    pub sigma: f64,
}

/// The compliance of the lines that `of` selects by block and bin, as an additional parameter next
/// to all others (score test).
pub fn part(blocks: &[Block], solution: &Solution, of: impl Fn(&Block, f64) -> bool) -> Option<Part> {
    let mut own = 0.0;
    let mut slope = 0.0;
    let mut coupling = DVector::zeros(solution.p.len());
    for bin in &solution.bins {
        let block = &blocks[bin.block];
        if block.along_z.is_some() || !of(block, bin.low_hz) {
            continue;
        }
        let weight = solution.shared.recip();
        let row = block.local(COMPLIANCE);
        own += weight * bin.normal.information[(row, row)];
        slope += weight * bin.normal.gradient[row];
        for (i, parameter) in block.parameters.iter().enumerate() {
            coupling[*parameter] += weight * bin.normal.information[(row, i)];
        }
    }
    // half of the inverse
    let explained = 2.0 * quadratic(&solution.certainty.answer, &coupling);
    let left = own - explained;
    (left > 1e-6 * own && own > 0.0).then(|| Part { deviation: -slope / left, sigma: (0.5 / left).sqrt() })
}

fn quadratic(matrix: &DMatrix<f64>, v: &DVector<f64>) -> f64 {
    (matrix * v).dot(v)
}

/// Tests every assumption. Aims are not candidates for the largest deviation: on the moving mass
/// they absorb the effect of shifts of the hammer.
pub fn diagnose(blocks: &[Block], parameters: &Parameters, solution: &Solution) -> Diagnosis {
    let stated = parameters
        .all()
        .iter()
        .zip(&solution.p)
        .filter(|(own, _)| !matches!(own.cause, Cause::Noise | Cause::Aim) && own.sigma > 0.0);
    let farthest = stated
        .map(|(own, p)| (own, own.deviations(*p)))
        .max_by(|(_, a), (_, b)| a.total_cmp(b))
        .map(|(own, deviations)| Farthest { what: own.name.clone(), deviations });
    let mut lows: Vec<f64> = solution.bins.iter().map(|bin| bin.low_hz).collect();
    lows.sort_by(f64::total_cmp);
    lows.dedup();
    let parts: Vec<Part> = lows.iter().filter_map(|low| part(blocks, solution, |_, at| at == *low)).collect();
    let flatness: f64 = parts.iter().map(|p| (p.deviation / p.sigma).powi(2)).sum();
    let on_mass = |block: &Block| block.grouping == Grouping::InternalA;
    let hit = |wanted: bool| blocks.iter().any(|b| b.along_z.is_none() && on_mass(b) == wanted);
    let sides =
        (hit(true) && hit(false)).then(|| part(blocks, solution, |block, _| on_mass(block))).flatten();
    Diagnosis {
        calibration: Signals::Calibration.left(blocks, solution.bins.iter()),
        specimen_a: Signals::SpecimenA.left(blocks, solution.bins.iter()),
        spots: Signals::Spots.left(blocks, solution.bins.iter()),
        farthest,
        flatness_chi_square: if parts.is_empty() { 1.0 } else { flatness / parts.len() as f64 },
        sides_apart: sides.map(|part| part.deviation / part.sigma),
    }
}

impl Diagnosis {
    /// The assumptions that do not hold.
    pub fn doubts(&self) -> Vec<Doubt> {
        let left = [self.calibration, self.specimen_a, self.spots];
        let contradicting =
            Signals::ALL.into_iter().zip(left).filter(|(signals, left)| signals.contradict(*left));
        let mut all: Vec<Doubt> = contradicting.map(|(signals, _)| signals.doubt()).collect();
        if self.farthest.as_ref().is_some_and(|one| one.deviations > BEYOND) {
            all.push(Doubt::Stated);
        }
        if self.flatness_chi_square > CONTRADICTED {
            all.push(Doubt::Flatness);
        }
        if self.sides_apart.is_some_and(|apart| apart.abs() > APART) {
            all.push(Doubt::Sides);
        }
        all
    }
}

/// χ² per degree of freedom above which the noise does not explain the residuals of a cell. A cell
/// has about fifty degrees of freedom, so its χ² scatters by 0.2.
const STRAYS: f64 = 1.6;
/// Relative accuracy to which the fraction of the signal is found.
const ACCURACY: f64 = 0.03;

/// One row of one line: |r|², its expected value divided by the noise variance, the noise variance
/// without any addition, |value|².
type Seen = [f64; 4];

/// Widens the noise where needed, from the residuals of each block's lines; returns whether a
/// change was large enough to fit again.
pub fn widen(blocks: &mut [Block], left: &[(usize, &Residual)]) -> bool {
    let mut changed = false;
    for (b, block) in blocks.iter_mut().enumerate() {
        let mut seen: Vec<[Vec<Seen>; 2]> = vec![[Vec::new(), Vec::new()]; block.cells.len()];
        for (_, residual) in left.iter().filter(|(of, _)| *of == b) {
            let line = &block.lines[residual.line];
            for (r, row) in block.rows.iter().enumerate() {
                let (left, free) = residual.rows[r];
                let variance = line.weight[r].powi(-2);
                let instrument = usize::from(row.channel >= 3);
                seen[row.cell][instrument].push([
                    left.norm_sqr() * variance,
                    free,
                    line.sigma[r].powi(2),
                    line.value[r].norm_sqr(),
                ]);
            }
        }
        for (cell, seen) in block.cells.iter_mut().zip(&seen) {
            for (part, seen) in cell.unexplained.iter_mut().zip(seen) {
                let found = part_of_signal(seen);
                changed |= (found - *part).abs() > 0.1 * part.max(found);
                *part = found;
            }
        }
        let parts: Vec<f64> = (block.rows.iter())
            .map(|row| block.cells[row.cell].unexplained[usize::from(row.channel >= 3)])
            .collect();
        for line in &mut block.lines {
            for (r, part) in parts.iter().enumerate() {
                line.weight[r] = line.sigma[r].hypot(part * line.value[r].norm()).recip();
            }
        }
    }
    changed
}

/// The fraction of the signal to be added to the noise so that χ² has its expected value; 0 if χ²
/// is close enough already.
fn part_of_signal(seen: &[Seen]) -> f64 {
    let expected: f64 = seen.iter().map(|[_, free, ..]| free).sum();
    let chi = |part: f64| -> f64 {
        seen.iter().map(|[left, _, variance, signal]| left / (variance + part * part * signal)).sum()
    };
    if expected < 1.0 || chi(0.0) <= STRAYS * expected {
        return 0.0;
    }
    let mut high = 1e-3;
    while chi(high) > expected && high < 1e3 {
        high *= 2.0;
    }
    let mut low = 0.0;
    while high - low > ACCURACY * high {
        let middle = 0.5 * (low + high);
        if chi(middle) > expected {
            low = middle;
        } else {
            high = middle;
        }
    }
    high
}

/// A narrower band hardly determines a stiffness and a damping, Hz. A contradiction at all
/// frequencies is not a matter of the band.
const NARROWEST_HZ: f64 = 200.0;

/// The band without the ends at which the residuals contradict the model; the whole band if too
/// little would remain or nothing contradicts.
pub fn trusted(blocks: &[Block], bins: &[Bin], whole: Band) -> Band {
    let mut lows: Vec<f64> = bins.iter().map(|bin| bin.low_hz).collect();
    lows.sort_by(f64::total_cmp);
    lows.dedup();
    let holds = |low: &f64| {
        let own = || bins.iter().filter(|bin| bin.low_hz == *low);
        Signals::ALL.iter().all(|signals| !signals.contradict(signals.left(blocks, own())))
    };
    let good: Vec<bool> = lows.iter().map(holds).collect();
    let (Some(first), Some(last)) = (good.iter().position(|g| *g), good.iter().rposition(|g| *g)) else {
        return whole;
    };
    let low_hz = if first == 0 { whole.low_hz } else { lows[first] };
    // a line on the edge belongs to the next bin
    let high_hz = if last + 1 == lows.len() { whole.high_hz } else { (lows[last] + BIN_HZ).next_down() };
    if high_hz - low_hz < NARROWEST_HZ { whole } else { Band { low_hz, high_hz } }
}

#[cfg(test)]
mod tests {
    use super::part_of_signal;

    #[test]
    fn what_is_left_in_proportion_to_the_signal_is_found() {
        // variance 1, signals of 10 to 1000, a residual of 2 % of the signal in addition to noise
        let seen: Vec<[f64; 4]> = (0..60)
            .map(|i| {
                let signal: f64 = 10_f64.powf(1.0 + f64::from(i) / 30.0);
                [1.0 + (0.02 * signal).powi(2), 1.0, 1.0, signal * signal]
            })
            .collect();
        assert!((part_of_signal(&seen) - 0.02).abs() < 0.04 * 0.02, "{}", part_of_signal(&seen));
        let quiet: Vec<[f64; 4]> =
            seen.iter().map(|[_, free, variance, signal]| [1.2, *free, *variance, *signal]).collect();
        assert_eq!(part_of_signal(&quiet), 0.0);
    }
}

//! Residuals of a cell beyond its noise: aim errors that other impacts do not show, a bad hit, a
//! misplaced point.
//!
//! Such residuals are proportional to the signal. They are therefore counted as noise proportional
//! to it, separately for each cell and instrument, with the fraction that brings the residual to
//! its expected value. An outlying cell thus gets less weight; the weights of the others stay the
//! same.

use super::block::Block;
use super::line::Residual;

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

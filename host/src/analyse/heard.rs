//! How well each cell was heard: coherence along the hit's own direction, and the random error that follows from it.

use super::averages::CellAverage;
use super::cell::CellName;
use crate::results::{MAIN_BAND, rounded};
use crate::substructuring::geometry::Geometry;

/// Lines at which coherence is told: enough to see every dip, few enough to show all cells.
const SHOWN_LINES: usize = 140;

/// One cell's.
#[derive(Debug, Clone, PartialEq)]
pub struct Heard {
    /// Which.
    pub name: CellName,
    /// At the frequencies of [`frequencies`].
    pub coherence: Vec<f64>,
    /// Median over the main band; none with fewer than two hits.
    pub random_error: Option<f64>,
}

/// Lines spread evenly over the logarithm, by index; each once.
fn shown(frequency_hz: &[f64]) -> Vec<usize> {
    let (Some(first), Some(last)) = (frequency_hz.first(), frequency_hz.last()) else { return Vec::new() };
    let mut lines: Vec<usize> = (0..SHOWN_LINES)
        .map(|i| first * (last / first).powf(i as f64 / (SHOWN_LINES - 1) as f64))
        .map(|f| frequency_hz.partition_point(|line| *line < f).min(frequency_hz.len() - 1))
        .collect();
    lines.dedup();
    lines
}

/// The frequencies at which coherence is told, Hz; those of the first cell, which all share.
pub fn frequencies(cells: &[CellAverage]) -> Vec<f64> {
    let lines = cells.first().map_or(&[][..], |cell| cell.spectra.frequency_hz());
    shown(lines).into_iter().map(|line| lines[line]).collect()
}

/// All cells.
pub fn heard(geometry: &Geometry, cells: &[CellAverage]) -> Vec<Heard> {
    cells.iter().map(|cell| one(geometry, cell)).collect()
}

fn one(geometry: &Geometry, cell: &CellAverage) -> Heard {
    let y = &cell.spectra;
    let axis = geometry
        .points(cell.name.configuration)
        .impacts
        .iter()
        .find(|p| p.name == cell.name.impact)
        .map_or(2, |p| {
            (0..3).max_by(|a, b| p.direction[*a].abs().total_cmp(&p.direction[*b].abs())).unwrap_or(2)
        });
    let several = y.hits() > 1;
    let value = |line: usize| y.coherence(line, axis).clamp(0.0, 1.0);
    let lines = if several { shown(y.frequency_hz()) } else { Vec::new() };
    let error = |line: usize| {
        let c = value(line).max(f64::EPSILON);
        ((1.0 - c) / (2.0 * y.hits() as f64 * c)).sqrt()
    };
    let mut errors: Vec<f64> =
        (0..y.lines()).filter(|l| several && MAIN_BAND.contains(y.frequency_hz()[*l])).map(error).collect();
    errors.sort_by(f64::total_cmp);
    Heard {
        name: cell.name.clone(),
        coherence: lines.into_iter().map(|l| rounded(value(l), 3)).collect(),
        random_error: errors.get(errors.len() / 2).map(|e| rounded(*e, 4)),
    }
}

#[cfg(test)]
mod tests {
    use super::shown;

    #[test]
    fn lines_are_spread_over_the_logarithm_and_stand_once() {
        let lines: Vec<f64> = (0..1981).map(|i| 10.0 + 0.5 * f64::from(i)).collect();
        let found = shown(&lines);
        assert!(found.len() > 100 && found.windows(2).all(|w| w[0] < w[1]));
        assert_eq!((found[0], found.last().copied()), (0, Some(1980)));
        assert!(shown(&[]).is_empty());
    }
}

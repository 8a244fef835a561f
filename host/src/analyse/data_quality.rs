//! Data quality of each cell: coherence along the hit's own direction, and the random error derived
//! from it.

use super::averages::CellAverage;
use super::cell::CellName;
use crate::results::{MAIN_BAND, rounded};
use crate::substructuring::geometry::{Geometry, Point};

/// Number of lines at which coherence is reported: enough to show every dip, few enough to show all
/// cells.
const SHOWN_LINES: usize = 140;

/// Data quality of all cells.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DataQuality {
    /// Frequencies at which coherence is reported, Hz: lines of the first cell, which all cells
    /// share.
    pub frequency_hz: Vec<f64>,
    /// The cells, in the order in which they were averaged.
    pub cells: Vec<CellQuality>,
}

/// Data quality of one cell.
#[derive(Debug, Clone, PartialEq)]
pub struct CellQuality {
    /// The cell.
    pub name: CellName,
    /// Coherence at [`DataQuality::frequency_hz`].
    pub coherence: Vec<f64>,
    /// Relative random error of the magnitude of H1: median over the main band; `None` with fewer
    /// than two hits.
    pub random_error: Option<f64>,
}

/// Indices of logarithmically spaced lines, without duplicates.
fn shown(frequency_hz: &[f64]) -> Vec<usize> {
    let (Some(first), Some(last)) = (frequency_hz.first(), frequency_hz.last()) else { return Vec::new() };
    let mut lines: Vec<usize> = (0..SHOWN_LINES)
        .map(|i| first * (last / first).powf(i as f64 / (SHOWN_LINES - 1) as f64))
        .map(|f| frequency_hz.partition_point(|line| *line < f).min(frequency_hz.len() - 1))
        .collect();
    lines.dedup();
    lines
}

/// Data quality of all cells.
pub fn data_quality(geometry: &Geometry, cells: &[CellAverage]) -> DataQuality {
    let lines = cells.first().map_or(&[][..], |cell| cell.spectra.frequency_hz());
    DataQuality {
        frequency_hz: shown(lines).into_iter().map(|line| lines[line]).collect(),
        cells: cells.iter().map(|cell| one(geometry, cell)).collect(),
    }
}

fn one(geometry: &Geometry, cell: &CellAverage) -> CellQuality {
    let y = &cell.spectra;
    let axis = along_the_hit(geometry, &cell.name).min(y.outputs().saturating_sub(1));
    let several = y.hits() > 1;
    let value = |line: usize| y.coherence(line, axis).clamp(0.0, 1.0);
    let lines = if several { shown(y.frequency_hz()) } else { Vec::new() };
    let error = |line: usize| y.variance(line, axis).sqrt() / y.h1(line, axis).norm();
    let mut errors: Vec<f64> =
        (0..y.lines()).filter(|l| several && MAIN_BAND.contains(y.frequency_hz()[*l])).map(error).collect();
    errors.sort_by(f64::total_cmp);
    CellQuality {
        name: cell.name.clone(),
        coherence: lines.into_iter().map(|l| rounded(value(l), 3)).collect(),
        random_error: errors.get(errors.len() / 2).map(|e| rounded(*e, 4)),
    }
}

/// The channel of the cell's location whose direction is closest to that of the hit.
fn along_the_hit(geometry: &Geometry, name: &CellName) -> usize {
    let points = geometry.points(name.configuration);
    let Some(hit) = points.impacts.iter().find(|p| p.name == name.impact) else { return 0 };
    let felt = |p: &Point| (0..3).map(|i| p.direction[i] * hit.direction[i]).sum::<f64>().abs();
    let own = points.channels.iter().filter(|p| p.name == name.response).enumerate();
    own.max_by(|a, b| felt(a.1).total_cmp(&felt(b.1))).map_or(0, |(place, _)| place)
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

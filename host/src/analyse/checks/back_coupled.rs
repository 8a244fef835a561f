//! Checks whether A and B, coupled by the joint found, reproduce the measured assembly.

use crate::results::MAIN_BAND;
use crate::substructuring::explained::{BEYOND, Explained, USUAL};

/// Upper end of the default bands, Hz; deviations above it affect no result.
const USED_HZ: f64 = 800.0;
/// If errors of position and noise alone can cause this relative error, the check is undecided.
const BLIND: f64 = 1.0;

/// Accuracy with which the joint of the main band, together with A and B, reproduces the assembly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackCoupled {
    /// Frequency range in which it does.
    pub reach: Reach,
    /// Relative error, median over the main band.
    pub median_error: f64,
    /// The part of this error that noise and errors of position explain.
    pub median_explained: f64,
}

/// Frequency range in which the assembly is reproduced, Hz.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reach {
    /// Undecided because of noise and errors of position.
    Untold,
    /// Everywhere, but with a larger error than usual.
    Doubtful,
    /// Over the full range used by the bands.
    Whole([f64; 2]),
    /// Over the main band, but only up to this frequency.
    UpTo(f64),
    /// Only over a part of the main band.
    Within([f64; 2]),
    /// Nowhere.
    Nowhere,
}

impl BackCoupled {
    /// `None` without a line in the main band.
    pub fn of(found: &Explained) -> Option<Self> {
        let [median_error, median_explained] = found.medians(MAIN_BAND)?;
        let last = *found.frequency_hz.last()?;
        let whole = |range: Option<[f64; 2]>| {
            range.is_some_and(|[from, to]| from <= MAIN_BAND.low_hz && to >= USED_HZ.min(last))
        };
        let reach = match found.range(MAIN_BAND, BEYOND) {
            _ if median_explained > BLIND => Reach::Untold,
            range if whole(range) && !whole(found.range(MAIN_BAND, USUAL)) => Reach::Doubtful,
            Some(range) if whole(Some(range)) => Reach::Whole(range),
            Some([from, to]) if from <= MAIN_BAND.low_hz && to >= MAIN_BAND.high_hz => Reach::UpTo(to),
            Some(range) => Reach::Within(range),
            None => Reach::Nowhere,
        };
        Some(Self { reach, median_error, median_explained })
    }

    /// Passed, failed, or `None` if undecided.
    pub fn ok(&self) -> Option<bool> {
        match self.reach {
            Reach::Untold | Reach::Doubtful => None,
            Reach::Whole(_) => Some(true),
            Reach::UpTo(_) | Reach::Within(_) | Reach::Nowhere => Some(false),
        }
    }

    /// Frequency at which the assembly is no longer reproduced, Hz.
    pub fn edge_hz(&self) -> Option<f64> {
        match self.reach {
            Reach::UpTo(to) => Some(to),
            Reach::Within([from, to]) => Some(if to < MAIN_BAND.high_hz { to } else { from }),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An error of 2 % below a frequency and of `above` from it on, with errors of position that
    /// explain 6 %.
    fn found(edge_hz: f64, above: f64) -> Explained {
        let frequency_hz: Vec<f64> = (10..1000).map(f64::from).collect();
        Explained {
            error: frequency_hz.iter().map(|f| if *f < edge_hz { 0.02 } else { above }).collect(),
            explained: vec![0.06; frequency_hz.len()],
            frequency_hz,
        }
    }

    fn check(found: &Explained) -> BackCoupled {
        BackCoupled::of(found).expect("lines")
    }

    #[test]
    fn what_errors_of_position_explain_is_no_finding() {
        let fine = check(&found(500.0, 0.1));
        assert_eq!(fine.ok(), Some(true), "{fine:?}");
        assert!((fine.median_explained - 0.06).abs() < 1e-12);
        let between = check(&found(500.0, 0.2));
        assert_eq!(between.ok(), None, "{between:?}");
        let mut blind = found(500.0, 0.15);
        blind.explained.fill(1.5);
        assert_eq!(check(&blind).ok(), None);
    }

    #[test]
    fn a_path_above_a_frequency_is_named_with_it() {
        let path = check(&found(700.0, 0.6));
        assert_eq!((path.ok(), path.edge_hz()), (Some(false), Some(699.0)));
        assert_eq!(path.reach, Reach::UpTo(699.0));
        // deviations beyond the range of all bands have no effect
        assert_eq!(check(&found(900.0, 0.6)).ok(), Some(true));
        // within the main band, so it is not a limit above it
        let inside = check(&found(500.0, 0.6));
        assert_eq!((inside.ok(), inside.edge_hz()), (Some(false), Some(499.0)));
        assert_eq!(check(&found(0.0, 0.6)).reach, Reach::Nowhere);
    }
}

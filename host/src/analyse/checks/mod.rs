//! Checks of the credibility of the numbers, with the figures behind them. They test whether
//!
//! - six rigid motions suffice to describe the motion that coupling adds
//! - n_i internal points resolve all n_c interface motions, for both forms of Eq. (3) with the most
//!   modes
//! - A and B, coupled by the joint found, reproduce the measured assembly
//! - A and B are the same structures in all configurations

use crate::identified::SCATTER_OF_LINES;
use crate::results::MAIN_BAND;
use crate::substructuring::cmif::Cmif;
use crate::substructuring::explained::{BEYOND, Explained, USUAL};
use crate::substructuring::identify::{Identification, Internals};
use crate::substructuring::{BandStatistic, Dof, JointSpectrum, Method, Refused};

pub use hidden_resonance::HiddenResonance;
pub use sensor_masses::SensorMasses;
pub use series_compliance::{SeriesCompliance, Sizes, at_the_specimens, between_the_arms};

pub mod contact_change;
mod hidden_resonance;
mod sensor_masses;
mod series_compliance;

/// Fraction of the motion added by coupling that six rigid motions must explain.
const RIGID: f64 = 0.9;

/// Whether they do; `None` if the CMIF does not decide it.
pub fn rigid_motions_suffice(found: &Cmif) -> Option<bool> {
    found.explained.get(&6).filter(|six| !six.is_nan()).map(|six| *six >= RIGID)
}

/// Internal points in Eq. (3); each is `None` if it was not requested, or if nothing was refused.
#[derive(Debug, Clone, PartialEq)]
pub struct InternalsFound {
    /// For the least-squares form.
    pub least_squares: Option<Internals>,
    /// Why a set of modes was refused in the least-squares form.
    pub refused: Option<Refused>,
    /// For the printed form.
    pub printed: Option<Internals>,
}

impl InternalsFound {
    /// n_i and n_c, and the ranks of P and Q; `None` if neither form was requested.
    pub fn of(found: &Identification) -> Option<Self> {
        let most = |method: Method| {
            found.internals.iter().filter(|i| i.method == method).max_by_key(|i| i.idms).cloned()
        };
        let least_squares = most(Method::Internal);
        let refused = found.refused.iter().find(|r| r.method == Method::Internal).cloned();
        let printed = most(Method::InternalPrinted);
        let asked = least_squares.is_some() || refused.is_some() || printed.is_some();
        asked.then_some(Self { least_squares, refused, printed })
    }

    /// Whether they are sufficient for every set of modes.
    pub fn ok(&self) -> bool {
        self.refused.is_none() && self.least_squares.as_ref().is_some_and(is_full)
    }

    /// Whether the printed form is exact: as many internal points as interface motions, with full
    /// rank.
    pub fn printed_is_exact(&self) -> bool {
        self.printed.as_ref().is_some_and(|i| i.impacts == i.idms && i.responses == i.idms && is_full(i))
    }
}

fn is_full(i: &Internals) -> bool {
    i.impacts.min(i.responses) >= i.idms && i.rank_p.min(i.rank_q) >= i.idms
}

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

/// A smaller relative difference of the stiffness is ignored.
const MATTERS: f64 = 0.1;

/// k_z over the main band by Eq. (A.1), which uses neither A nor B alone, compared with that of the
/// blocks of Eq. (A.2), which use one of them each. If they differ by more than the scatter of
/// their lines, that substructure differs between the assembly and alone (a clamp that seats
/// differently under load, a wire instead of a rod).
#[derive(Debug, Clone, PartialEq)]
pub struct SameStructures {
    /// The verdict.
    pub sameness: Sameness,
    /// By Eq. (A.1), N/m.
    pub inverse_n_per_m: f64,
    /// Difference between the values of the blocks of A and B of Eq. (A.2) and that value, N/m.
    pub differences_n_per_m: [(&'static str, f64); 2],
}

/// Verdict on whether they are the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sameness {
    /// The scatter of the lines is too large to decide.
    Untold,
    /// No significant difference.
    Same,
    /// Whether A and B, respectively, differ.
    Changed([bool; 2]),
}

impl SameStructures {
    /// `None` without these methods.
    pub fn of(found: &Identification) -> Option<Self> {
        let (reference, inverse) = sliding(found, Method::Inverse)?;
        let inside: Vec<usize> =
            (0..inverse.len()).filter(|&l| MAIN_BAND.contains(reference.frequency_hz[l])).collect();
        let of = |values: &dyn Fn(usize) -> f64| {
            BandStatistic::of(&inside.iter().map(|&l| values(l)).collect::<Vec<f64>>())
        };
        let k = of(&|l| inverse[l])?;
        let against = |method: Method| {
            let (spectrum, values) = sliding(found, method)?;
            if spectrum.idms != reference.idms {
                return None;
            }
            let difference = of(&|l| values[l] - inverse[l])?;
            let [low, high] = difference.ci95.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
            let changed = (low > 0.0 || high < 0.0) && difference.mean.abs() > MATTERS * k.mean.abs();
            Some((difference.mean, changed, high - low < k.mean.abs()))
        };
        let (a, b) = (against(Method::PrimalA)?, against(Method::PrimalB)?);
        let clear = a.2 && b.2 && k.std <= SCATTER_OF_LINES * k.mean.abs();
        let sameness = match [a.1, b.1] {
            _ if !clear => Sameness::Untold,
            [false, false] => Sameness::Same,
            changed => Sameness::Changed(changed),
        };
        let differences_n_per_m = [("A", a.0), ("B", b.0)];
        Some(Self { sameness, inverse_n_per_m: k.mean, differences_n_per_m })
    }

    /// Passed, failed, or `None` if undecided.
    pub fn ok(&self) -> Option<bool> {
        match self.sameness {
            Sameness::Untold => None,
            Sameness::Same => Some(true),
            Sameness::Changed(_) => Some(false),
        }
    }
}

/// k_z of a method with its largest set of modes.
fn sliding(found: &Identification, method: Method) -> Option<(&JointSpectrum, &[f64])> {
    let spectra = found.spectra.iter().filter(|s| s.method == method.name());
    let spectrum = spectra.max_by_key(|s| s.idms)?;
    Some((spectrum, spectrum.stiffness_n_per_m.get(&Dof::Z)?))
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

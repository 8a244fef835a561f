//! Checks whether A and B are the same structures in all configurations.

use crate::identified::SCATTER_OF_LINES;
use crate::results::MAIN_BAND;
use crate::substructuring::identify::Identification;
use crate::substructuring::{BandStatistic, Dof, JointSpectrum, Method};

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

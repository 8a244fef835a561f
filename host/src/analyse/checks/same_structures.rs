//! Whether A and B are the same structures in all configurations.

use crate::identified::SCATTER_OF_LINES;
use crate::results::MAIN_BAND;
use crate::substructuring::identify::Identification;
use crate::substructuring::{BandStatistic, Dof, JointSpectrum, Method};

/// A difference of this part of the stiffness matters.
const MATTERS: f64 = 0.1;

/// What Eq. (A.1), which needs neither A nor B alone, and the blocks of Eq. (A.2), which need one of them each, say of k_z over the
/// main band: where they differ by more than their lines scatter, that substructure is another one in the assembly than alone
/// (a clamp that sits otherwise under load, a wire in place of a rod).
#[derive(Debug, Clone, PartialEq)]
pub struct SameStructures {
    /// What follows from it.
    pub sameness: Sameness,
    /// By Eq. (A.1), N/m.
    pub inverse_n_per_m: f64,
    /// What the blocks of A and B of Eq. (A.2) give beyond that, N/m.
    pub differences_n_per_m: [(&'static str, f64); 2],
}

/// Whether they are the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sameness {
    /// The lines scatter too much to tell.
    Untold,
    /// Nothing shows a difference.
    Same,
    /// These differ: A, B.
    Changed([bool; 2]),
}

impl SameStructures {
    /// None without these methods.
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

    /// Passed, failed, or none where the data cannot say.
    pub fn ok(&self) -> Option<bool> {
        match self.sameness {
            Sameness::Untold => None,
            Sameness::Same => Some(true),
            Sameness::Changed(_) => Some(false),
        }
    }
}

/// k_z of a method with the most modes.
fn sliding(found: &Identification, method: Method) -> Option<(&JointSpectrum, &[f64])> {
    let spectra = found.spectra.iter().filter(|s| s.method == method.name());
    let spectrum = spectra.max_by_key(|s| s.idms)?;
    Some((spectrum, spectrum.stiffness_n_per_m.get(&Dof::Z)?))
}

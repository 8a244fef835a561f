//! Checks whether six rigid motions suffice to describe the motion that coupling adds.

use crate::substructuring::cmif::Cmif;

/// Fraction of the motion added by coupling that six rigid motions must explain.
const RIGID: f64 = 0.9;

/// Whether they do; `None` if the CMIF does not decide it.
pub fn rigid_motions_suffice(found: &Cmif) -> Option<bool> {
    found.explained.get(&6).filter(|six| !six.is_nan()).map(|six| *six >= RIGID)
}

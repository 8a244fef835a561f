//! Whether six rigid motions are enough to describe what coupling adds.

use crate::substructuring::cmif::Cmif;

/// Six rigid motions must explain this part of what coupling adds.
const RIGID: f64 = 0.9;

/// Whether they do; none where the CMIF does not say.
pub fn rigid_motions_suffice(found: &Cmif) -> Option<bool> {
    found.explained.get(&6).filter(|six| !six.is_nan()).map(|six| *six >= RIGID)
}

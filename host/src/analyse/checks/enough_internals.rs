//! Whether n_i internals see all n_c interface motions: both forms of Eq. (3) with the most modes.

use crate::substructuring::identify::{Identification, Internals};
use crate::substructuring::{Method, Refused};

/// What Eq. (3) had; each none where it was not asked for, or where nothing was refused.
#[derive(Debug, Clone, PartialEq)]
pub struct InternalsFound {
    /// In least squares.
    pub least_squares: Option<Internals>,
    /// Why some set of modes was refused in least squares.
    pub refused: Option<Refused>,
    /// As printed.
    pub printed: Option<Internals>,
}

impl InternalsFound {
    /// n_i against n_c, and the ranks of P and Q; none where neither form was asked for.
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

    /// Whether they suffice for every set of modes.
    pub fn ok(&self) -> bool {
        self.refused.is_none() && self.least_squares.as_ref().is_some_and(is_full)
    }

    /// Whether the printed form is exact: as many internals as interface motions, and all of them seen.
    pub fn printed_is_exact(&self) -> bool {
        self.printed.as_ref().is_some_and(|i| i.impacts == i.idms && i.responses == i.idms && is_full(i))
    }
}

fn is_full(i: &Internals) -> bool {
    i.impacts.min(i.responses) >= i.idms && i.rank_p.min(i.rank_q) >= i.idms
}

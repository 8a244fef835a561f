//! Checks whether n_i internal points resolve all n_c interface motions, for both forms of Eq. (3)
//! with the most modes.

use crate::substructuring::identify::{Identification, Internals};
use crate::substructuring::{Method, Refused};

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

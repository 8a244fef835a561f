//! Decoupling: the joint's dynamic stiffness Z^J from FRFs of A, B and the assembly AJB, one file
//! per method.
//!
//! Every function takes receptances of one line and returns Z^J (n_c × n_c, N/m in consistent
//! units). They work in Z, not in Y, because a massless joint has no finite admittance on degrees
//! of freedom that it does not couple. c denotes the interface (virtual point) degrees of freedom,
//! i the internal ones. Rows and columns of rotations may be scaled by a length beforehand: the
//! methods are equivariant, and it reduces rounding.

mod fixture;
mod interface;
mod internal;
mod internal_printed;
mod inverse;
mod primal;

pub use fixture::{Weakening, remove_fixture};
pub use interface::interface;
pub(super) use interface::stiffnesses;
pub use internal::internal;
pub(super) use internal::{Factors, factors};
pub(super) use internal_printed::with_m_inverse;
pub use internal_printed::{internal_printed, observed_rank};
pub use inverse::{InverseBlock, inverse, inverse_of};
pub use primal::{PrimalBlock, primal, primal_of};

use super::pseudo_inverse::RankLost;

/// Name of Y^AJB_cc in errors.
pub(super) const ASSEMBLY: &str = "the assembly's interface admittance";

/// Name of Y^A_cc or Y^B_cc in errors.
pub(super) const SUBSTRUCTURE: &str = "the substructure's interface admittance";

/// The reason why a method cannot be applied to this data.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DecouplingError {
    /// The least-squares form needs at least n_c internal degrees of freedom on both sides.
    #[error(
        "{impacts} internal impacts and {responses} internal responses, but {needed} interface DoFs: with fewer internals than \
         interface DoFs the joint is seen only through the forces they generate (biased); measure more, or use fewer IDMs"
    )]
    TooFewInternals {
        /// Internal impacts (on A for Eq. 3).
        impacts: usize,
        /// Internal responses (on B for Eq. 3).
        responses: usize,
        /// n_c.
        needed: usize,
    },
    /// A matrix that must be inverted is singular.
    #[error(transparent)]
    RankLost(#[from] RankLost),
}

#[cfg(test)]
mod exactness_tests;

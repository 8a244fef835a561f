//! Z^J of one separate line by one method, for lines near rank loss or with a refusal.

use super::decoupling::{InverseBlock, PrimalBlock};
use super::internal_dofs::Rearrangement;
use super::reduced::RefusedReason;

/// The operation that a method applies to a line.
pub(super) enum Work<'a> {
    Internals(Box<Rearrangement<'a>>),
    Interface,
    Primal(PrimalBlock),
    Inverse(InverseBlock),
}

/// Order of the computation: each stage is done for all lines before the next, which decides the
/// refusal that is reported.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Stage {
    Assembly,
    Impedance,
    Method,
}

/// The refusal of a line.
pub(super) struct LineRefusal {
    pub(super) stage: Stage,
    pub(super) reason: RefusedReason,
}

impl Stage {
    pub(super) fn refuses<R: Into<RefusedReason>>(self) -> impl Fn(R) -> LineRefusal {
        move |reason| LineRefusal { stage: self, reason: reason.into() }
    }
}

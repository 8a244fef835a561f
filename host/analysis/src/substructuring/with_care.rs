//! Z^J of one separate line by one method, for lines near rank loss or with a refusal.

use super::decoupling::{
    InverseBlock, PrimalBlock, interface, internal, internal_printed, inverse_of, primal_of,
};
use super::internal_dofs::Rearrangement;
use super::reduced::{Reduced, RefusedReason};
use super::rooms::{Rooms, Side};
use nalgebra::{Complex, DMatrix};

type Line = DMatrix<Complex<f64>>;

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
pub(super) struct Refusal {
    pub(super) stage: Stage,
    pub(super) reason: RefusedReason,
}

impl Stage {
    fn refuses<R: Into<RefusedReason>>(self) -> impl Fn(R) -> Refusal {
        move |reason| Refusal { stage: self, reason: reason.into() }
    }
}

impl Reduced {
    /// Z^J of one separate line, for lines near rank loss or with a refusal. Rotations in metres.
    pub(super) fn with_care(&self, rooms: &Rooms<'_>, work: &Work<'_>, l: usize) -> Result<Line, Refusal> {
        let alone = |side| self.alone_at(rooms, side, l).map_err(Stage::Method.refuses());
        let assembly = || self.assembly_at(rooms, l).map_err(Stage::Assembly.refuses());
        let impedance = || Self::impedance_of(rooms, l, &assembly()?).map_err(Stage::Impedance.refuses());
        let found = match work {
            Work::Internals(internals) => {
                let method = if internals.printed { internal_printed } else { internal };
                let (p, m, q) = (internals.p(l), internals.m(l), internals.q(l));
                let [p, m, q] = [p, m, q].map(|block| block.map_err(Stage::Method.refuses()));
                method(&alone(Side::A)?, &alone(Side::B)?, &p?, &m?, &q?)
            }
            Work::Interface => {
                let y = assembly()?;
                interface(&alone(Side::A)?, &alone(Side::B)?, &y)
            }
            Work::Primal(block) => {
                let z = impedance()?;
                let side = match block {
                    PrimalBlock::A => Side::A,
                    PrimalBlock::B => Side::B,
                };
                primal_of(*block, &alone(side)?, &z)
            }
            Work::Inverse(block) => Ok(inverse_of(*block, &impedance()?)),
        };
        found.map_err(|source| Stage::Method.refuses()(Self::refused(rooms, l, source)))
    }
}

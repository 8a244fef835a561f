//! True state of the joint along z, which only the simulator knows.

/// Current state of the joint. Forces and displacements are along z; the totals count from the last
/// staging.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointState {
    /// Displacement of specimen A minus that of B at the contact's centre (m).
    pub relative_m: f64,
    /// The force that A exerts on B (N): friction and the stuck contact's dashpot.
    pub force_n: f64,
    /// The largest force that the contact can carry, μN (N); infinite for the linear law.
    pub limit_n: f64,
    /// Fraction of the contact's elements that slip, 0…1: 1 is gross slip.
    pub sliding: f64,
    /// Mean of the distances that the elements have slid (m).
    pub slid_m: f64,
    /// Energy dissipated by friction (J); over a cycle of a steady loop, the loop's area without
    /// the part of the stuck elements' dashpots.
    pub friction_j: f64,
}

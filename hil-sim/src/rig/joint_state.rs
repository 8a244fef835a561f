//! What the joint does along z, as only the rig itself knows it.

/// The joint now. Forces and displacements are along z; the totals count from the last staging.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointState {
    /// Displacement of specimen A less that of B at the contact's centre (m).
    pub relative_m: f64,
    /// The force that A exerts on B (N): friction and the stuck contact's dashpot.
    pub force_n: f64,
    /// The largest force that the contact can carry, μN (N); infinite for the linear law.
    pub limit_n: f64,
    /// Part of the contact's elements that slip, 0…1: 1 is gross slip.
    pub sliding: f64,
    /// Path that they have slid, their mean (m).
    pub slid_m: f64,
    /// Energy that friction has taken (J); over a cycle of a steady loop, the loop's area but for the stuck parts' dashpot.
    pub friction_j: f64,
}

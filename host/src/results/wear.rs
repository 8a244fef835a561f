//! The wear runs of a campaign: by decades of cycles, and along the cycles.

use serde::Serialize;

/// All wear runs of a campaign. SI units.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WearRuns {
    /// Cycles of all runs.
    pub cycles: u64,
    /// Energy that they dissipated, J.
    pub energy_j: f64,
    /// Cycles of which samples were lost or at an end of a channel's range; they count with the
    /// energy of the cycle before.
    pub unmeasured: u64,
    /// Raw loops kept.
    pub loops: u64,
    /// Cycles 1 to 9, 10 to 99 and so on.
    pub decades: Vec<WearMeans>,
    /// Blocks of some cycles (those of a second), evenly over the logarithm of their number; the
    /// last one is the newest.
    pub curve: Vec<WearMeans>,
}

/// Means and sums over consecutive cycles.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WearMeans {
    /// Number of the first cycle.
    pub first: u64,
    /// Number of the last cycle.
    pub last: u64,
    /// Cycles in gross slip. The values below are means over them, but for the amplitude.
    pub slipping: u64,
    /// Tangential contact stiffness k_T, N/m, uncorrected; `None` if nothing slips.
    pub k_t_n_per_m: Option<f64>,
    /// Tangent after the reversals, N/m; only if nothing slips.
    pub tangent_n_per_m: Option<f64>,
    /// Friction force μN, N.
    pub friction_n: Option<f64>,
    /// Coefficient of friction; `None` if the normal load is not known.
    pub friction_coefficient: Option<f64>,
    /// Amplitude of Δx, mean over all measured cycles, m.
    pub amplitude_m: Option<f64>,
    /// Energy dissipated in them, J.
    pub energy_j: f64,
    /// Energy dissipated up to the last of them, J.
    pub energy_to_j: f64,
}

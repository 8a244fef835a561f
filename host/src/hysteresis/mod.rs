//! placeholder
/// Record.
#[derive(Debug, Clone, PartialEq)]
pub struct HysteresisRecord {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// Motion.
    pub motion: RelativeMotion,
    /// Force.
    pub force_n: Vec<f64>,
    /// Excitation.
    pub excitation_hz: Option<f64>,
    /// Normal load.
    pub normal_load_n: Option<f64>,
}
/// Motion.
#[derive(Debug, Clone, PartialEq)]
pub enum RelativeMotion {
    /// v
    Velocity {
        /// a
        a_m_per_s: Vec<f64>,
        /// b
        b_m_per_s: Vec<f64>,
    },
    /// d
    Displacement {
        /// a
        a_m: Vec<f64>,
        /// b
        b_m: Vec<f64>,
    },
}

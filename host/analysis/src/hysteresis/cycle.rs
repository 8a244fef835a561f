//! One closed cycle of a record.

/// One closed cycle: M equidistant points of one period.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cycle {
    /// Relative displacement, mean removed, m.
    pub displacement_m: Vec<f64>,
    /// Relative velocity, mean removed, m/s.
    pub velocity_m_per_s: Vec<f64>,
    /// Tangential force, mean removed, N.
    pub force_n: Vec<f64>,
}

impl Cycle {
    pub(super) fn signals(&self) -> [&[f64]; 3] {
        [&self.displacement_m, &self.velocity_m_per_s, &self.force_n]
    }
}

//! What a hysteresis measurement gives: motion on both sides of the contact, and the tangential force.

use super::HysteresisError;

/// A record shorter than this holds nothing that could be called a loop.
const FEWEST_SAMPLES: usize = 32;

/// A time record. All signals have the same length.
#[derive(Debug, Clone, PartialEq)]
pub struct HysteresisRecord {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// Motion beside the contact.
    pub motion: RelativeMotion,
    /// Tangential force T, N: the load cells' sum, or a corrected force; positive when it pushes A back.
    pub force_n: Vec<f64>,
    /// Frequency of the shaker, Hz; none for an impact.
    pub excitation_hz: Option<f64>,
    /// Normal load, N, where it is known.
    pub normal_load_n: Option<f64>,
}

/// Motion of the two specimens along the sliding direction.
#[derive(Debug, Clone, PartialEq)]
pub enum RelativeMotion {
    /// As vibrometers give it.
    Velocity {
        /// Of specimen A, m/s.
        a_m_per_s: Vec<f64>,
        /// Of specimen B, m/s.
        b_m_per_s: Vec<f64>,
    },
    /// As displacement sensors give it.
    Displacement {
        /// Of specimen A, m.
        a_m: Vec<f64>,
        /// Of specimen B, m.
        b_m: Vec<f64>,
    },
}

/// Relative motion A − B, still as it was measured.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Relative {
    /// m/s.
    Velocity(Vec<f64>),
    /// m.
    Displacement(Vec<f64>),
}

impl HysteresisRecord {
    pub(super) fn relative(&self) -> Relative {
        let difference = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect();
        match &self.motion {
            RelativeMotion::Velocity { a_m_per_s, b_m_per_s } => {
                Relative::Velocity(difference(a_m_per_s, b_m_per_s))
            }
            RelativeMotion::Displacement { a_m, b_m } => Relative::Displacement(difference(a_m, b_m)),
        }
    }

    pub(super) fn check(&self) -> Result<(), HysteresisError> {
        let (a, b) = match &self.motion {
            RelativeMotion::Velocity { a_m_per_s, b_m_per_s } => (a_m_per_s, b_m_per_s),
            RelativeMotion::Displacement { a_m, b_m } => (a_m, b_m),
        };
        if a.len() != b.len() || a.len() != self.force_n.len() {
            return Err(HysteresisError::Lengths { a: a.len(), b: b.len(), force: self.force_n.len() });
        }
        if a.len() < FEWEST_SAMPLES {
            return Err(HysteresisError::TooShort { samples: a.len() });
        }
        if self.fs_hz.is_nan() || self.fs_hz <= 0.0 {
            return Err(HysteresisError::SamplingRate(self.fs_hz));
        }
        if let Some(sample) = (0..a.len()).find(|&i| !(a[i] + b[i] + self.force_n[i]).is_finite()) {
            return Err(HysteresisError::NotFinite { sample });
        }
        Ok(())
    }
}

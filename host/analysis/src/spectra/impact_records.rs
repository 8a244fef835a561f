//! Impact records: the raw signals of the hammer and the sensors, before any processing.

use crate::frf::MotionQuantity;

/// Hits of one impact position with the same response channels.
#[derive(Debug, Clone, PartialEq)]
pub struct ImpactRecords {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// Hammer force \[hit\]\[sample\], N.
    pub force_n: Vec<Vec<f64>>,
    /// Responses \[hit\]\[channel\]\[sample\], SI.
    pub response: Vec<Vec<Vec<f64>>>,
    /// Quantity of the responses.
    pub quantity: MotionQuantity,
}

//! The part of the measurement that a virtual point's modes retain, over a band.

use super::identify::VirtualPointQuality;
use crate::band::Band;

impl VirtualPointQuality {
    /// Parts of the measured motion and of the measured force that the modes retain, 0…1: means
    /// over the lines of the band, or over all lines if it contains none.
    pub fn held_over(&self, band: Band) -> [f64; 2] {
        let mean = |values: &[f64]| {
            let lines = self.frequency_hz.iter().zip(values);
            let inside: Vec<f64> = lines.filter(|(f, _)| band.contains(**f)).map(|(_, v)| *v).collect();
            let used = if inside.is_empty() { values } else { &inside };
            used.iter().sum::<f64>() / used.len() as f64
        };
        [mean(&self.consistency.overall_sensor), mean(&self.consistency.overall_impact)]
    }
}

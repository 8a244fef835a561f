//! The noise of a method's lines over a band.

use super::LineNoise;
use crate::band::Band;
use crate::substructuring::idm::Dof;
use crate::substructuring::joint_over_bands::median;
use std::collections::BTreeMap;

impl LineNoise {
    /// Median of the translations' stiffness noise over the lines of a band, N/m; `frequency_hz`
    /// are the lines, Hz. Directions without a known value are left out.
    pub fn stiffness_over(&self, frequency_hz: &[f64], band: Band) -> BTreeMap<Dof, f64> {
        let translations = self.stiffness_n_per_m.iter().filter(|(dof, _)| dof.is_translation());
        translations
            .filter_map(|(dof, of_k)| {
                let inside: Vec<f64> = (frequency_hz.iter().zip(of_k))
                    .filter(|(f, v)| band.contains(**f) && v.is_finite())
                    .map(|(_, v)| *v)
                    .collect();
                (!inside.is_empty()).then(|| (*dof, median(&inside)))
            })
            .collect()
    }
}

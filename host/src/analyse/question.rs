//! Identification from FRFs of any source: the requests of `jointrig identify` and of the Python
//! module, and their results.

use super::cell::BANDS;
use super::from_frfs::{Fit, NoFit, fits};
use super::{Findings, Missing, Substructured};
use crate::results::{Joint, Results, Source};
use crate::structure::Structure;
use crate::substructuring::averaged::{Priors, averaged};
use crate::substructuring::{
    Band, Dof, Frf, Geometry, IdentifyError, IdmSet, Method, fit, identify, keep_common_lines,
};
use std::collections::BTreeMap;
use std::str::FromStr;

/// What to identify, and with which settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Question {
    /// Decoupling methods; empty for all line-by-line methods.
    pub methods: Vec<Asked>,
    /// Sets of interface deformation modes; empty for 2, 4 and 6.
    pub idms: Vec<IdmSet>,
    /// Bands; empty for the default ones that the FRFs cover.
    pub bands: Vec<Band>,
    /// Uncertainties of positions and directions.
    pub priors: Priors,
    /// For the fit: K and C full and symmetric instead of diagonal.
    pub full_joint: bool,
    /// For the fit of FRFs without variance: noise of the real and of the imaginary part of each
    /// value, as a fraction of the rms at the line.
    pub noise: Option<f64>,
    /// For the fit: standard deviation of the difference between A and B alone and A and B in the
    /// assembly, as a fraction of their admittance.
    pub mounting: f64,
}

impl Default for Question {
    fn default() -> Self {
        Self {
            methods: Vec::new(),
            idms: Vec::new(),
            bands: Vec::new(),
            priors: Priors::default(),
            full_joint: false,
            noise: None,
            mounting: fit::Options::default().mounting,
        }
    }
}

/// Why nothing was computed.
#[derive(Debug, thiserror::Error)]
pub enum QuestionError {
    /// None of the default bands contains a line of the files.
    #[error(
        "none of the default bands contains a line of the files, which cover {first:?} to {last:?} Hz: give --band LO:HI"
    )]
    NoBand {
        /// First line, Hz.
        first: Option<f64>,
        /// Last line, Hz.
        last: Option<f64>,
    },
    /// FRFs and geometry do not match.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
}

impl Question {
    /// Results from these FRFs of A, B and the assembly, on the lines that all three have.
    ///
    /// # Errors
    /// FRFs, geometry and bands do not match. Failures of single methods are reported in the
    /// findings instead.
    pub fn answered(
        &self,
        source: Source,
        mut frfs: [Frf; 3],
        geometry: &Geometry,
    ) -> Result<Findings, QuestionError> {
        let methods: Vec<Method> = if self.methods.is_empty() {
            Method::ALL.to_vec()
        } else {
            let by_line =
                |asked: &Asked| if let Asked::ByLine(method) = asked { Some(*method) } else { None };
            self.methods.iter().filter_map(by_line).collect()
        };
        let left_out = keep_common_lines(&mut frfs)?;
        let [a, b, ajb] = frfs;
        let idms = if self.idms.is_empty() { IdmSet::ALL.to_vec() } else { self.idms.clone() };
        let bands = if self.bands.is_empty() { default_bands(&ajb)? } else { self.bands.clone() };
        let mut found = Findings { source, ..Findings::default() };
        found.missing.extend(left_out.map(Missing::LinesLeftOut));
        if !methods.is_empty() {
            let identified = identify(&a, &b, &ajb, geometry, &methods, &idms, &bands)?;
            let of_frfs = Substructured::of([&a, &b, &ajb], geometry, &self.priors, identified);
            found.missing.extend(of_frfs.cmif.as_ref().err().cloned().map(Missing::Cmif));
            found.substructured = Some(of_frfs);
        }
        // the estimates with an interval need all six rigid motions
        if idms.contains(&IdmSet::Six) && methods.contains(&Method::Inverse) {
            let of = |band| averaged(&ajb, geometry, IdmSet::Six, band, &self.priors);
            // if it fails, the refusals of `inverse` already state the reason
            found.recommended = bands.iter().filter_map(|band| of(*band).ok()).collect();
        }
        if self.methods.contains(&Asked::Fit) {
            found.fits = self.fits([a, b, ajb], geometry, &idms, &bands);
        }
        Ok(found)
    }

    /// Checks that every requested method and set of modes gave a row, and that at least one row is
    /// a number.
    ///
    /// # Errors
    /// The reasons, one per line.
    pub fn was_answered(&self, results: &Results) -> Result<(), String> {
        let of_method =
            |row: &Joint, asked: &Option<Asked>| asked.is_none_or(|asked| row.method == asked.name());
        let of_set = |row: &Joint, set: &Option<IdmSet>| set.is_none_or(|set| row.modes == set.dofs());
        let (methods, sets) = (any_or(&self.methods), any_or(&self.idms));
        let there = |method: &Option<Asked>, set: &Option<IdmSet>| {
            results.joint.iter().any(|row| of_method(row, method) && of_set(row, set))
        };
        let all = methods.iter().all(|method| sets.iter().all(|set| there(method, set)));
        let is_number = |row: &Joint| row.identified() || row.sliding_stiffness().is_none();
        let recommended = results.recommended.iter().any(|r| r.joint.values().any(|dof| dof.identified));
        if all && (recommended || results.joint.iter().any(is_number)) {
            return Ok(());
        }
        Err(refusals(results).unwrap_or_else(|| {
            "nothing was identified: scatter or noise is larger than every value (the rows above say by how much); average more hits, \
             or choose another --band"
                .into()
        }))
    }

    /// The fit with each set of modes over each band.
    fn fits(&self, frfs: [Frf; 3], geometry: &Geometry, idms: &[IdmSet], bands: &[Band]) -> Vec<Fit> {
        let shape = if self.full_joint { fit::FreeEntries::Full } else { fit::FreeEntries::Diagonal };
        let options =
            fit::Options { priors: self.priors, shape, mounting: self.mounting, ..fit::Options::default() };
        let mut known = Vec::new();
        for (name, frf) in Structure::ALL.into_iter().zip(frfs) {
            known.push(match self.noise {
                _ if frf.variance().is_some() => frf,
                Some(fraction) => frf.with_relative_noise(fraction),
                None => {
                    let refused =
                        |set: &IdmSet| Fit { idms: *set, outcome: Err(NoFit::FileWithoutVariance(name)) };
                    return idms.iter().map(refused).collect();
                }
            });
        }
        fits([&known[0], &known[1], &known[2]], geometry, idms, bands, &options)
    }
}

/// A method that can be requested.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    /// A line-by-line method.
    ByLine(Method),
    /// Maximum likelihood over all lines.
    Fit,
}

impl Asked {
    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::ByLine(method) => method.name(),
            Self::Fit => fit::NAME,
        }
    }
}

impl FromStr for Asked {
    type Err = String;
    fn from_str(name: &str) -> Result<Self, String> {
        if name == fit::NAME {
            return Ok(Asked::Fit);
        }
        name.parse().map(Asked::ByLine).map_err(|reason: String| format!("{reason}, {}", fit::NAME))
    }
}

/// The named items, or a single `None` that stands for any.
fn any_or<T: Copy>(named: &[T]) -> Vec<Option<T>> {
    if named.is_empty() { vec![None] } else { named.iter().copied().map(Some).collect() }
}

/// One line for each reason, with the methods that it affects.
fn refusals(results: &Results) -> Option<String> {
    let mut by_reason: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for r in &results.refused {
        by_reason.entry(&r.reason).or_default().push(format!("{} with {} IDMs", r.method, r.idms));
    }
    let lines: Vec<String> =
        by_reason.iter().map(|(reason, who)| format!("refused {}: {reason}", who.join(", "))).collect();
    (!lines.is_empty()).then(|| lines.join("\n"))
}

/// The default bands that contain a line of the files.
fn default_bands(frf: &Frf) -> Result<Vec<Band>, QuestionError> {
    let bands: Vec<Band> =
        BANDS.into_iter().filter(|band| frf.frequency_hz().iter().any(|f| band.contains(*f))).collect();
    if bands.is_empty() {
        let (first, last) = (frf.frequency_hz().first().copied(), frf.frequency_hz().last().copied());
        return Err(QuestionError::NoBand { first, last });
    }
    Ok(bands)
}

/// Sets of modes parsed from one argument: the paper's sets given by size, or one set given by its
/// modes.
#[derive(Debug, Clone, PartialEq)]
pub struct IdmSets(pub Vec<IdmSet>);

impl FromStr for IdmSets {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let words: Vec<&str> = text.split(',').map(str::trim).collect();
        let sizes: Result<Vec<usize>, _> = words.iter().map(|w| w.parse()).collect();
        if let Ok(sizes) = sizes {
            let set = |count| {
                IdmSet::from_count(count).ok_or_else(|| {
                    format!("there is no set of {count} modes: 2, 4 or 6, or name the modes (x,z,ry)")
                })
            };
            return sizes.into_iter().map(set).collect::<Result<_, _>>().map(IdmSets);
        }
        let modes: Vec<Dof> = words.iter().map(|w| w.parse()).collect::<Result<_, _>>()?;
        let set = IdmSet::of(&modes).ok_or_else(|| format!("`{text}` names a mode twice"))?;
        Ok(IdmSets(vec![set]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_of_modes_are_read_or_refused_in_words() {
        assert_eq!("4".parse(), Ok(IdmSets(vec![IdmSet::Four])));
        assert_eq!("2, 6".parse(), Ok(IdmSets(vec![IdmSet::Two, IdmSet::Six])));
        let chosen = IdmSet::of(&[Dof::X, Dof::Z, Dof::Ry]).expect("three modes");
        assert_eq!("x,z,ry".parse(), Ok(IdmSets(vec![chosen])));
        assert!("3".parse::<IdmSets>().is_err_and(|e| e.contains("2, 4 or 6")));
        assert!("x,q".parse::<IdmSets>().is_err_and(|e| e.contains("`q`")));
        assert!("x,x".parse::<IdmSets>().is_err_and(|e| e.contains("twice")));
    }
}

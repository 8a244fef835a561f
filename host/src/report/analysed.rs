//! The document of a campaign file: written by `jointrig analyse`, and shown on a page during the
//! measurement.

use super::document::document;
use super::words::missing_sentences;
use crate::analyse::{AnalyseError, Findings, Missing, Progress, Wanted, analyse};
use crate::campaign::store::Store;
use crate::results::Results;
use crate::structure::Structure;
use crate::substructuring::Frf;

/// Analyses the file's contents. The true parameters of a simulated rig are added to the document
/// after the analysis, so that no estimator can use them.
///
/// # Errors
/// The file cannot be read, or holds nothing to analyse.
pub fn analysed(
    store: &Store,
    wanted: Wanted,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Results, AnalyseError> {
    written(store, analyse(store, wanted, progress)?)
}

/// Results of a file together with its FRFs.
#[derive(Debug)]
pub struct WithFrfs {
    /// As returned by [`analysed`].
    pub results: Results,
    /// The FRFs of [`Findings::frfs`].
    pub frfs: Vec<(Structure, Frf)>,
    /// Messages about records that cannot be used.
    pub told: Vec<String>,
}

/// As [`analysed`], with the FRFs of all pairs.
///
/// # Errors
/// As for [`analysed`].
pub fn analysed_with_frfs(
    store: &Store,
    wanted: Wanted,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<WithFrfs, AnalyseError> {
    let mut found = analyse(store, Wanted { frfs: true, ..wanted }, progress)?;
    let frfs = std::mem::take(&mut found.frfs);
    let of_records = found.missing.iter().filter(|missing| matches!(missing, Missing::Records { .. }));
    let told = of_records.map(missing_sentences::sentence).collect();
    Ok(WithFrfs { results: written(store, found)?, frfs, told })
}

fn written(store: &Store, found: Findings) -> Result<Results, AnalyseError> {
    let mut results = document(found);
    if let Some(answer) = &mut results.answer {
        answer.truth = store.simulated_truth()?;
    }
    Ok(results)
}

/// Checks that anything was found at all: an empty document must not be mistaken for a result.
///
/// # Errors
/// The first reason, as a sentence.
pub fn must_hold_something(found: &Results) -> Result<(), String> {
    let answered = found.answer.as_ref().is_some_and(|answer| {
        answer.contact.k_t_n_per_m.is_some()
            || answer.between_arms.k_n_per_m.is_some()
            || answer.clamp.is_some()
    });
    if answered || !found.joint.is_empty() || !found.recommended.is_empty() || !found.hysteresis.is_empty() {
        return Ok(());
    }
    Err(format!(
        "{}: no stiffness could be found from this file: {}",
        found.source.file,
        found.missing.first().map_or("it holds no good hits and no levels", String::as_str)
    ))
}

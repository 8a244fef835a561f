//! The document of a campaign file: what `jointrig analyse` writes, and what a page shows of it while it is measured.

use super::document::document;
use crate::analyse::{AnalyseError, Progress, Wanted, analyse};
use crate::campaign::store::Store;
use crate::results::Results;

/// Analyses what the file holds. A simulated rig's truth joins the document when all is found: no estimator can see it.
///
/// # Errors
/// The file cannot be read, or holds nothing to analyse.
pub fn analysed(
    store: &Store,
    wanted: Wanted,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Results, AnalyseError> {
    let mut results = document(analyse(store, wanted, progress)?);
    if let Some(answer) = &mut results.answer {
        answer.truth = store.simulated_truth()?;
    }
    Ok(results)
}

//! FRFs and results of the file; its records are read once if the analysis forms all requested
//! lines.

use std::collections::HashMap;

use nalgebra::DMatrix;

use crate::analyse::{CampaignFile, KnownContact, LINES_HZ, Progress, Wanted};
use crate::campaign::store::Store;
use crate::cli::error::CliError;
use crate::cli::waiting::Waiting;
use crate::frf::Frf;
use crate::report::{self, WithFrfs};
use crate::structure::Structure;

/// Analyses the file and returns its results, with the FRFs between two frequencies, Hz, of each
/// structure that has any.
pub(super) fn analysed(store: &Store, (low_hz, high_hz): (f64, f64)) -> Result<WithFrfs, CliError> {
    let waiting = Waiting::of("analysing");
    let progress = |progress: Progress| waiting.at(progress.done, progress.total);
    let mut found = report::analysed_with_frfs(store, Wanted::default(), &progress)?;
    if low_hz < LINES_HZ[0] || LINES_HZ[1] < high_hz {
        (found.frfs, found.told) = measured_anew(store, [low_hz, high_hz])?;
    }
    let mut measured: HashMap<Structure, Frf> = std::mem::take(&mut found.frfs).into_iter().collect();
    for structure in Structure::ALL {
        let frf = match measured.remove(&structure) {
            Some(frf) => Some(frf.into_band(low_hz, high_hz)),
            None => store.frf(structure.name())?.map(|found| imported(found.frf)),
        };
        found.frfs.extend(Some(structure).zip(frf));
    }
    if found.frfs.is_empty() {
        found.told.push("no good hit is in the file yet: there are no FRFs to export".into());
    }
    Ok(found)
}

/// FRFs, and messages about records that cannot be used.
type Measured = (Vec<(Structure, Frf)>, Vec<String>);

/// FRFs at lines that the analysis does not form, computed from the records.
fn measured_anew(store: &Store, lines_hz: [f64; 2]) -> Result<Measured, CliError> {
    let file = CampaignFile::open(store, KnownContact::default())?;
    let (mut frfs, mut told) = (Vec::new(), Vec::new());
    for structure in Structure::ALL {
        let (measured, complaints) = file.measured(structure, lines_hz);
        told.extend(complaints);
        frfs.extend(measured.map(|(frf, _)| (structure, frf)));
    }
    Ok((frfs, told))
}

/// Imported FRFs; their coherence is unknown, and their variance may be.
fn imported(frf: Frf) -> Frf {
    let unknown =
        vec![DMatrix::from_element(frf.outputs().len(), frf.inputs().len(), f64::NAN); frf.lines().len()];
    let variance = frf.variance().map_or_else(|| unknown.clone(), <[_]>::to_vec);
    let whole = frf.with_variance(variance).and_then(|frf| frf.with_coherence(unknown));
    whole.expect("one of each was made for every value")
}

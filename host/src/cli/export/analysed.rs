//! FRFs and results of the file, from one reading of its records wherever the analysis has all lines that are asked for.

use nalgebra::DMatrix;

use crate::analyse::{CampaignFile, KnownContact, LINES_HZ, Progress, Wanted};
use crate::campaign::store::Store;
use crate::cli::error::CliError;
use crate::cli::waiting::Waiting;
use crate::frf::Frf;
use crate::report;
use crate::results::Results;
use crate::structure::Structure;

/// What the file says.
pub(super) struct Analysed {
    /// Of each structure that has any.
    pub(super) frfs: Vec<(Structure, Frf)>,
    /// What a reader must know of them.
    pub(super) told: Vec<String>,
    pub(super) results: Results,
}

impl Analysed {
    /// With the FRFs between two frequencies, Hz.
    pub(super) fn of(store: &Store, (low_hz, high_hz): (f64, f64)) -> Result<Self, CliError> {
        let waiting = Waiting::of("analysing");
        let progress = |progress: Progress| waiting.at(progress.done, progress.total);
        let (results, measured, mut told) = if LINES_HZ[0] <= low_hz && high_hz <= LINES_HZ[1] {
            let (results, frfs, told) = report::analysed_with_frfs(store, Wanted::default(), &progress)?;
            let cut = frfs.into_iter().map(|(structure, frf)| (structure, frf.band(low_hz, high_hz)));
            (results, cut.collect(), told)
        } else {
            let (frfs, told) = measured_anew(store, [low_hz, high_hz])?;
            (report::analysed(store, Wanted::default(), &progress)?, frfs, told)
        };
        let mut frfs = Vec::new();
        let mut measured = measured.into_iter().peekable();
        for structure in Structure::ALL {
            match measured.next_if(|(own, _)| *own == structure) {
                Some(found) => frfs.push(found),
                None => {
                    frfs.extend(store.frf(structure.name())?.map(|found| (structure, imported(found.frf))));
                }
            }
        }
        if frfs.is_empty() {
            told.push("no good hit is in the file yet: there are no FRFs to export".into());
        }
        Ok(Self { frfs, told, results })
    }
}

/// At lines that the analysis does not form.
fn measured_anew(
    store: &Store,
    lines_hz: [f64; 2],
) -> Result<(Vec<(Structure, Frf)>, Vec<String>), CliError> {
    let file = CampaignFile::open(store, KnownContact::default())?;
    let (mut frfs, mut told) = (Vec::new(), Vec::new());
    for structure in Structure::ALL {
        let (measured, complaints) = file.measured(structure, lines_hz);
        told.extend(complaints);
        frfs.extend(measured.map(|(frf, _)| (structure, frf)));
    }
    Ok((frfs, told))
}

/// FRFs from elsewhere; their coherence is not known, and their variance need not be.
fn imported(frf: Frf) -> Frf {
    let unknown =
        vec![DMatrix::from_element(frf.outputs().len(), frf.inputs().len(), f64::NAN); frf.lines().len()];
    let variance = frf.variance().map_or_else(|| unknown.clone(), <[_]>::to_vec);
    let whole = frf.with_variance(variance).and_then(|frf| frf.with_coherence(unknown));
    whole.expect("one of each was made for every value")
}

//! `modes`: natural frequencies, damping and shapes of a campaign's structures, or of any FRFs.

use super::error::CliError;
use super::identify::band;
use super::output;
use super::output::not_negative;
use crate::analyse::{CampaignFile, FRF_ERROR, FoundModes, KnownContact, MODES_HZ};
use crate::campaign::store::Store;
use crate::exchange::{LabelledFrf, StatedUnits, modes_output, read_frf_file};
use crate::report::words::mode_sentences;
use crate::report::{mode_rows, scaling};
use crate::results::{ModalFit, ModeRow};
use crate::structure::Structure;
use crate::substructuring::Band;
use crate::untrusted_text::tell_line;
use clap::Args;
use serde::Serialize;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Identify natural frequencies, damping ratios and mode shapes, each with its 95 % interval.
///
/// FILE is a campaign (each of its structures is identified), or FRFs of one structure measured
/// anywhere. No poles are picked by hand: a mode is listed if the FRFs give evidence for it. What
/// the intervals cover, and what they do not, is in docs/modes.md.
#[derive(Debug, Args)]
pub struct ModesArgs {
    /// A campaign file, or FRFs: .npz, or a universal file (58 or 58b; .uff, .unv).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Structures of a campaign [default: all that were measured].
    #[arg(long = "structure", value_name = "A|B|AJB", value_delimiter = ',', value_parser = structure)]
    structures: Vec<Structure>,
    /// Band in Hz, ends included [default: 20:600 for a campaign, all lines for FRFs]; modes
    /// outside it are described by residual terms.
    #[arg(long, value_name = "LO:HI", value_parser = band)]
    band: Option<Band>,
    /// Units that override those of an FRF file's labels: response=mm/s,force=lbf,frequency=rad/s.
    #[arg(long, value_name = "UNITS", default_value = "")]
    units: StatedUnits,
    /// Error of an FRF file's values in addition to their variance, as a fraction of the FRFs' root
    /// mean square at the line and of the value: aim, direction, sensitivity. Zero claims that the
    /// values differ from those of a linear structure by their noise only; if they do not, the
    /// identification may take minutes and list modes that are none.
    #[arg(long, value_name = "FRACTION", default_value_t = FRF_ERROR, value_parser = not_negative)]
    frf_error: f64,
    /// File for the modes with their shapes: .npz, or a universal file (data set 55; .unv, .uff).
    /// For several structures of a campaign the name of each is added, as in modes-AJB.unv.
    #[arg(long, value_name = "FILE", value_parser = out_file)]
    out: Option<PathBuf>,
    /// Print the modes as JSON on stdout.
    #[arg(long)]
    json: bool,
}

/// What `--json` prints; the fields are those of results.json.
#[derive(Serialize)]
struct Printed {
    modes: Vec<ModeRow>,
    modal: Vec<ModalFit>,
}

impl ModesArgs {
    pub fn run(self) -> Result<(), CliError> {
        let found = if is_campaign(&self.file)? { self.of_campaign()? } else { vec![self.of_frfs()?] };
        let (modes, modal) = mode_rows(&found);
        if let Some(out) = &self.out {
            for one in &found {
                self.write(one, out, found.len() > 1)?;
            }
        }
        if self.json {
            return output::json(&Printed { modes, modal });
        }
        output::lines(modal.iter().flat_map(|fit| mode_sentences::table(fit, &modes)))
    }

    /// The modes of each structure that has FRFs.
    ///
    /// # Errors
    /// No structure has any, or one that was named has none.
    fn of_campaign(&self) -> Result<Vec<FoundModes>, CliError> {
        let store = Store::open_read_only(&self.file)?;
        let campaign = CampaignFile::open(&store, KnownContact::default())?;
        let band = self.band.unwrap_or(MODES_HZ);
        let wanted = if self.structures.is_empty() { &Structure::ALL[..] } else { &self.structures[..] };
        let mut found = Vec::new();
        for structure in wanted {
            let wrong = |what: &dyn std::fmt::Display| {
                CliError::Bad(format!("{}: {structure}: {what}", self.file.display()))
            };
            let (measured, told) = campaign.measured(*structure, [band.low_hz, band.high_hz]);
            for line in told {
                tell_line!("jointrig: {}: {line}", self.file.display());
            }
            let frf = match measured {
                Some((frf, _)) => Some(frf),
                None => store.frf(structure.name())?.map(|imported| imported.frf),
            };
            match frf {
                Some(frf) => {
                    found.push(campaign.modes(*structure, &frf, band).map_err(|error| wrong(&error))?);
                }
                None if self.structures.is_empty() => {}
                None => return Err(wrong(&"no good hit and no imported FRFs: measure it, or leave it out")),
            }
        }
        if found.is_empty() {
            return Err(CliError::Bad(format!(
                "{}: no structure has a good hit or imported FRFs: measure it first",
                self.file.display()
            )));
        }
        Ok(found)
    }

    fn of_frfs(&self) -> Result<FoundModes, CliError> {
        if !self.structures.is_empty() {
            return Err(CliError::Usage(format!(
                "--structure is for campaign files: {} has FRFs of one structure",
                self.file.display()
            )));
        }
        let read: LabelledFrf =
            read_frf_file(&self.file, &self.units).map_err(|error| CliError::Bad(error.to_string()))?;
        tell_line!("jointrig: {}: {}", self.file.display(), read.taken);
        for note in &read.notes {
            tell_line!("jointrig: {}: {note}", self.file.display());
        }
        FoundModes::of_labelled(&read, self.band, self.frf_error)
            .map_err(|error| CliError::Bad(format!("{}: {error}", self.file.display())))
    }

    fn write(&self, found: &FoundModes, out: &Path, several: bool) -> Result<(), CliError> {
        let bad = |error: &dyn std::fmt::Display| CliError::Bad(error.to_string());
        let path = match found.structure {
            Some(structure) if several => {
                let stem = out.file_stem().unwrap_or_default().to_string_lossy();
                let ending = out.extension().unwrap_or_default().to_string_lossy();
                out.with_file_name(format!("{stem}-{structure}.{ending}"))
            }
            _ => out.to_owned(),
        };
        if is_npz_name(&path) {
            let scaling = found.modes.modes.first().map_or("", |mode| scaling(mode.scaling));
            modes_output::write_npz(&path, &found.modes, &found.points, scaling).map_err(|e| bad(&e))?;
        } else {
            let file = self.file.file_name().unwrap_or_default().to_string_lossy();
            let title: String = match found.structure {
                Some(structure) => format!("{structure} in {file}"),
                None => file.into_owned(),
            };
            // the format's lines have 80 characters
            let title: String = title.chars().take(60).collect();
            modes_output::write_unv(&path, &found.modes, &found.points, &title).map_err(|e| bad(&e))?;
        }
        tell_line!("jointrig: {}: {} modes", path.display(), found.modes.modes.len());
        Ok(())
    }
}

/// Whether the file is a campaign: an SQLite database.
pub(super) fn is_campaign(path: &Path) -> Result<bool, CliError> {
    let read = |source| CliError::Read { path: path.into(), doing: "reading", source };
    let mut first = Vec::new();
    std::fs::File::open(path).and_then(|file| file.take(16).read_to_end(&mut first)).map_err(read)?;
    Ok(first == b"SQLite format 3\0")
}

fn structure(text: &str) -> Result<Structure, String> {
    Structure::from_name(text).ok_or_else(|| format!("`{text}` is not a structure: A, B or AJB"))
}

fn is_npz_name(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "npz")
}

fn out_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    let known = path.extension().is_some_and(|ending| ending == "npz" || ending == "unv" || ending == "uff");
    if known { Ok(path) } else { Err(format!("`{text}`: give a name that ends in .npz, .unv or .uff")) }
}

//! The subcommands that read campaign files and write what they found: `analyse` (results and
//! report of one file), `compare` (of two), and `report` (every figure and table of one).

use super::error::CliError;
use super::output;
use super::output::{Waiting, not_negative, positive};
use crate::analyse::{KnownContact, Wanted};
use crate::campaign::store::Store;
use crate::report;
use crate::report::{Format, words};
use crate::results::Results;
use clap::Args;
use std::path::{Path, PathBuf};

/// Analyse a campaign file: results.json and report.html.
#[derive(Debug, Args)]
pub struct Analyse {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Folder for results.json and report.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Effective mass of the static arm at the contact, kg [default: identified from the records].
    #[arg(long, value_name = "KG", value_parser = not_negative)]
    effective_mass: Option<f64>,
    /// Stiffness to ground in parallel with the load cells, relative to theirs [default: the
    /// plan's].
    #[arg(long, value_name = "RATIO", value_parser = not_negative)]
    parallel_path: Option<f64>,
    /// Normal load, N, for the friction coefficient [default: the plan's].
    #[arg(long, value_name = "N", value_parser = positive)]
    normal_load: Option<f64>,
    /// Number of bootstrap resamplings of the hits of every interface cell, for an interval that
    /// needs no noise model (1000 is usual).
    #[arg(long, value_name = "N", default_value_t = 0)]
    bootstrap: usize,
    /// Print every method, check and loop too.
    #[arg(long)]
    details: bool,
    /// Print results.json on stdout too.
    #[arg(long)]
    json: bool,
}

impl Analyse {
    pub fn run(self) -> Result<(), CliError> {
        let store = Store::open_read_only(&self.file)?;
        let known = KnownContact {
            normal_load_n: self.normal_load,
            parallel_path: self.parallel_path,
            effective_mass_kg: self.effective_mass,
        };
        let found = analyse_into(
            &store,
            Wanted { replicates: self.bootstrap, known, ..Wanted::default() },
            &self.out,
            &[],
        )?;
        if self.json {
            output::json(&found)?;
        } else {
            if self.details {
                output::lines(words::summary(&found))?;
                output::lines([String::new()])?;
            }
            ending(&found, &self.out)?;
        }
        report::must_hold_something(&found).map_err(CliError::Bad)
    }
}

/// Prints the result in a few lines, and where the report is.
pub fn ending(found: &Results, folder: &Path) -> Result<(), CliError> {
    output::lines(words::brief::terminal(found, 1))?;
    output::lines([where_to_look(folder)])
}

/// Last line of every command that writes a report.
pub fn where_to_look(folder: &Path) -> String {
    format!("Open {} for figures and tables.", folder.join(report::REPORT_FILE).display())
}

/// Analyses the file's content, with a progress bar.
pub fn analysed(store: &Store, wanted: Wanted) -> Result<Results, CliError> {
    let waiting = Waiting::of("analysing");
    let results = report::analysed(store, wanted, &|progress| waiting.at(progress.done, progress.total))?;
    Ok(results)
}

/// Analyses the file's content and writes `results.json`, `report.html` and the requested figures
/// into `folder`.
pub fn analyse_into(
    store: &Store,
    wanted: Wanted,
    folder: &Path,
    formats: &[report::Format],
) -> Result<Results, CliError> {
    let results = analysed(store, wanted)?;
    write_into(&results, folder, formats)?;
    Ok(results)
}

/// Writes `results.json`, `report.html` and the requested figures into `folder`.
pub fn write_into(results: &Results, folder: &Path, formats: &[report::Format]) -> Result<(), CliError> {
    report::write(results, folder, formats).map_err(|source| CliError::File {
        path: folder.into(),
        doing: "writing results and report",
        source,
    })
}

/// Compare two campaigns: before and after wear, or under two loads. Writes compare.json and
/// compare.html.
#[derive(Debug, Args)]
pub struct Compare {
    /// The first campaign file.
    #[arg(value_name = "A.jrig")]
    a: PathBuf,
    /// The second campaign file.
    #[arg(value_name = "B.jrig")]
    b: PathBuf,
    /// Folder for compare.json and compare.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print compare.json on stdout too.
    #[arg(long)]
    json: bool,
}

impl Compare {
    pub fn run(self) -> Result<(), CliError> {
        let a = analysed(&Store::open_read_only(&self.a)?, Wanted::default())?;
        let b = analysed(&Store::open_read_only(&self.b)?, Wanted::default())?;
        let compared = report::compare(&a, &b);
        report::write_comparison(&compared, [&a, &b], &self.out).map_err(|source| CliError::File {
            path: self.out.clone(),
            doing: "writing the comparison",
            source,
        })?;
        if self.json {
            return output::json(&compared);
        }
        output::lines([
            report::words::brief::on_what(&a),
            report::words::brief::on_what(&b),
            compared.verdict.clone(),
            format!("Open {} for differences and figures.", self.out.join(report::COMPARISON_FILE).display()),
        ])
    }
}

/// Write the report of a campaign file: results.json, report.html, and optionally each figure as a
/// separate file.
#[derive(Debug, Args)]
pub struct Report {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Folder for results.json, report.html and figures/.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Also write each figure as figures/NAME, in these formats.
    #[arg(long, value_name = "FORMAT", value_delimiter = ',')]
    figures: Vec<Format>,
}

impl Report {
    pub fn run(self) -> Result<(), CliError> {
        let store = Store::open_read_only(&self.file)?;
        let found = analyse_into(&store, Wanted::default(), &self.out, &self.figures)?;
        ending(&found, &self.out)
    }
}

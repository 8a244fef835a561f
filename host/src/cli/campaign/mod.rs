//! `campaign new | run | next | status | show | drop | keep | calibrate | places | check | verify |
//! backup`.
//!
//! `campaign backup`: a verified copy, even while the campaign runs.
//!
//! `campaign drop` and `campaign keep`: overrule verdicts. The original verdict stays in the file.
//!
//! `campaign new`: creates a campaign file from a plan.

use super::error::CliError;
use super::output;
use super::plan::file as plan_file;
use crate::advice::quoted;
use crate::campaign::plan;
use crate::campaign::store::Store;
use crate::campaign::verdict::Verdict;
use crate::untrusted_text::tell_line;
use clap::{Args, Subcommand};
use std::path::PathBuf;

mod calibrate;
mod check;
mod next;
mod places;
pub mod run;
mod show;
mod status;
mod verify;

/// Impact campaigns.
#[derive(Debug, Args)]
pub struct Campaign {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Create a campaign file from a plan.
    New(New),
    /// Measure what is missing; resumes where it stopped.
    Run(run::Run),
    /// Show which further cells shrink k_T's interval most per minute.
    Next(next::Next),
    /// Show, per cell, the hits wanted, kept and refused, and why.
    Status(status::Status),
    /// Show a cell: its records, their verdicts, and a figure.
    Show(show::Show),
    /// Exclude records from the analysis, whatever their verdict.
    Drop(Overrule),
    /// Include records in the analysis, whatever their verdict.
    Keep(Overrule),
    /// Enter calibrations of sensors, even after the campaign; results are recomputed with them.
    Calibrate(calibrate::Calibrate),
    /// Enter places that were measured again, even after the campaign; results are recomputed with
    /// them.
    Places(places::Places),
    /// Check the sign of every channel, and hammer against vibrometer on a known mass.
    Check(check::Check),
    /// Check every record's checksum; exits with 1 if anything is damaged.
    Verify(verify::Verify),
    /// Copy a campaign file, even while it is being written.
    Backup(Backup),
}

impl Campaign {
    pub fn run(self) -> Result<(), CliError> {
        match self.command {
            Command::New(command) => command.run(),
            Command::Run(command) => command.run(),
            Command::Next(command) => command.run(),
            Command::Status(command) => command.run(),
            Command::Show(command) => command.run(),
            Command::Drop(command) => command.drop(),
            Command::Keep(command) => command.keep(),
            Command::Calibrate(command) => command.run(),
            Command::Places(command) => command.run(),
            Command::Check(command) => command.run(),
            Command::Verify(command) => command.run(),
            Command::Backup(command) => command.run(),
        }
    }
}

/// Copy a campaign file, even while it is being written; the copy is verified before it gets its
/// name.
#[derive(Debug, Args)]
pub struct Backup {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// The copy.
    #[arg(value_name = "COPY.jrig")]
    copy: PathBuf,
}

impl Backup {
    pub fn run(self) -> Result<(), CliError> {
        let records = Store::open_read_only(&self.file)?.back_up(&self.copy)?;
        output::lines([format!("{}: {records} records, all intact", self.copy.display())])
    }
}

/// Records and reason.
#[derive(Debug, Args)]
pub struct Overrule {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Records by number, as listed by `campaign show`.
    #[arg(value_name = "RECORD", required = true)]
    records: Vec<i64>,
    /// Reason, stored with the verdict.
    #[arg(long, value_name = "TEXT")]
    reason: Option<String>,
}

impl Overrule {
    /// Excludes the records from the analysis; `campaign run` then measures the missing hits.
    pub fn drop(self) -> Result<(), CliError> {
        self.overrule(Verdict::Dropped, "a person dropped it")
    }

    /// Includes the records in the analysis.
    pub fn keep(self) -> Result<(), CliError> {
        self.overrule(Verdict::Good, "a person kept it")
    }

    fn overrule(self, verdict: Verdict, otherwise: &str) -> Result<(), CliError> {
        let store = Store::open(&self.file)?;
        let reason = self.reason.as_deref().unwrap_or(otherwise);
        let mut said = Vec::new();
        // all or none: a wrong number must not leave the command half done
        for id in &self.records {
            let record = store.record(*id)?;
            if verdict == Verdict::Good && record.scans == 0 {
                return Err(CliError::Bad(format!("record {id} has no samples: the bolt did not arrive")));
            }
            said.push(format!(
                "record {id}: {} ({}), now {verdict}: {reason}",
                record.standing(),
                record.sentence
            ));
        }
        for id in &self.records {
            store.overrule(*id, verdict, reason)?;
        }
        store.close()?;
        output::lines(said)
    }
}

/// Create a campaign file from a plan.
#[derive(Debug, Args)]
pub struct New {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// The plan.
    #[arg(long, value_name = "PLAN.toml", required_unless_present = "paper", conflicts_with = "paper")]
    plan: Option<PathBuf>,
    /// The paper's plan: 252 cells of 8 hits.
    #[arg(long)]
    paper: bool,
}

impl New {
    pub fn run(self) -> Result<(), CliError> {
        let (text, name) = match &self.plan {
            None => (plan::PAPER.to_owned(), "paper.toml".to_owned()),
            Some(path) => (plan_file::read(path)?, path.display().to_string()),
        };
        let store = Store::create(&self.file, &text, &name)?;
        let (plan, cells) = (store.plan()?, store.cells()?);
        let path = quoted(&self.file);
        tell_line!("{path}: {} cells, {} hits wanted", cells.len(), plan.hits_wanted());
        if let Some(shaker) = &plan.shaker {
            tell_line!("{}", shaker.get_ref().remark(&self.file));
        }
        tell_line!("next: jointrig campaign run {path} --device sim:");
        Ok(store.close()?)
    }
}

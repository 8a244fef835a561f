//! `campaign new | run | status | show | drop | keep | calibrate | check | verify | backup`.

mod backup;
mod calibrate;
mod check;
mod judged;
mod new;
pub mod run;
mod show;
mod status;
mod verify;

use clap::{Args, Subcommand};

use super::error::CliError;

/// Impact campaigns.
#[derive(Debug, Args)]
pub struct Campaign {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Create a campaign file from a plan.
    New(new::New),
    /// Measure what is missing; resumes where it stopped.
    Run(run::Run),
    /// Show, per cell, the hits wanted, kept and refused, and why.
    Status(status::Status),
    /// Show a cell: its records, their verdicts, and a figure.
    Show(show::Show),
    /// Exclude records from the analysis, whatever their verdict.
    Drop(judged::Overrule),
    /// Include records in the analysis, whatever their verdict.
    Keep(judged::Overrule),
    /// Enter calibrations of sensors, even after the campaign; results are recomputed with them.
    Calibrate(calibrate::Calibrate),
    /// Check the sign of every channel, and hammer against vibrometer on a known mass.
    Check(check::Check),
    /// Check every record's checksum; exits with 1 if anything is damaged.
    Verify(verify::Verify),
    /// Copy a campaign file, even while it is being written.
    Backup(backup::Backup),
}

impl Campaign {
    pub fn run(self) -> Result<(), CliError> {
        match self.command {
            Command::New(command) => command.run(),
            Command::Run(command) => command.run(),
            Command::Status(command) => command.run(),
            Command::Show(command) => command.run(),
            Command::Drop(command) => command.drop(),
            Command::Keep(command) => command.keep(),
            Command::Calibrate(command) => command.run(),
            Command::Check(command) => command.run(),
            Command::Verify(command) => command.run(),
            Command::Backup(command) => command.run(),
        }
    }
}

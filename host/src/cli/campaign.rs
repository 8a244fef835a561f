//! `campaign new | run | status | verify`.

mod new;
mod run;
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
    /// Measure what is left of it; resumes where it stopped.
    Run(run::Run),
    /// Show, per cell, what is wanted, kept and refused, and why.
    Status(status::Status),
    /// Check every record's checksum; exits with 1 on any damage.
    Verify(verify::Verify),
}

impl Campaign {
    pub fn run(self) -> Result<(), CliError> {
        match self.command {
            Command::New(command) => command.run(),
            Command::Run(command) => command.run(),
            Command::Status(command) => command.run(),
            Command::Verify(command) => command.run(),
        }
    }
}

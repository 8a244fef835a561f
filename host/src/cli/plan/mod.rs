//! `plan`: working with a plan's file before a campaign exists.

mod check;
pub mod file;
mod new;

use clap::{Args, Subcommand};

use crate::cli::error::CliError;

/// Plans: write a template, and check a plan.
#[derive(Debug, Args)]
pub struct Plan {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a plan from a template.
    New(new::New),
    /// List all errors of a plan and the results that it yields, and draw the positions of hammer
    /// and vibrometer.
    Check(check::Check),
}

impl Plan {
    pub fn run(self) -> Result<(), CliError> {
        match self.command {
            Command::New(command) => command.run(),
            Command::Check(command) => command.run(),
        }
    }
}

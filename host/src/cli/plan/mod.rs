//! `plan`: a plan's file before there is a campaign.

mod check;
pub mod file;
mod new;

use clap::{Args, Subcommand};

use crate::cli::error::CliError;

/// Plans: write one to begin with, and see what is wrong with it.
#[derive(Debug, Args)]
pub struct Plan {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Write a plan to begin with.
    New(new::New),
    /// Say everything that is wrong with a plan, what it answers, and draw where hammer and vibrometer go.
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

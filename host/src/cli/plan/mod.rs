//! `plan`: working with a plan's file before a campaign exists.
//!
//! `plan new`: writes a plan from a template.

use super::error::CliError;
use crate::advice::quoted;
use crate::campaign::plan;
use crate::untrusted_text::tell_line;
use clap::{Args, Subcommand, ValueEnum};
use std::fs::OpenOptions;
use std::io::{ErrorKind, Write as _};
use std::path::PathBuf;

mod check;
pub mod file;

/// Plans: write a template, and check a plan.
#[derive(Debug, Args)]
pub struct Plan {
    #[command(subcommand)]
    command: PlanCommand,
}

#[derive(Debug, Subcommand)]
enum PlanCommand {
    /// Write a plan from a template.
    New(New),
    /// List all errors of a plan and the results that it yields, and draw the positions of hammer
    /// and vibrometer.
    Check(check::PlanCheck),
}

impl Plan {
    pub fn run(self) -> Result<(), CliError> {
        match self.command {
            PlanCommand::New(command) => command.run(),
            PlanCommand::Check(command) => command.run(),
        }
    }
}

/// Write a plan from a template.
#[derive(Debug, Args)]
pub struct New {
    /// The plan's file, which must not exist yet.
    #[arg(value_name = "PLAN.toml")]
    file: PathBuf,
    /// What the plan should determine.
    #[arg(long, value_enum, default_value = "contact")]
    template: Template,
}

/// The templates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Template {
    /// The contact's own k_T: 60 cells of six hits.
    Contact,
    /// The same with a manual hammer and accelerometers instead of lasers: 13 places of ten hits.
    ContactByHand,
    /// FRFs of one structure with a manual hammer and fixed accelerometers.
    FrfOnly,
    /// The paper's campaign, the stiffness between the arms: 252 cells of eight hits.
    Paper,
    /// Both: 276 cells.
    PaperContact,
    /// A few cells, for trying a rig.
    Small,
}

impl Template {
    fn text(self) -> &'static str {
        match self {
            Template::Contact => plan::CONTACT,
            Template::ContactByHand => plan::CONTACT_BY_HAND,
            Template::FrfOnly => plan::FRF_ONLY,
            Template::Paper => plan::PAPER,
            Template::PaperContact => plan::PAPER_CONTACT,
            Template::Small => plan::SMALL,
        }
    }
}

impl New {
    pub fn run(self) -> Result<(), CliError> {
        let path = &self.file;
        let failed = |source: std::io::Error| {
            if source.kind() == ErrorKind::AlreadyExists {
                return CliError::Bad(format!(
                    "{} exists already: choose another name, or edit it",
                    path.display()
                ));
            }
            CliError::File { path: path.clone(), doing: "writing the plan", source }
        };
        let mut file = OpenOptions::new().write(true).create_new(true).open(path).map_err(failed)?;
        file.write_all(self.template.text().as_bytes()).map_err(failed)?;
        let path = quoted(path);
        tell_line!("{path}: edit it, above all [geometry]");
        tell_line!("next: jointrig plan check {path}");
        Ok(())
    }
}

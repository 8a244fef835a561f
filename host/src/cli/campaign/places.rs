//! `campaign places`: places that were measured again after the hits.

use crate::advice::quoted;
use crate::campaign::store::Store;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::cli::plan::file as plan_file;
use clap::Args;
use std::path::PathBuf;

/// File, corrected plan and reason.
#[derive(Debug, Args)]
pub struct Places {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// The file's plan with the corrected places and directions, and with what is known of them
    /// (`[priors]`, `[specimens]`, `[contact]`, `[known_mass]`). Nothing else may differ.
    #[arg(long, value_name = "PLAN.toml")]
    plan: PathBuf,
    /// Reason, stored with the correction.
    #[arg(long, value_name = "TEXT")]
    reason: String,
}

impl Places {
    pub fn run(self) -> Result<(), CliError> {
        let text = plan_file::read(&self.plan)?;
        let store = Store::open(&self.file)?;
        let mut said = store.measure_again(&text, &self.plan.display().to_string(), &self.reason)?;
        store.close()?;
        said.push(format!("next: jointrig analyse {} --out DIR", quoted(&self.file)));
        output::lines(said)
    }
}

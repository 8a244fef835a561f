//! `campaign new`: creates a campaign file from a plan.

use std::path::PathBuf;

use clap::Args;

use crate::advice::quoted;
use crate::campaign::plan;
use crate::campaign::store::Store;
use crate::cli::error::CliError;
use crate::cli::plan::file as plan_file;
use crate::outside::tell_line;

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

//! `campaign backup`: a verified copy, even while the campaign runs.

use std::path::PathBuf;

use clap::Args;

use crate::campaign::store::Store;
use crate::cli::error::CliError;
use crate::cli::output;

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
        output::lines([format!("{}: {records} records, all whole", self.copy.display())])
    }
}

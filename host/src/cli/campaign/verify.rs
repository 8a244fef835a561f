//! `campaign verify`: every record's checksum.

use std::path::PathBuf;

use clap::Args;

use crate::campaign::store::Store;
use crate::cli::error::CliError;
use crate::cli::output;

/// Check every record's checksum; exits with 1 on any damage.
#[derive(Debug, Args)]
pub struct Verify {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
}

impl Verify {
    pub fn run(self) -> Result<(), CliError> {
        let store = Store::open_read_only(&self.file)?;
        let damage = store.verify()?;
        let path = self.file.display();
        output::lines(damage.iter().map(|damage| match damage.record {
            Some(record) => format!("record {record}: {}", damage.what),
            None => format!("file: {}", damage.what),
        }))?;
        if damage.is_empty() {
            let frfs = match store.frf_rows()?.len() {
                0 => String::new(),
                count => format!(" and {count} FRF matrices from elsewhere"),
            };
            output::lines([format!("{path}: {} records{frfs}, all whole", store.records()?.len())])
        } else {
            Err(CliError::Bad(format!(
                "{path}: {} damaged; analysis leaves damaged records out",
                damage.len()
            )))
        }
    }
}

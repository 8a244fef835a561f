//! `campaign verify`: every checksum, and every row as it was left.

use std::path::PathBuf;

use clap::Args;

use crate::campaign::store::Store;
use crate::cli::error::CliError;
use crate::cli::output;

/// Check every checksum, and that no row was changed, added or removed by anything but jointrig; exits with 1 on any damage.
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
            let chained = if store.has_chain()? {
                ""
            } else {
                "; it is of an older version without a chain, so that only records, levels and FRFs could be checked"
            };
            output::lines([format!("{path}: {} records{frfs}, all whole{chained}", store.records()?.len())])
        } else {
            Err(CliError::Bad(format!(
                "{path}: {} damaged; analysis leaves damaged records out",
                damage.len()
            )))
        }
    }
}

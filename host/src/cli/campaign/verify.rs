//! `campaign verify`: checks every checksum, and that every row is unchanged.

use std::path::PathBuf;

use clap::Args;

use crate::campaign::recheck::recheck;
use crate::campaign::store::Store;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::cli::output::Waiting;

/// Check every checksum, and that no row was changed, added or removed by anything but jointrig;
/// exits with 1 if anything is damaged.
#[derive(Debug, Args)]
pub struct Verify {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Judge every record and measure every level again from the raw samples, and compare the
    /// results with the file.
    #[arg(long)]
    deep: bool,
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
        if !damage.is_empty() {
            return Err(CliError::Bad(format!(
                "{path}: {} damaged; analysis leaves damaged records out",
                damage.len()
            )));
        }
        let frfs = match store.frf_rows()?.len() {
            0 => String::new(),
            count => format!(" and {count} imported FRF matrices"),
        };
        let chained = if store.has_chain()? {
            ""
        } else {
            "; it is of an older version without a chain, so that only records, levels and FRFs could be checked"
        };
        output::lines([format!("{path}: {} records{frfs}, all intact{chained}", store.records()?.len())])?;
        if self.deep { deep(&store) } else { Ok(()) }
    }
}

fn deep(store: &Store) -> Result<(), CliError> {
    let waiting = Waiting::of("computing anew");
    let found = recheck(store, &|done, of| waiting.at(done, of))?;
    drop(waiting);
    output::lines(found.different.clone())?;
    let path = store.path().display();
    let (records, levels) = (found.records, found.levels);
    if found.different.is_empty() {
        let levels = if levels == 0 { String::new() } else { format!(" and {levels} levels") };
        let told = format!("{path}: the verdicts of {records} records{levels} follow from their raw samples");
        return output::lines([told]);
    }
    let versions = found.other_version.map_or_else(String::new, |version| {
        format!("; part of it was judged by jointrig {version}, and this is {}", env!("CARGO_PKG_VERSION"))
    });
    Err(CliError::Bad(format!("{path}: {} of {} differ{versions}", found.different.len(), records + levels)))
}

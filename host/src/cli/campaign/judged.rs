//! `campaign drop` and `campaign keep`: a person overrules a verdict. The judge's own stays in the file beside it.

use std::path::PathBuf;

use clap::Args;

use crate::campaign::store::Store;
use crate::campaign::verdict::Kind;
use crate::cli::error::CliError;
use crate::cli::output;

/// Which records, and why.
#[derive(Debug, Args)]
pub struct Overrule {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Records by number, as `campaign show` lists them.
    #[arg(value_name = "RECORD", required = true)]
    records: Vec<i64>,
    /// Why; it is kept with the verdict.
    #[arg(long, value_name = "TEXT")]
    reason: Option<String>,
}

impl Overrule {
    /// Leaves the records out of the analysis; `campaign run` then strikes what is missing.
    pub fn drop(self) -> Result<(), CliError> {
        self.overrule(Kind::Dropped, "a person dropped it")
    }

    /// Takes the records into the analysis.
    pub fn keep(self) -> Result<(), CliError> {
        self.overrule(Kind::Good, "a person kept it")
    }

    fn overrule(self, verdict: Kind, otherwise: &str) -> Result<(), CliError> {
        let store = Store::open(&self.file)?;
        let reason = self.reason.as_deref().unwrap_or(otherwise);
        let mut said = Vec::new();
        // all or none: a wrong number must not leave half of it done
        for id in &self.records {
            let record = store.record(*id)?;
            if verdict == Kind::Good && record.scans == 0 {
                return Err(CliError::Bad(format!("record {id} has no samples: the bolt did not arrive")));
            }
            said.push(format!(
                "record {id}: {} ({}), now {verdict}: {reason}",
                record.standing(),
                record.sentence
            ));
        }
        for id in &self.records {
            store.overrule(*id, verdict, reason)?;
        }
        store.close()?;
        output::lines(said)
    }
}

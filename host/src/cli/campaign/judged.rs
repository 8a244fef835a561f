//! `campaign drop` and `campaign keep`: overrule verdicts. The original verdict stays in the file.

use std::path::PathBuf;

use clap::Args;

use crate::campaign::store::Store;
use crate::campaign::verdict::Kind;
use crate::cli::error::CliError;
use crate::cli::output;

/// Records and reason.
#[derive(Debug, Args)]
pub struct Overrule {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Records by number, as listed by `campaign show`.
    #[arg(value_name = "RECORD", required = true)]
    records: Vec<i64>,
    /// Reason, stored with the verdict.
    #[arg(long, value_name = "TEXT")]
    reason: Option<String>,
}

impl Overrule {
    /// Excludes the records from the analysis; `campaign run` then measures the missing hits.
    pub fn drop(self) -> Result<(), CliError> {
        self.overrule(Kind::Dropped, "a person dropped it")
    }

    /// Includes the records in the analysis.
    pub fn keep(self) -> Result<(), CliError> {
        self.overrule(Kind::Good, "a person kept it")
    }

    fn overrule(self, verdict: Kind, otherwise: &str) -> Result<(), CliError> {
        let store = Store::open(&self.file)?;
        let reason = self.reason.as_deref().unwrap_or(otherwise);
        let mut said = Vec::new();
        // all or none: a wrong number must not leave the command half done
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

//! `compare`: compares two campaigns.

use std::path::PathBuf;

use clap::Args;

use super::analyse::analysed;
use super::error::CliError;
use super::output;
use crate::analyse::Wanted;
use crate::campaign::store::Store;
use crate::report;

/// Compare two campaigns: before and after wear, or under two loads. Writes compare.json and
/// compare.html.
#[derive(Debug, Args)]
pub struct Compare {
    /// The first campaign file.
    #[arg(value_name = "A.jrig")]
    a: PathBuf,
    /// The second campaign file.
    #[arg(value_name = "B.jrig")]
    b: PathBuf,
    /// Folder for compare.json and compare.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print compare.json on stdout too.
    #[arg(long)]
    json: bool,
}

impl Compare {
    pub fn run(self) -> Result<(), CliError> {
        let a = analysed(&Store::open_read_only(&self.a)?, Wanted::default())?;
        let b = analysed(&Store::open_read_only(&self.b)?, Wanted::default())?;
        let compared = report::compare(&a, &b);
        report::write_comparison(&compared, [&a, &b], &self.out).map_err(|source| CliError::File {
            path: self.out.clone(),
            doing: "writing the comparison",
            source,
        })?;
        if self.json {
            return output::json(&compared);
        }
        output::lines([
            report::words::brief::on_what(&a),
            report::words::brief::on_what(&b),
            compared.verdict.clone(),
            format!("Open {} for differences and figures.", self.out.join(report::COMPARISON_FILE).display()),
        ])
    }
}

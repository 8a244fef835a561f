//! `campaign check`: polarity of every channel, and hammer against vibrometer on a known mass.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use crate::campaign::sensor_check::{Polarity, Ratio, polarity, ratio};
use crate::campaign::store::Store;
use crate::cli::campaign::show::find;
use crate::cli::error::CliError;
use crate::cli::output;

/// Largest accepted relative difference between hammer and vibrometer: the usual uncertainty of
/// both calibrations.
const TOLERANCE: f64 = 0.05;

/// Check the kept records: the sign of every channel, and hammer against vibrometer on a known
/// mass; exits with 1 if something is wrong.
#[derive(Debug, Args)]
pub struct Check {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// Mass of a free, rigid body that was struck through its centre of mass, kg.
    #[arg(long, value_name = "KG", requires = "cell")]
    mass: Option<f64>,
    /// The cell in which it was struck, as CONFIGURATION/IMPACT/RESPONSE.
    #[arg(long, value_name = "CELL", requires = "mass")]
    cell: Option<String>,
    /// Print one JSON document on stdout.
    #[arg(long)]
    json: bool,
}

impl Check {
    pub fn run(self) -> Result<(), CliError> {
        let store = Store::open_read_only(&self.file)?;
        let signs = polarity(&store)?;
        let mut masses = None;
        if let (Some(mass), Some(cell)) = (self.mass, &self.cell) {
            if !(mass.is_finite() && mass > 0.0) {
                return Err(CliError::Usage("--mass must be over 0 kg".into()));
            }
            let cells = store.cells()?;
            let found = ratio(&store, find(&cells, cell)?.id, mass)?;
            let found =
                found.ok_or_else(|| CliError::Bad(format!("{cell} has no kept hit to compare with")))?;
            masses = Some(found);
        }
        if self.json {
            output::json(&json!({
                "polarity": signs.iter().map(sign_json).collect::<Vec<_>>(),
                "ratio": masses.as_ref().map(ratio_json),
            }))?;
        } else {
            output::lines(signs.iter().map(sign_line).chain(masses.iter().map(ratio_line)))?;
        }
        let turned: Vec<&str> = signs
            .iter()
            .filter(|sign| sign.right() == Some(false))
            .map(|sign| sign.channel.as_str())
            .collect();
        if !turned.is_empty() {
            let names = turned.join(", ");
            return Err(CliError::Bad(format!(
                "wrong sign: {names}; turn the sensor or its scale's sign on the device"
            )));
        }
        match masses {
            Some(found) if (found.mean - 1.0).abs() > TOLERANCE => Err(CliError::Bad(format!(
                "hammer and vibrometer disagree by {:+.1} %: one of the two sensitivities is wrong, or the body is not free",
                100.0 * (found.mean - 1.0)
            ))),
            _ => Ok(()),
        }
    }
}

fn sign_line(found: &Polarity) -> String {
    let (name, count) = (&found.channel, found.records.len());
    match (found.sign, found.right()) {
        (Some(sign), Some(true)) => format!("{name:<12} right ({sign:+.2}, {count} hits)"),
        (Some(sign), Some(false)) => format!("{name:<12} TURNED ({sign:+.2}, {count} hits)"),
        (Some(sign), None) => format!("{name:<12} not clear ({sign:+.2}, {count} hits)"),
        (None, _) => format!("{name:<12} unknown: no kept hit along its axis"),
    }
}

fn sign_json(found: &Polarity) -> Value {
    json!({ "channel": found.channel, "sign": found.sign, "right": found.right(), "records": found.records })
}

fn ratio_line(found: &Ratio) -> String {
    format!(
        "hammer / vibrometer on the known mass: {:.4} ± {:.4} ({} hits; 1 is right)",
        found.mean,
        found.deviation,
        found.records.len()
    )
}

fn ratio_json(found: &Ratio) -> Value {
    json!({ "mean": found.mean, "deviation": found.deviation, "records": found.records })
}

//! `campaign calibrate`: new calibrations of sensors. Raw codes and earlier calibrations stay in
//! the file.

use std::path::{Path, PathBuf};

use clap::Args;

use crate::advice::quoted;
use crate::campaign::plan::{CalibrationFile, SensorPlan};
use crate::campaign::store::Store;
use crate::cli::error::CliError;
use crate::cli::output;
use crate::device::channels::ChannelMap;

/// File, calibrations and reason.
#[derive(Debug, Args)]
pub struct Calibrate {
    /// The campaign file.
    #[arg(value_name = "FILE.jrig")]
    file: PathBuf,
    /// The laboratory's sensors: `[[channel]]` tables as in a plan.
    #[arg(long, value_name = "LAB.toml")]
    calibration: PathBuf,
    /// The first session to which the calibration applies [default: all].
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(i64).range(1..))]
    from_session: i64,
    /// Reason, stored with the calibration.
    #[arg(long, value_name = "TEXT")]
    reason: String,
}

impl Calibrate {
    pub fn run(self) -> Result<(), CliError> {
        let store = Store::open(&self.file)?;
        let sensors = read(&self.calibration)?;
        let sessions: Vec<i64> =
            store.sessions()?.iter().map(|(id, _)| *id).filter(|id| *id >= self.from_session).collect();
        let Some(session) = sessions.last() else {
            return Err(CliError::Bad(format!(
                "{} has no session from {} on: give the calibration to `campaign run --calibration` when it measures",
                self.file.display(),
                self.from_session
            )));
        };
        let before = store.channels(*session)?;
        known(&sensors, &before, &self.calibration)?;
        store.calibrate(&sensors, self.from_session, &self.reason)?;
        let now = store.channels(*session)?;
        let mut said: Vec<String> = Vec::new();
        for (old, new) in before.channels.iter().zip(&now.channels) {
            if !sensors.iter().any(|sensor| sensor.name == new.name.as_str()) {
                continue;
            }
            let volts = |units_per_volt: f32| 1.0 / f64::from(units_per_volt);
            let (was, is) = (volts(old.units_per_volt), volts(new.units_per_volt));
            said.push(format!(
                "{}: {was:.6} V per {unit}, now {is:.6} ({:+.2} %); delay {} ns, now {}",
                new.name,
                100.0 * (is / was - 1.0),
                old.delay_ns,
                new.delay_ns,
                unit = new.quantity.unit()
            ));
        }
        let file = quoted(&self.file);
        said.push(format!("next: jointrig analyse {file} --out DIR"));
        store.close()?;
        output::lines(said)
    }
}

/// Reads a laboratory's calibration file.
pub fn read(path: &Path) -> Result<Vec<SensorPlan>, CliError> {
    let text = crate::untrusted_input::text(path, crate::untrusted_input::SETTINGS)
        .map_err(|source| CliError::Read { path: path.into(), doing: "reading the calibration", source })?;
    let file = CalibrationFile::parse(&text, &path.display().to_string())?;
    Ok(file.channel.into_iter().map(toml::Spanned::into_inner).collect())
}

/// Refuses sensors of channels that do not exist.
fn known(sensors: &[SensorPlan], channels: &ChannelMap, path: &Path) -> Result<(), CliError> {
    let there = |name: &str| channels.channels.iter().any(|channel| channel.name == name);
    match sensors.iter().find(|sensor| !there(&sensor.name)) {
        None => Ok(()),
        Some(sensor) => {
            let names: Vec<&str> = channels.channels.iter().map(|channel| channel.name.as_str()).collect();
            Err(CliError::Bad(format!(
                "{}: there is no channel `{}`; the channels are {}",
                path.display(),
                sensor.name,
                names.join(", ")
            )))
        }
    }
}

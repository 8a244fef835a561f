//! The sensor on a channel, as described by a plan or a laboratory's calibration file.

use std::collections::HashSet;

use serde::Deserialize;
use toml::Spanned;

use super::PlanError;
use super::faults::{Faults, first, read};

/// The sensor on a channel of the device.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorPlan {
    /// The channel's name on the device.
    pub name: String,
    /// The sensor's model.
    pub model: Option<String>,
    /// Its serial number.
    pub serial: Option<String>,
    /// When it was calibrated, YYYY-MM-DD.
    pub calibrated: Option<String>,
    /// V per SI unit, without sign.
    pub sensitivity_v: Option<f64>,
    /// 1, or -1 where a positive quantity gives a negative voltage.
    pub polarity: Option<i8>,
    /// Delay of its signal, s.
    pub delay_s: Option<f64>,
    /// Relative standard uncertainty of the sensitivity.
    pub uncertainty: Option<f64>,
    /// Full scale in SI units.
    pub range: Option<f64>,
}

/// A laboratory's calibration file: its sensors, in the tables `[[channel]]` of a plan.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationFile {
    /// The sensors.
    pub channel: Vec<Spanned<SensorPlan>>,
}

impl CalibrationFile {
    /// Reads one; errors call the text `source_name`.
    ///
    /// # Errors
    /// The text is not a calibration file, or a value of a sensor is impossible.
    pub fn parse(text: &str, source_name: &str) -> Result<Self, PlanError> {
        read(text, source_name, |file: &Self, faults| check_sensors(&file.channel, faults)).map_err(first)
    }
}

/// Records the errors of all sensors.
pub(super) fn check_sensors(channels: &[Spanned<SensorPlan>], faults: &mut Faults) {
    let mut seen = HashSet::new();
    for channel in channels {
        let (at, sensor) = (channel.span().start, channel.get_ref());
        let name = &sensor.name;
        let positive = |value: Option<f64>| value.is_none_or(|value| value > 0.0 && value.is_finite());
        let what = if !seen.insert(name) {
            format!("channel: `{name}` stands twice")
        } else if !positive(sensor.sensitivity_v) || !positive(sensor.range) {
            format!("channel `{name}`: sensitivity_v and range must be over 0 (the sign is its polarity)")
        } else if sensor.polarity.is_some_and(|sign| sign.abs() != 1) {
            format!("channel `{name}`: polarity must be 1 or -1")
        } else if sensor.delay_s.is_some_and(|delay_s| !(0.0..=1.0).contains(&delay_s)) {
            format!("channel `{name}`: delay_s must be 0 to 1 s")
        } else if sensor.uncertainty.is_some_and(|part| !(0.0..1.0).contains(&part)) {
            format!("channel `{name}`: uncertainty is relative: 0.01 stands for 1 %")
        } else if sensor.calibrated.as_ref().is_some_and(|date| date.parse::<jiff::civil::Date>().is_err()) {
            format!("channel `{name}`: calibrated must be a date, YYYY-MM-DD")
        } else {
            continue;
        };
        faults.unless(false, at, what);
    }
}

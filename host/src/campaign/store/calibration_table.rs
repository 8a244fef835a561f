//! Calibrations in the campaign file: sensor data that a person entered after the device and the
//! plan had defined them.
//!
//! Raw codes, and the scales that a session was measured with, stay unchanged. A calibration is a
//! separate row; for each property of a channel the latest value applies, in every session from the
//! stated one onwards.

use std::cmp::max;

use jointrig_protocol::channel::Channel;
use serde::{Deserialize, Serialize};

use super::Store;
use super::error::StoreError;
use super::notes::utc_now;
use super::table::{Row, table};
use crate::campaign::plan::SensorPlan;
use crate::device::channels::ChannelMap;

table! {
    /// New calibration of a channel's sensor; `None` leaves a property unchanged.
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct Calibration {
        "calibrations" {
            "id INTEGER PRIMARY KEY",
            /// When it was entered, RFC 3339.
            utc: String = "utc TEXT NOT NULL",
            /// The first session for which it applies.
            from_session: i64 = "from_session INTEGER NOT NULL",
            /// The channel's name.
            channel: String = "channel TEXT NOT NULL",
            /// V per SI unit, without sign.
            sensitivity_v: Option<f64> = "sensitivity_v REAL",
            /// 1 or -1.
            polarity: Option<i64> = "polarity INTEGER",
            /// Delay of the signal, s.
            delay_s: Option<f64> = "delay_s REAL",
            /// Relative standard uncertainty of the sensitivity.
            uncertainty: Option<f64> = "uncertainty REAL",
            /// The sensor's model.
            model: Option<String> = "model TEXT",
            /// Its serial number.
            serial: Option<String> = "serial TEXT",
            /// When it was calibrated, YYYY-MM-DD.
            calibrated: Option<String> = "calibrated TEXT",
            /// Why it was entered.
            reason: String = "reason TEXT NOT NULL",
        }
    }
}

impl Calibration {
    /// The properties stated for a sensor; time, reason and first session are left empty.
    pub fn of_sensor(sensor: &SensorPlan) -> Self {
        Self {
            utc: String::new(),
            from_session: 0,
            channel: sensor.name.clone(),
            sensitivity_v: sensor.sensitivity_v,
            polarity: sensor.polarity.map(i64::from),
            delay_s: sensor.delay_s,
            uncertainty: sensor.uncertainty,
            model: sensor.model.clone(),
            serial: sensor.serial.clone(),
            calibrated: sensor.calibrated.clone(),
            reason: String::new(),
        }
    }

    /// Applies this calibration to a channel.
    pub fn apply(&self, channel: &mut Channel) {
        if self.sensitivity_v.is_some() || self.polarity.is_some() {
            let now = f64::from(channel.units_per_volt);
            let sign = self.polarity.map_or(now.signum(), |polarity| polarity as f64);
            channel.units_per_volt = (sign * self.sensitivity_v.map_or(now.abs(), f64::recip)) as f32;
        }
        if let Some(delay_s) = self.delay_s {
            // at most 1 s, in whole nanoseconds
            channel.delay_ns = (delay_s * 1e9).round() as u32;
        }
    }
}

/// Applies the calibrations that are valid for a session to its channels.
pub fn apply_all(calibrations: &[Calibration], session: i64, map: &mut ChannelMap) {
    for calibration in calibrations.iter().filter(|own| own.from_session <= session) {
        // samples in SI units come from no known voltage
        let own =
            |channel: &&mut Channel| channel.name == calibration.channel.as_str() && channel.range_v > 0.0;
        if let Some(channel) = map.channels.iter_mut().find(own) {
            calibration.apply(channel);
        }
    }
}

impl Store {
    /// Enters calibrations for every session from `from_session` onwards. Results are computed with
    /// them from then on; verdicts stay as they were given.
    pub fn calibrate(
        &self,
        sensors: &[SensorPlan],
        from_session: i64,
        reason: &str,
    ) -> Result<(), StoreError> {
        self.change("entering calibrations", |connection| {
            for sensor in sensors {
                let row = Calibration {
                    utc: utc_now(),
                    from_session,
                    reason: reason.to_owned(),
                    ..Calibration::of_sensor(sensor)
                };
                row.insert(connection, &[])?;
            }
            Ok(())
        })
    }

    /// Every calibration, in the order of entry.
    pub fn calibrations(&self) -> Result<Vec<Calibration>, StoreError> {
        let there = self.connection.table_exists(None, "calibrations");
        if !there.map_err(self.failed("looking for calibrations"))? {
            return Ok(Vec::new());
        }
        let sql = format!("SELECT {} FROM calibrations ORDER BY id", Calibration::list());
        self.all(&sql, [], Calibration::read, "reading calibrations")
    }

    /// The channels of a session with all calibrations entered so far.
    pub fn calibrated(&self, session: i64, mut map: ChannelMap) -> Result<ChannelMap, StoreError> {
        apply_all(&self.calibrations()?, session, &mut map);
        Ok(map)
    }

    /// The id that the next session will have.
    pub fn next_session(&self) -> Result<i64, StoreError> {
        Ok(self.sessions()?.iter().fold(0, |last, (id, _)| max(last, *id)) + 1)
    }
}

//! Provenance of a result: file, records, settings, software, link.

use serde::Serialize;
use std::collections::BTreeMap;

/// [`Source::kind`] of a single time record.
pub const RECORD: &str = "record";

/// The setting of a [`RECORD`] which states that its signals are not those of the contact itself:
/// the slope of its loops then includes everything between the measured points.
pub const BESIDE_THE_CONTACT: &str = "measured";

/// Provenance: enough to compute the same result again from the campaign file alone.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Source {
    /// The file analysed (its name without the folder).
    pub file: String,
    /// What was analysed: `campaign`, `frf` or `record`.
    pub kind: String,
    /// Whether the device was simulated.
    pub simulated: bool,
    /// The software that computed the results.
    pub software: Software,
    /// When the campaign was started according to its file, RFC 3339.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub started: Option<String>,
    /// The device's self-description: name, firmware, schema.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub device: BTreeMap<String, String>,
    /// Calibrations entered in addition to those of device and plan, in the order of entry; the
    /// last one of a channel applies.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub calibrations: Vec<Calibrated>,
    /// Evidence of each change of structure that was accepted.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub structure_changes: Vec<String>,
    /// The specimen's temperature measured by the controller: minimum, mean and maximum over all
    /// sessions, °C.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<[f64; 3]>,
    /// Settings of the analysis, by name with unit: windows, lines, virtual points.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub settings: BTreeMap<String, serde_json::Value>,
    /// Ids of the records used, per configuration, as closed ranges.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub records: BTreeMap<String, Vec<[i64; 2]>>,
    /// Counters of the link between device and host over the whole campaign.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub link: BTreeMap<String, u64>,
}

/// A change of a channel's calibration.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibrated {
    /// When it was entered, RFC 3339.
    pub utc: String,
    /// The first session to which it applies.
    pub from_session: i64,
    /// The channel.
    pub channel: String,
    /// The unit of the measured quantity.
    pub unit: String,
    /// Sensitivity before and after, V per unit, with the sign.
    pub sensitivity_v: [f64; 2],
    /// Delay before and after, s.
    pub delay_s: [f64; 2],
    /// Relative standard uncertainty of the sensitivity.
    pub uncertainty: Option<f64>,
    /// The sensor: model, serial number, date of calibration, if stated.
    pub sensor: Vec<String>,
    /// Why it was entered.
    pub reason: String,
}

/// A program and its version.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Software {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
}

impl Default for Software {
    /// Describes this program.
    fn default() -> Self {
        Software { name: "jointrig".into(), version: env!("CARGO_PKG_VERSION").into() }
    }
}

/// Ids as closed ranges: 1, 2, 3, 7 becomes 1…3, 7…7. The ids need not be sorted.
pub fn ranges(ids: impl IntoIterator<Item = i64>) -> Vec<[i64; 2]> {
    let mut ids: Vec<i64> = ids.into_iter().collect();
    ids.sort_unstable();
    ids.dedup();
    let mut ranges: Vec<[i64; 2]> = Vec::new();
    for id in ids {
        match ranges.last_mut() {
            Some(last) if last[1].checked_add(1) == Some(id) => last[1] = id,
            _ => ranges.push([id, id]),
        }
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_become_closed_ranges() {
        assert_eq!(ranges([3, 1, 2, 7, 7, i64::MAX]), [[1, 3], [7, 7], [i64::MAX, i64::MAX]]);
        assert!(ranges([]).is_empty());
    }
}

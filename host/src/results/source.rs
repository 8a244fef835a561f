//! Where a result comes from: file, records, settings, software, link.

use serde::Serialize;
use std::collections::BTreeMap;

/// Provenance: enough to compute the same result again from the campaign file alone.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Source {
    /// The file analysed (its name, not the folder it happened to lie in).
    pub file: String,
    /// What was analysed: `campaign`, `frf` or `record`.
    pub kind: String,
    /// Whether the device was simulated.
    pub simulated: bool,
    /// The software that computed this.
    pub software: Software,
    /// When the campaign was begun, as its file says, RFC 3339.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub started: Option<String>,
    /// The device as it named itself: name, firmware, schema.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub device: BTreeMap<String, String>,
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

/// A program and its version.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Software {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
}

impl Default for Software {
    /// This program.
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

//! Provenance of the results: the information in the file, and how the analysis used its records.

use crate::analyse::Findings;
use crate::results::{Source, ranges};
use serde_json::{Map, json};

/// The source in the findings, with the settings of the analysis and the records used.
pub fn source(found: &Findings) -> Source {
    let mut source = found.source.clone();
    let settings = &mut source.settings;
    if let Some(of_records) = &found.settings {
        let window = of_records.windowing;
        settings.insert("exponential_window_per_s".into(), window.sigma_per_s.into());
        settings.insert("force_window_s".into(), json!([-window.force_before_s, window.force_after_s]));
        settings.insert("estimator".into(), "H1 on s = σ + iω".into());
        settings.insert("lines_hz".into(), json!(of_records.lines_hz));
    }
    let mut imported = Map::new();
    for measured in &found.configurations {
        let records = ranges(measured.records.iter().copied());
        if !records.is_empty() {
            source.records.insert(measured.configuration.into(), records);
        }
        if let Some(from) = &measured.imported {
            let about = json!({ "file": from.file, "imported": from.utc, "variance": from.with_variance });
            imported.insert(measured.configuration.into(), about);
        }
    }
    if !imported.is_empty() {
        settings.insert("imported_frf".into(), imported.into());
    }
    if let Some(priors) = &found.priors {
        settings.insert("priors".into(), json!(priors));
    }
    source
}

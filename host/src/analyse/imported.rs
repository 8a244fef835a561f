//! FRFs that were measured elsewhere stand in for a configuration that was not measured here.

use super::cell::Measurements;
use crate::campaign::frfs::ImportedFrf;
use crate::results::Results;
use serde_json::{Map, json};

/// The imported FRFs of a configuration that has no averaged cell, noted as a source of the results. Where hits were measured
/// too, these count, and the results say so.
pub fn of<M: Measurements>(
    measurements: &M,
    results: &mut Results,
    name: &str,
    cells: usize,
) -> Option<ImportedFrf> {
    let found = match measurements.imported(name) {
        Ok(found) => found?,
        Err(error) => {
            results.missing.push(format!("{name}: {error}."));
            return None;
        }
    };
    if cells > 0 {
        results.missing.push(format!(
            "{name}: the FRFs imported from {} are not used, because {cells} cells have hits of their own.",
            found.source
        ));
        return None;
    }
    let about = json!({ "file": found.source, "imported": found.utc, "variance": found.noise.is_some() });
    let settings = &mut results.source.settings;
    let imported = settings.entry("imported_frf".into()).or_insert_with(|| Map::new().into());
    if let Some(imported) = imported.as_object_mut() {
        imported.insert(name.into(), about);
    }
    Some(found)
}

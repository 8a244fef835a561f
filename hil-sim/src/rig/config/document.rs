//! From TOML text to a checked configuration, with line numbers in the errors.

use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{DEFAULT_TOML, RigConfig};
use crate::rig::RigError;

/// Fields that a user-defined structure replaces.
pub(super) const PAPERS_OWN: [&str; 8] =
    ["bodies", "leaf_springs", "knife_edge", "wire", "push_rod_a", "clamp", "clamp_b", "lower_push_rod"];

/// Merges `text` into the default and checks the result.
pub fn read(text: &str) -> Result<RigConfig, RigError> {
    let user = DeTable::parse(text).map_err(|error| document_error(&error, text))?;
    let mut merged =
        DeTable::parse(DEFAULT_TOML).expect("rigs/default.toml is TOML: it is embedded and a test reads it");
    merge(merged.get_mut(), user.get_ref().clone());
    if user.get_ref().contains_key("structure")
        && let Some(field) = PAPERS_OWN.into_iter().find(|field| user.get_ref().contains_key(*field))
    {
        let line = locate(user.get_ref(), field).map(|offset| line_of(text, offset));
        let reason = "describes the paper's rig, and [structure] another one: remove one of them".to_owned();
        return Err(RigError::Field { field: field.to_owned(), reason, line });
    }
    // Only the user's text can be wrong here, so every span refers to it.
    let config = RigConfig::deserialize(toml::Deserializer::from(merged))
        .map_err(|error| document_error(&error, text))?;
    config.check().map_err(|error| match error {
        RigError::Field { field, reason, .. } => {
            let line = locate(user.get_ref(), &field).map(|offset| line_of(text, offset));
            RigError::Field { field, reason, line }
        }
        other => other,
    })?;
    Ok(config)
}

fn merge<'i>(base: &mut DeTable<'i>, over: DeTable<'i>) {
    // A body's inertia has two forms; the one stated by the user replaces the other.
    for (stated, replaced) in [("box_m", "inertia_kg_m2"), ("inertia_kg_m2", "box_m")] {
        if over.contains_key(stated) {
            base.remove(replaced);
        }
    }
    for (key, value) in over {
        let name: &str = key.get_ref();
        if let (Some(DeValue::Table(below)), DeValue::Table(inner)) =
            (base.get_mut(name).map(Spanned::get_mut), value.get_ref())
        {
            merge(below, inner.clone());
        } else {
            // Removed first: inserting over an equal key would keep the old key, and with it the
            // default's span.
            base.remove(name);
            base.insert(key, value);
        }
    }
}

fn document_error(error: &toml::de::Error, text: &str) -> RigError {
    let line = error.span().map(|span| line_of(text, span.start));
    RigError::Document { line, reason: error.message().trim().replace('\n', ", ") }
}

fn line_of(text: &str, offset: usize) -> usize {
    text.bytes().take(offset).filter(|byte| *byte == b'\n').count() + 1
}

/// Byte offset at which the user's document sets `path` (as `bodies.mass.mass_kg` or
/// `impacts[3].name`), or the nearest table around it that the document has.
fn locate(table: &DeTable<'_>, path: &str) -> Option<usize> {
    let (head, rest) = path.split_once('.').map_or((path, None), |(head, rest)| (head, Some(rest)));
    let (name, index) = match head.split_once('[') {
        Some((name, index)) => (name, index.trim_end_matches(']').parse::<usize>().ok()),
        None => (head, None),
    };
    let mut value = table.get(name)?;
    let mut offset = value.span().start;
    if let (Some(index), DeValue::Array(items)) = (index, value.get_ref()) {
        value = items.get(index)?;
        offset = value.span().start;
    }
    match (rest, value.get_ref()) {
        (Some(rest), DeValue::Table(inner)) => locate(inner, rest).or(Some(offset)),
        _ => Some(offset),
    }
}

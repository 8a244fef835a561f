//! What a plan states that can be measured again after the hits: places, directions, and what is
//! known beforehand, with its uncertainty.

use std::collections::BTreeMap;
use toml::{Table, Value};

/// Tables of what is known beside the hits.
const KNOWN: [&str; 4] = ["contact", "known_mass", "priors", "specimens"];

/// Lists of the geometry whose entries have a place.
const PLACED: [&str; 3] = ["impact", "response", "sensor"];

/// What may be measured again of such an entry.
const MEASURED: [&str; 5] = ["axes", "direction", "mass_g", "position_m", "sigma_m"];

/// Values of a plan by where they stand: names of tables, the name or number of a list's entry, and
/// the value's own name.
type Values = BTreeMap<Vec<String>, Value>;

/// What the plan `new` states differently from `old`, a sentence each.
///
/// # Errors
/// They differ in something that decides which hits were made, which is named; or in nothing.
pub fn measured_again(old: &str, new: &str) -> Result<Vec<String>, String> {
    let (old, new) = (values(old)?, values(new)?);
    let mut places: Vec<&Vec<String>> = old.keys().chain(new.keys()).collect();
    places.sort();
    places.dedup();
    let mut said = Vec::new();
    for place in places {
        let (was, is) = (old.get(place), new.get(place));
        if was == is {
            continue;
        }
        let name = place.join(".");
        if !may_change(place, was, is) {
            return Err(format!(
                "`{name}` is not what was measured again: only places, directions, [{}] may differ from the file's plan here; what is still to \
                 be measured changes with `campaign run --plan`",
                KNOWN.join("], [")
            ));
        }
        let shown = |value: Option<&Value>| value.map_or_else(|| "not stated".into(), Value::to_string);
        said.push(format!("{name}: {}, was {}", shown(is), shown(was)));
    }
    if said.is_empty() { Err("it states nothing else than the file's plan".into()) } else { Ok(said) }
}

fn may_change(place: &[String], was: Option<&Value>, is: Option<&Value>) -> bool {
    let entries = |value: Option<&Value>| value.and_then(Value::as_array).map(Vec::len);
    match place.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [table, ..] if KNOWN.contains(&table) => true,
        ["geometry", "virtual_point_m"] => true,
        // another number of axes is another number of channels
        ["geometry", list, _, "axes"] if PLACED.contains(&list) => entries(was) == entries(is),
        ["geometry", list, _, value] => PLACED.contains(&list) && MEASURED.contains(&value),
        _ => false,
    }
}

fn values(text: &str) -> Result<Values, String> {
    let table: Table = toml::from_str(text).map_err(|error| error.message().to_owned())?;
    let mut found = Values::new();
    collect(&mut Vec::new(), &Value::Table(table), &mut found);
    Ok(found)
}

fn collect(at: &mut Vec<String>, value: &Value, found: &mut Values) {
    let inner: Vec<(String, &Value)> = match value {
        Value::Table(table) => table.iter().map(|(name, value)| (name.clone(), value)).collect(),
        Value::Array(entries) if entries.iter().any(Value::is_table) => {
            let name = |value: &Value| value.get("name").and_then(Value::as_str).map(str::to_owned);
            // a configuration may have several blocks
            let all: Vec<Option<String>> = entries.iter().map(name).collect();
            let unique = |own: &Option<String>| all.iter().filter(|other| *other == own).count() == 1;
            let entry = |(place, own): (usize, &Option<String>)| {
                own.clone().filter(|_| unique(own)).unwrap_or_else(|| (place + 1).to_string())
            };
            all.iter().enumerate().map(entry).zip(entries).collect()
        }
        _ => {
            found.insert(at.clone(), value.clone());
            return;
        }
    };
    for (name, value) in inner {
        at.push(name);
        collect(at, value, found);
        at.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::measured_again;
    use crate::campaign::plan::{CONTACT, PAPER};

    /// The plan with one text replaced by another.
    fn with(from: &str, to: &str) -> String {
        assert_eq!(CONTACT.matches(from).count(), 1, "{from}");
        CONTACT.replace(from, to)
    }

    #[test]
    fn places_and_what_is_known_may_be_measured_again() {
        let moved = with("[-0.007, 0.001, 0.007]", "[-0.0058, 0.001, 0.007]") + "\n[priors]\nspot_m = 1e-4\n";
        let said = measured_again(CONTACT, &moved).expect("both are places");
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(said[0].starts_with("geometry.response.C1.position_m: [-0.0058, 0.001, 0.007], was [-0.007"));
        assert_eq!(said[1], "priors.spot_m: 0.0001, was not stated");
    }

    #[test]
    fn what_was_struck_stays() {
        for (from, to, named) in [
            ("wanted = 6", "wanted = 7", "hits.wanted"),
            ("target_n = 50.0", "target_n = 40.0", "force.target_n"),
            ("\"BX3\"]", "\"BX2\"]", "configuration.1.impacts"),
            (
                "{ name = \"C1\", grouping = 5",
                "{ name = \"C1\", grouping = 6",
                "geometry.response.C1.grouping",
            ),
            ("{ name = \"I_MZ\"", "{ name = \"I_M\"", "geometry.impact.I_M.grouping"),
        ] {
            let refused = measured_again(CONTACT, &with(from, to)).expect_err(named);
            assert!(refused.starts_with(&format!("`{named}`")), "{refused}");
        }
        assert!(measured_again(CONTACT, PAPER).is_err());
        assert!(measured_again(CONTACT, CONTACT).expect_err("nothing").contains("nothing else"));
    }
}

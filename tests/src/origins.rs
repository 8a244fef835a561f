//! Checks that the numbers shown in the report are in `results.json`, at the paths that the report
//! states.

use serde_json::Value;

/// All numbers at a path in which `*` matches any key or index, in order; NaN for a value that is
/// not a number.
#[must_use]
pub fn numbers(value: &Value, path: &str) -> Vec<f64> {
    let Some(rest) = path.strip_prefix('/') else { return vec![value.as_f64().unwrap_or(f64::NAN)] };
    let (head, tail) = rest.split_once('/').map_or((rest, ""), |(head, _)| (head, &rest[head.len()..]));
    match (value, head) {
        (Value::Array(all), "*") => all.iter().flat_map(|v| numbers(v, tail)).collect(),
        (Value::Object(all), "*") => all.values().flat_map(|v| numbers(v, tail)).collect(),
        (Value::Array(all), index) => {
            index.parse::<usize>().ok().and_then(|i| all.get(i)).map_or_else(Vec::new, |v| numbers(v, tail))
        }
        (Value::Object(all), key) => all.get(key).map_or_else(Vec::new, |v| numbers(v, tail)),
        _ => Vec::new(),
    }
}

/// The numbers that a list of a mark may contain: the values at its path, combined with the second
/// number, in its unit.
///
/// # Panics
/// When the path does not exist, or the number of second values differs.
#[must_use]
pub fn allowed(results: &Value, origin: &Value) -> Vec<f64> {
    let path = origin["path"].as_str().unwrap();
    let mut known = numbers(results, path);
    assert!(!known.is_empty(), "nothing at {path}");
    if let Some(second) = origin.get("with") {
        let path = second["path"].as_str().unwrap();
        let others = numbers(results, path);
        assert_eq!(known.len(), others.len(), "{path}");
        let how = second["how"].as_str().unwrap();
        for (one, other) in known.iter_mut().zip(others) {
            *one = match how {
                "plus" => *one + other,
                "minus" => *one - other,
                "times" => *one * other,
                "per" => *one / other,
                other => panic!("{other}"),
            };
        }
    }
    let factor = origin["factor"].as_f64().unwrap();
    for k in &mut known {
        *k *= factor;
    }
    known.sort_by(f64::total_cmp);
    known
}

/// Whether a six-digit number is among these sorted ones.
#[must_use]
pub fn among(known: &[f64], value: f64) -> bool {
    // six digits stored as f32: half of the sixth digit, which is at most 5e-6 (at 1.00000), plus
    // the f32 rounding
    let near = |k: &f64| (k - value).abs() <= 6e-6 * value.abs().max(1e-30);
    let at = known.partition_point(|k| *k < value);
    known[at.saturating_sub(1)..known.len().min(at + 2)].iter().any(near)
}

/// The numbers in a text: each with the value shown, and its number of decimals.
#[must_use]
pub fn shown(text: &str) -> Vec<(f64, usize)> {
    // thousands are separated by a thin space; word joiners keep a number with what follows it
    let text = text.replace('−', "-").replace(['\u{202f}', '\u{2060}'], "");
    let mut found = Vec::new();
    let mut rest = text.as_str();
    let mut before = ' ';
    while let Some(c) = rest.chars().next() {
        let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        if !c.is_ascii_digit() || before.is_alphanumeric() {
            before = c;
            rest = &rest[c.len_utf8()..];
            continue;
        }
        let number = rest[..end].trim_end_matches('.');
        let places = number.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        found.push((number.parse().unwrap(), places));
        before = '0';
        rest = &rest[end..];
    }
    found
}

/// Whether `value` is `number` in some unit, to the decimals shown.
#[must_use]
pub fn agrees(value: f64, (number, places): (f64, usize)) -> bool {
    let half: f64 = format!("0.5001e-{places}").parse().unwrap();
    [1.0, 1e-6, 1e6, 1e-3, 100.0].into_iter().any(|factor| (value.abs() * factor - number).abs() <= half)
}

/// Compares every number in a figure's csv file with the data of the figure's marks; returns the
/// count of numbers.
///
/// # Panics
/// When a number is not found.
pub fn hold_csv(results: &Value, figure: &Value, csv: &str) -> usize {
    let name = figure["name"].as_str().unwrap();
    let mut lines = csv::Reader::from_reader(csv.as_bytes());
    let marks: Vec<Held> = figure["panels"]
        .as_array()
        .unwrap()
        .iter()
        .enumerate()
        .flat_map(|(i, panel)| {
            panel["marks"].as_array().unwrap().iter().map(move |mark| Held::of(results, panel, i, mark))
        })
        .collect();
    let mut count = 0;
    for line in lines.records().map(Result::unwrap) {
        let own: Vec<&Held> = marks.iter().filter(|m| m.writes(&line[0], &line[1])).collect();
        assert!(!own.is_empty(), "{name}: nobody wrote {line:?}");
        for (column, of) in [(3, "x"), (5, "y"), (6, "low"), (7, "high")] {
            let Ok(value) = line[column].parse::<f64>() else {
                assert!(line[column].is_empty() || own.iter().any(|m| m.named(of)), "{name}: {line:?}");
                continue;
            };
            assert!(own.iter().any(|m| m.holds(of, value)), "{name}: {value} ({of}) of {line:?}");
            count += 1;
        }
    }
    count
}

/// The values that a mark's lists may contain.
struct Held {
    panel: String,
    name: String,
    /// Whether its curves are named after its rows.
    rows: bool,
    scene: bool,
    /// Whether x is a fraction of a cycle, which is not a result.
    share: bool,
    names: [bool; 2],
    lists: Vec<(String, Vec<f64>)>,
}

impl Held {
    fn of(results: &Value, panel: &Value, index: usize, mark: &Value) -> Self {
        let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
        let title = text(&panel["title"]);
        let name = text(&mark["name"]);
        let origins = mark["origin"].as_array().into_iter().flatten();
        Held {
            panel: if title.is_empty() { (index + 1).to_string() } else { title },
            name: if name.is_empty() { text(&mark["role"]) } else { name },
            rows: mark.get("strips").is_some(),
            scene: mark.get("scene").is_some(),
            share: panel["x"]["link"] == "cycle",
            names: ["x", "y"].map(|axis| panel[axis].get("names").is_some()),
            lists: origins.map(|o| (text(&o["of"]), allowed(results, o))).collect(),
        }
    }

    fn writes(&self, panel: &str, curve: &str) -> bool {
        // names that a spreadsheet would take for a formula are prefixed with an apostrophe
        let same = |a: &str, b: &str| a == b.trim_start_matches('\'');
        self.scene || same(&self.panel, panel) && (self.rows || same(&self.name, curve))
    }

    fn named(&self, of: &str) -> bool {
        matches!((of, self.names), ("x", [true, _]) | ("y", [_, true]))
    }

    fn holds(&self, of: &str, value: f64) -> bool {
        let list = |of: &str| self.lists.iter().find(|(list, _)| list == of).map(|(_, known)| known);
        let found = |of: &str| list(of).is_some_and(|known| among(known, value));
        // an index into values that are not numbers
        let index = list("x").is_some_and(|known| {
            of == "x" && known[0].is_nan() && value.fract() == 0.0 && (value as usize) < known.len()
        });
        let step = list("step").is_some_and(|step| {
            let first = list("first").map_or(0.0, |first| first[0]);
            let steps = (value - first) / step[0];
            // tolerance: the sixth digit of the value, in steps
            of == "x" && (steps - steps.round()).abs() <= 1e-3 + 1e-5 * steps.abs()
        });
        let share = of == "x" && self.share && (0.0..=1.0).contains(&value);
        // the height of a level, positions in space, and the values of a matrix or of strips
        let other = of != "high" && (found("at") || found("values"));
        self.named(of) || found(of) || index || step || share || other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_they_are_shown() {
        assert_eq!(shown("k_T: 26.8 ± 0.9 N/µm, A3:z 0.40"), [(26.8, 1), (0.9, 1), (0.40, 2)]);
        assert!(agrees(26.84e6, (26.8, 1)) && !agrees(26.9e6, (26.8, 1)));
    }

    #[test]
    fn a_number_that_stands_nowhere_is_found_out() {
        let results = serde_json::json!({ "a": [{ "mean": 2e6, "std": 5e5 }, { "mean": 3e6, "std": 1e5 }] });
        let with = serde_json::json!({ "how": "plus", "path": "/a/*/std" });
        let origin = serde_json::json!({ "of": "high", "path": "/a/*/mean", "factor": 1e-6, "with": with });
        let known = allowed(&results, &origin);
        assert!(among(&known, 2.5) && among(&known, 3.1) && !among(&known, 2.1));
    }
}

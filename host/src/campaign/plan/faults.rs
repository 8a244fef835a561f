//! All errors of a plan, in the order in which they occur in the text.

use serde::de::DeserializeOwned;

use super::too_many;
use super::{Plan, PlanError, field};

/// Maximum number of unknown fields reported together: with more, it is another kind of file.
const MOST_UNKNOWN: usize = 50;

/// Error messages, each with its position in the text.
#[derive(Debug, Default)]
pub(super) struct Faults(Vec<(usize, String)>);

impl Faults {
    /// Records an error unless `good`.
    pub fn unless(&mut self, good: bool, at: usize, what: impl Into<String>) {
        if !good {
            self.0.push((at, what.into()));
        }
    }

    /// Sorted by position, as errors of the text called `source_name`.
    fn told(mut self, text: &str, source_name: &str) -> Vec<PlanError> {
        self.0.sort_by_key(|(at, _)| *at);
        let error = |(at, what): (usize, String)| PlanError {
            source_name: source_name.into(),
            line: 1 + text.get(..at).unwrap_or(text).matches('\n').count(),
            what,
            more: 0,
        };
        self.0.into_iter().map(error).collect()
    }
}

impl Plan {
    /// Reads the plan of an existing campaign: a plan that was accepted once is not refused when
    /// its file is reopened. Errors call the text `source_name`.
    ///
    /// # Errors
    /// The first error, with line and field.
    pub fn parse(text: &str, source_name: &str) -> Result<Self, PlanError> {
        few_cells(text, source_name)?;
        read(text, source_name, Self::check).map(Self::with_usual_names).map_err(first)
    }

    /// Reads a plan for a new campaign: its values must also be plausible.
    ///
    /// # Errors
    /// The first error, with line and field, and the number of further ones.
    pub fn parse_new(text: &str, source_name: &str) -> Result<Self, PlanError> {
        Self::parse_all(text, source_name).map_err(first)
    }

    /// As [`Plan::parse_new`].
    ///
    /// # Errors
    /// All errors. A value of the wrong type or a missing field prevents the checks that follow
    /// parsing.
    pub fn parse_all(text: &str, source_name: &str) -> Result<Self, Vec<PlanError>> {
        few_cells(text, source_name).map_err(|error| vec![error])?;
        read(text, source_name, |plan: &Self, faults| {
            plan.check(faults);
            plan.check_sense(faults);
        })
        .map(Self::with_usual_names)
    }
}

fn few_cells(text: &str, source_name: &str) -> Result<(), PlanError> {
    let mut faults = Faults::default();
    if let Some((at, what)) = too_many(text) {
        faults.unless(false, at, what);
    }
    faults.told(text, source_name).pop().map_or(Ok(()), Err)
}

/// Parses a TOML document and checks it.
///
/// # Errors
/// All errors.
pub(super) fn read<T: DeserializeOwned>(
    text: &str,
    source_name: &str,
    check: impl FnOnce(&T, &mut Faults),
) -> Result<T, Vec<PlanError>> {
    let mut faults = Faults::default();
    let mut readable = text.to_owned();
    let document = loop {
        match toml::from_str::<T>(&readable) {
            Ok(document) => break Some(document),
            Err(wrong) => {
                let at = wrong.span().map_or(0, |span| span.start);
                // a field reported as missing after an unknown one is probably that one misspelt:
                // report it once
                let misspelt = wrong.message().starts_with("missing field") && !faults.0.is_empty();
                faults.unless(misspelt, at, field(text, &wrong));
                let unknown = wrong.message().starts_with("unknown field");
                if !unknown || faults.0.len() > MOST_UNKNOWN || !blank_line(&mut readable, at) {
                    break None;
                }
            }
        }
    };
    if let Some(document) = &document {
        check(document, &mut faults);
    }
    match document {
        Some(document) if faults.0.is_empty() => Ok(document),
        _ => Err(faults.told(text, source_name)),
    }
}

/// Blanks the line at `at` if it holds one key and its value, so that parsing can continue after
/// it. Returns whether it did.
fn blank_line(text: &mut String, at: usize) -> bool {
    let from = text[..at].rfind('\n').map_or(0, |end| end + 1);
    let to = text[at..].find('\n').map_or(text.len(), |length| at + length);
    let line = &text[from..to];
    // a point written as an inline table must not be blanked as a whole because of one field
    let alone = line.split_once('=').is_some_and(|(key, _)| !key.contains(['{', '[', '#']));
    if alone {
        let spaces = " ".repeat(line.len());
        text.replace_range(from..to, &spaces);
    }
    alone
}

/// The first error, with the number of further ones.
pub(super) fn first(mut all: Vec<PlanError>) -> PlanError {
    let more = all.len() - 1;
    let mut first = all.swap_remove(0);
    first.more = more;
    first
}

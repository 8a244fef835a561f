//! What the user states about the places of hits: a table, for sessions that deviate from the plan's
//! order in a way that the recording does not show.

use serde::Deserialize;

use super::Place;
use super::places::{Named, Visit};
use crate::campaign::plan::{Plan, configuration_name};
use crate::exchange::delimiter;

/// The table's columns, for messages.
const COLUMNS: &str = "a table of places has the columns hit (a number, or a range such as 33-40) or time_s (from this time on, until the \
                       next row's), and configuration, impact, response (all three empty: not at a place)";

/// A row of the table.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlaceRow {
    #[serde(default)]
    hit: String,
    #[serde(default)]
    time_s: String,
    #[serde(default)]
    configuration: String,
    #[serde(default)]
    impact: String,
    #[serde(default)]
    response: String,
}

/// The only place that a row's names fit.
fn place_of(row: &PlaceRow, plan: &Plan, places: &[Place]) -> Result<Named, String> {
    let PlaceRow { configuration, impact, response, .. } = row;
    if [configuration, impact, response].into_iter().all(String::is_empty) {
        return Ok(Named::Nowhere);
    }
    let own = plan.configuration(configuration);
    let fits = |place: &&Place| {
        (configuration.is_empty() || own == Some(place.cell.configuration))
            && (impact.is_empty() || *impact == place.cell.impact)
            && (response.is_empty() || place.responses.contains(response))
    };
    let found: Vec<usize> =
        places.iter().enumerate().filter(|(_, place)| fits(place)).map(|(number, _)| number).collect();
    let written = format!("{configuration}/{impact}/{response}");
    match found.as_slice() {
        [one] => Ok(Named::Place(*one)),
        [] => Err(format!(
            "{written} is no place of the plan that is cut into; its places begin with {}",
            places.iter().take(6).map(|place| place.name.as_str()).collect::<Vec<_>>().join(", ")
        )),
        several => Err(format!(
            "{written} may be {} or {}: give configuration, impact and response",
            places[several[0]].name, places[several[1]].name
        )),
    }
}

/// The hits of a number or a range, from 1, as indices.
fn hits_of(text: &str, hits: usize) -> Result<std::ops::Range<usize>, String> {
    let number = |text: &str| text.trim().parse::<usize>().ok().filter(|number| (1..=hits).contains(number));
    let (first, last) = text.split_once(['-', '–']).unwrap_or((text, text));
    match (number(first), number(last)) {
        (Some(first), Some(last)) if first <= last => Ok(first - 1..last),
        _ => Err(format!("`{text}` is no hit: the recording has hits 1 to {hits}, or a range such as 33-40")),
    }
}

/// What a table says of each hit, in order of time; `at_s` has the hits' times.
///
/// # Errors
/// The row that is wrong, and how to write it.
pub fn from_table(
    text: &str,
    plan: &Plan,
    places: &[Place],
    at_s: &[f64],
) -> Result<Vec<Option<Named>>, String> {
    let mut named: Vec<Option<Named>> = vec![None; at_s.len()];
    let mut rows = csv::ReaderBuilder::new()
        .delimiter(delimiter(text))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let mut from_time: Vec<(f64, Named)> = Vec::new();
    for (line, row) in (2..).zip(rows.deserialize::<PlaceRow>()) {
        let row = row.map_err(|error| format!("{error}; {COLUMNS}"))?;
        let wrong = |what: String| format!("line {line}: {what}");
        let place = place_of(&row, plan, places).map_err(wrong)?;
        match (row.hit.is_empty(), row.time_s.is_empty()) {
            (false, true) => {
                for hit in hits_of(&row.hit, at_s.len()).map_err(wrong)? {
                    if named[hit].is_some_and(|other| other != place) {
                        return Err(wrong(format!(
                            "hit {} is already at another place in the table",
                            hit + 1
                        )));
                    }
                    named[hit] = Some(place);
                }
            }
            (true, false) => {
                let time: f64 =
                    row.time_s.replace(',', ".").parse().ok().filter(|t: &f64| t.is_finite()).ok_or_else(
                        || wrong(format!("`{}` is no time in s from the recording's start", row.time_s)),
                    )?;
                if from_time.last().is_some_and(|(before, _)| *before >= time) {
                    return Err(wrong("times must increase".into()));
                }
                from_time.push((time, place));
            }
            _ => return Err(wrong(format!("it needs either hit or time_s; {COLUMNS}"))),
        }
    }
    for (hit, at) in at_s.iter().enumerate() {
        let last = from_time.iter().rev().find(|(time, _)| time <= at);
        named[hit] = named[hit].or(last.map(|(_, place)| *place));
    }
    if named.iter().all(Option::is_none) {
        return Err(format!("it names no hit of the recording; {COLUMNS}"));
    }
    Ok(named)
}

/// A table to be completed: a line for each stretch of hits, with the names of the places that are
/// certain.
pub fn to_complete(places: &[Place], stretches: &[Visit]) -> String {
    let line = |visit: &Visit| {
        let [first, last] = visit.hits;
        let hits =
            if first == last { format!("{}", first + 1) } else { format!("{}-{}", first + 1, last + 1) };
        match visit.place {
            None => format!("{hits},?,?,?\n"),
            Some(place) => {
                let cell = &places[place].cell;
                format!(
                    "{hits},{},{},{}\n",
                    configuration_name(cell.configuration),
                    cell.impact,
                    cell.response
                )
            }
        }
    };
    std::iter::once("hit,configuration,impact,response\n".to_owned())
        .chain(stretches.iter().map(line))
        .collect()
}

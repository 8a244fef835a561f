//! Sentences for data that were missing in an analysis.

use crate::analyse::{CellName, Missing};
use crate::results::rounded;
use crate::structure::Structure;

/// The sentence for one missing item.
pub fn sentence(missing: &Missing) -> String {
    match missing {
        Missing::Records { cell, told } => of_cell(cell, told),
        Missing::NoLoop { cell, record, error } => {
            of_cell(cell, &format!("record {record} gives no loop: {error}"))
        }
        Missing::GivenUp { configuration, response, impacts, planned, reason } => {
            let where_hit = match impacts.len() {
                n if n > 1 && n == *planned => format!("all {n} impacts"),
                n if n > 6 => format!("{n} of {planned} impacts"),
                _ => impacts.join(", "),
            };
            format!("{configuration}: {response} was given up for {where_hit}: {reason}.")
        }
        Missing::NotInPlan(configuration) => format!("{configuration} is not in the plan."),
        Missing::NotMeasured { configuration, planned } => {
            format!("{configuration} has not been measured: none of its {} has a kept hit.", cells(*planned))
        }
        Missing::CellsWithoutHit { configuration, absent, planned } => {
            format!("{configuration}: {absent} of {} without a kept hit.", cells(*planned))
        }
        Missing::SingleHits { configuration, cells: single } => {
            format!("{configuration}: {} with a single kept hit, of unknown coherence.", cells(*single))
        }
        Missing::ImpactsLeftOut { configuration, names } => left_out(*configuration, "impacts", names),
        Missing::ResponsesLeftOut { configuration, names } => {
            left_out(*configuration, "response locations", names)
        }
        Missing::ImportUnreadable { configuration, told } => format!("{configuration}: {told}."),
        Missing::ImportUnused { configuration, file, cells: own } => format!(
            "{configuration}: the FRFs imported from {file} are not used, because {} with measured hits take precedence.",
            cells(*own)
        ),
        Missing::OtherLines(cell) => {
            of_cell(cell, "the lines of its signals at the contact differ from those of the other cells, so they are not used")
        }
        Missing::Configurations(absent) => {
            let names: Vec<&str> = absent.iter().map(|structure| structure.name()).collect();
            format!("Substructuring needs A, B and AJB; missing: {}.", names.join(", "))
        }
        Missing::LinesLeftOut(left) => format!(
            "Only the {} lines from {} to {} Hz that A, B and AJB have in common are used: A has {} lines, B {}, AJB {}.",
            left.lines, rounded(left.low_hz, 7), rounded(left.high_hz, 7), left.of.a, left.of.b, left.of.ajb
        ),
        Missing::Substructuring(error) => format!("Substructuring was not possible: {error}."),
        Missing::Cmif(error) => format!("No CMIF: {error}."),
        Missing::Bootstrap(error) => format!("No bootstrap over hits: {error}."),
        Missing::Estimate(error) => format!("No estimate with an interval by Eq. A.1: {error}."),
        Missing::Level(told) => told.clone(),
        Missing::LevelLoop { level, error } => format!("Shaker, {level}: no loop: {error}."),
        Missing::EffectiveMass => {
            "No loops of the corrected force: the static arm's effective mass is not known. Hits on B alone give it, or stuck loops of the shaker at three \
             frequencies or more; or state it (--effective-mass KG)."
                .into()
        }
    }
}

/// `1 cell`, `12 cells`.
fn cells(count: usize) -> String {
    format!("{count} {}", if count == 1 { "cell" } else { "cells" })
}

/// Sentence for a configuration whose FRFs were imported.
pub fn imported(configuration: Structure, file: &str) -> String {
    format!(
        "{configuration}: its FRFs were imported from {file}: without hits there are no coherence and no loops."
    )
}

fn of_cell(cell: &CellName, what: &str) -> String {
    format!("{}: cell {} × {}: {what}.", cell.configuration, cell.impact, cell.response)
}

fn left_out(configuration: Structure, what: &str, names: &[String]) -> String {
    format!(
        "{configuration}: {what} left out of substructuring, because cells are missing: {}.",
        names.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_given_up_are_told_together() {
        let group = |response: &str, impacts: &[&str]| Missing::GivenUp {
            configuration: Structure::A,
            response: response.into(),
            impacts: impacts.iter().map(|i| (*i).to_owned()).collect(),
            planned: 2,
            reason: "0 of 3 good after 12 hits".into(),
        };
        assert_eq!(
            [group("A4", &["AZ1", "AZ2"]), group("A1", &["AZ1"])].map(|one| sentence(&one)),
            [
                "A: A4 was given up for all 2 impacts: 0 of 3 good after 12 hits.",
                "A: A1 was given up for AZ1: 0 of 3 good after 12 hits."
            ]
        );
    }
}

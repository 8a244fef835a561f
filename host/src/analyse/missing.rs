//! Data missing in an analysis, and the reasons.

use super::cell::CellName;
use super::modal::NoModes;
use crate::campaign::plan::level::Level;
use crate::hysteresis::HysteresisError;
use crate::structure::Structure;
use crate::substructuring::averaged::AveragedError;
use crate::substructuring::{CommonLines, FrfError, IdentifyError};

/// One missing item. Messages of errors from files are kept unchanged.
#[derive(Debug, Clone, PartialEq)]
pub enum Missing {
    /// A cell's records have a fault.
    Records {
        /// The cell.
        cell: CellName,
        /// The fault.
        told: String,
    },
    /// A record gives no loop.
    NoLoop {
        /// The cell.
        cell: CellName,
        /// The record.
        record: i64,
        /// The reason.
        error: HysteresisError,
    },
    /// Cells of one response location that were abandoned for the same reason.
    GivenUp {
        /// The configuration.
        configuration: Structure,
        /// The response location.
        response: String,
        /// The impacts.
        impacts: Vec<String>,
        /// Cells of this location in the plan.
        planned: usize,
        /// The reason as entered.
        reason: String,
    },
    /// The plan has no cell of this configuration.
    NotInPlan(Structure),
    /// None of this configuration's cells has a kept hit.
    NotMeasured {
        /// The configuration.
        configuration: Structure,
        /// Its cells in the plan.
        planned: usize,
    },
    /// Some cells have no kept hit.
    CellsWithoutHit {
        /// The configuration.
        configuration: Structure,
        /// Their number.
        absent: usize,
        /// Its cells in the plan.
        planned: usize,
    },
    /// Cells with a single hit, and therefore without coherence.
    SingleHits {
        /// The configuration.
        configuration: Structure,
        /// Their number.
        cells: usize,
    },
    /// Impacts that substructuring cannot use, because cells are missing.
    ImpactsLeftOut {
        /// The configuration.
        configuration: Structure,
        /// Their names.
        names: Vec<String>,
    },
    /// Response locations that substructuring cannot use, because cells are missing.
    ResponsesLeftOut {
        /// The configuration.
        configuration: Structure,
        /// Their names.
        names: Vec<String>,
    },
    /// Imported FRFs cannot be read.
    ImportUnreadable {
        /// The configuration.
        configuration: Structure,
        /// The fault.
        told: String,
    },
    /// Imported FRFs are not used, because hits of this campaign take precedence.
    ImportUnused {
        /// The configuration.
        configuration: Structure,
        /// The file they were imported from.
        file: String,
        /// Cells with hits.
        cells: usize,
    },
    /// A cell's signals at the contact have different lines than the others, and are not used
    /// there.
    OtherLines(CellName),
    /// Missing configurations, without which there is no substructuring.
    Configurations(Vec<Structure>),
    /// The lines of the three configurations differ; only the common ones are used.
    LinesLeftOut(CommonLines),
    /// The three configurations do not match.
    Substructuring(IdentifyError),
    /// No CMIF.
    Cmif(FrfError),
    /// A structure's modes cannot be identified.
    Modes {
        /// The structure.
        configuration: Structure,
        /// The reason.
        why: NoModes,
    },
    /// No bootstrap over hits.
    Bootstrap(AveragedError),
    /// No estimate with an interval.
    Estimate(AveragedError),
    /// A level of the shaker cannot be used.
    Level(String),
    /// A level gives no loop.
    LevelLoop {
        /// The level.
        level: Level,
        /// The reason.
        error: HysteresisError,
    },
    /// The cycles of the wear runs cannot be read.
    Wear(String),
    /// The static arm's effective mass is not known, so there is no corrected force.
    EffectiveMass,
}

/// Abandoned cells, grouped by location and reason.
pub fn given_up(planned: &[CellName], cells: Vec<(CellName, String)>) -> Vec<Missing> {
    let mut groups: Vec<(Structure, String, String, Vec<String>)> = Vec::new();
    for (cell, reason) in cells {
        let same =
            groups.iter_mut().find(|g| g.0 == cell.configuration && g.1 == cell.response && g.2 == reason);
        match same {
            Some(group) => group.3.push(cell.impact),
            None => groups.push((cell.configuration, cell.response, reason, vec![cell.impact])),
        }
    }
    let of = |(configuration, response, reason, impacts): (Structure, String, String, Vec<String>)| {
        let here = |c: &&CellName| c.configuration == configuration && c.response == response;
        let planned = planned.iter().filter(here).count();
        Missing::GivenUp { planned, configuration, response, impacts, reason }
    };
    groups.into_iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_given_up_are_told_together() {
        let cell = |impact: &str, response: &str| CellName {
            configuration: Structure::A,
            impact: impact.into(),
            response: response.into(),
        };
        let planned = [cell("AZ1", "A1"), cell("AZ2", "A1"), cell("AZ1", "A4"), cell("AZ2", "A4")];
        let reason = || "0 of 3 good after 12 hits".to_owned();
        let cells = [&planned[2], &planned[3], &planned[0]].map(|c| (c.clone(), reason())).to_vec();
        let group = |response: &str, impacts: &[&str]| Missing::GivenUp {
            configuration: Structure::A,
            response: response.into(),
            impacts: impacts.iter().map(|i| (*i).to_owned()).collect(),
            planned: 2,
            reason: reason(),
        };
        assert_eq!(given_up(&planned, cells), [group("A4", &["AZ1", "AZ2"]), group("A1", &["AZ1"])]);
    }
}

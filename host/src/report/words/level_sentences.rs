//! What a level of the shaker says of the contact's own stiffness, or why it says nothing.

use super::names::shape_name;
use super::number::short;
use super::warning_sentences::loop_finding;
use crate::analyse::NoLevelStiffness;
use crate::contact::LevelStiffness;
use crate::hysteresis::Shape;

/// What makes a level's interval.
pub fn corrected(found: &LevelStiffness) -> String {
    let shares = &found.shares;
    let mut causes = [
        (shares.fit, "what the hits tell of spots, points, gains and force"),
        (shares.hammer_gain, "the gain of the hammer's force cell"),
        (shares.turning, "noise of the specimens' rotation at this frequency"),
        (shares.place, "where the shaker pushes"),
        (shares.level, "the level's own scatter"),
    ];
    causes.sort_by(|a, b| b.0.total_cmp(&a.0));
    format!(
        "Force and Δx are those at the contact, by the specimens' rotation from the hits: {} % of T/Δx at the spots was not the contact's. Most of its \
         uncertainty comes from {} ({:.1} %).",
        short(100.0 * found.correction),
        causes[0].1,
        100.0 * causes[0].0
    )
}

/// Why a level has no k_T.
pub fn none(why: &NoLevelStiffness) -> String {
    let reason = match why {
        NoLevelStiffness::NoContact => {
            "the hits do not tell the specimens' rotation and the force at the contact: see answer.contact"
                .into()
        }
        NoLevelStiffness::Doubted => "what it would be corrected by is in doubt: see answer.contact".into(),
        NoLevelStiffness::SlipsUnderTheHammer => {
            "the contact slips under the hammer, so that hits do not tell how it sticks".into()
        }
        NoLevelStiffness::Slips => {
            format!("the loop slips ({} or {})", shape_name(Shape::Microslip), shape_name(Shape::GrossSlip))
        }
        NoLevelStiffness::Finding(finding) => loop_finding(finding),
        NoLevelStiffness::Level(error) => error.to_string(),
        NoLevelStiffness::Wide(half) => format!(
            "the specimens' rotation makes so much of Δx here that k_T is known to ± {} % only",
            short(100.0 * half)
        ),
    };
    format!("no k_T: {reason}")
}

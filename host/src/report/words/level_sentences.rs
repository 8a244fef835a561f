//! Sentences on the contact stiffness from a level of the shaker, or why there is none.

use super::names::shape_name;
use super::number::short;
use super::warning_sentences::loop_finding;
use crate::analyse::NoLevelStiffness;
use crate::contact::Shares;
use crate::hysteresis::Shape;

/// Contributions to a level's interval; `correction` is the part of T/Δx at the measured points
/// that is not due to the contact.
pub fn corrected(shares: &Shares, correction: f64) -> String {
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
        short(100.0 * correction),
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
        NoLevelStiffness::Apart(deviations) => format!(
            "it is {} standard deviations from what the hits say: see answer.contact",
            short(*deviations)
        ),
        NoLevelStiffness::Wide(half) => format!(
            "the specimens' rotation makes so much of Δx here that k_T is known to ± {} % only",
            short(100.0 * half)
        ),
    };
    format!("no k_T: {reason}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::words::levels_at_the_contact;
    use crate::results::{OverCycles, example_tests as example};

    #[test]
    fn a_level_says_what_made_its_interval() {
        let shares = Shares { fit: 0.01, hammer_gain: 0.005, turning: 0.002, place: 0.021, level: 1e-4 };
        let said = corrected(&shares, 0.31);
        assert!(said.contains("31") && said.contains("where the shaker pushes (2.1 %)"), "{said}");
    }

    #[test]
    fn only_levels_with_an_interval_of_their_own_are_called_k_t() {
        let mut results = example::results();
        assert_eq!(levels_at_the_contact(&results), None, "nobody asked");
        let levels = results.hysteresis.iter_mut().filter(|row| row.level.is_some());
        let mut count = 0;
        for (n, row) in levels.enumerate() {
            count += 1;
            row.k_t_why = Some(none(&NoLevelStiffness::Wide(0.3)));
            if n == 1 {
                row.k_t_n_per_m =
                    Some(OverCycles { mean: 171e6, std: 1e5, cycles: 100, ci95: Some([160e6, 183e6]) });
                row.k_t_budget =
                    Some(Shares { fit: 0.01, hammer_gain: 0.0, turning: 0.0, place: 0.02, level: 0.0 });
                assert_ne!(row.stick_slope().map(|k| k.mean), Some(171e6), "the loop's own slope is another");
            }
        }
        let said = levels_at_the_contact(&results).expect("levels");
        assert!(said.contains(&format!("one of {count} levels")) && said.contains("171 N/µm"), "{said}");
    }
}

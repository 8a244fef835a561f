//! Sentences for comparisons: FBS and loops side by side (the paper's Tables 2 and 3), with every
//! type of stiffness that was found and its meaning, and two campaigns.

use super::level_sentences::slope_name;
use super::names::{BETWEEN_SPOTS, slope};
use super::number::{band, count, decimals, short};
use crate::contact::Interval;
use crate::results::{
    DIRECT, Difference, Excitation, Force, HIDDEN_RESONANCE, Hysteresis, MAIN_BAND, OverCycles, Results,
    SERIES_COMPLIANCE, Shape, SideBySide as Kind,
};
use crate::substructuring::{Dof, fit};

/// The cycle of the decay that represents the later ones, as in the paper.
const LATER_CYCLE: usize = 4;

/// Every type of stiffness in these results, FBS first.
pub fn kinds(results: &Results) -> Vec<Kind> {
    let mut kinds = substructuring(results);
    kinds.extend(direct(results));
    kinds.extend(shaker(results, Force::Raw));
    kinds.extend(impacts(results));
    kinds
}

/// The loops with the corrected force, those of the shaker by frequency.
pub fn corrected(results: &Results) -> Vec<Kind> {
    let mut kinds = shaker(results, Force::Corrected);
    let of_impacts = |h: &&Hysteresis| h.kind == Excitation::Impact && h.force == Force::Corrected;
    if let Some((name, k)) = results.hysteresis.iter().find(of_impacts).and_then(slope) {
        kinds.push(Kind {
            found: format!("{name}, impacts, first cycle of {} hits", count(k.cycles as u64)),
            mean_n_per_m: k.mean,
            std_n_per_m: k.std,
            meaning: String::new(),
        });
    }
    kinds
}

/// The recommended estimate, the fit, and the paper's method, if available: all three measure the
/// same quantity, but only the first two give an uncertainty.
fn substructuring(results: &Results) -> Vec<Kind> {
    let series = results.check(SERIES_COMPLIANCE).and_then(|c| c.ok);
    let what = match series {
        Some(false) => {
            "stiffness between the arms: contact and clamps in series. A property of this structure, not of the contact; use it in models without clamps"
        }
        Some(true) => {
            "stiffness between the arms: nothing soft was found between them and the contact; the answer gives the contact's own stiffness"
        }
        None => "stiffness between the arms: contact and clamps in series",
    };
    let recommended =
        results.quoted().and_then(|r| Some((r, r.joint.get(&Dof::Z).filter(|z| z.identified)?)));
    let mut kinds = Vec::new();
    if let Some((estimate, z)) = recommended {
        kinds.push(Kind {
            found: format!("FBS, recommended, {} IDMs, {}", estimate.idms, band(MAIN_BAND)),
            mean_n_per_m: z.stiffness,
            std_n_per_m: z.std,
            meaning: what.into(),
        });
    }
    let fitted = results.joint.iter().find(|j| j.method == fit::NAME && j.band_hz == MAIN_BAND);
    for joint in [fitted, results.headline_joint()].into_iter().flatten() {
        let Some(k) = joint.sliding_stiffness() else { continue };
        let meaning = match (kinds.is_empty(), joint.method == fit::NAME) {
            (true, _) => what,
            (false, true) => {
                "the same by maximum likelihood over all cells; valid only if A and B are the same alone as in the assembly"
            }
            (false, false) => {
                "the same line by line: ± is the scatter of the lines, not the uncertainty of the joint"
            }
        };
        kinds.push(Kind {
            found: format!("FBS, {} with {} IDMs, {}", joint.method, joint.idms, band(joint.band_hz)),
            mean_n_per_m: k.mean,
            std_n_per_m: k.std,
            meaning: meaning.into(),
        });
    }
    kinds
}

fn direct(results: &Results) -> Option<Kind> {
    let joint = results.joint.iter().find(|j| j.method == DIRECT)?;
    let k = joint.sliding_stiffness()?;
    Some(Kind {
        found: format!("T/Δx of the impacts, {}", band(joint.band_hz)),
        mean_n_per_m: k.mean,
        std_n_per_m: k.std,
        meaning: "stiffness between the two laser spots with the raw force, away from local resonances: includes the specimen's tilt, but not arm B's inertia".into(),
    })
}

/// The steady loops of each frequency with this force: for straight ones the slope between the
/// measured points, for others k_eq.
fn shaker(results: &Results, force: Force) -> Vec<Kind> {
    let rows: Vec<&Hysteresis> =
        results.hysteresis.iter().filter(|h| h.kind == Excitation::Shaker && h.force == force).collect();
    let mut frequencies: Vec<f64> = rows.iter().filter_map(|h| h.frequency_hz).collect();
    frequencies.sort_by(f64::total_cmp);
    frequencies.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-3);
    let mut kinds = Vec::new();
    for f in frequencies {
        let near = |h: &&&Hysteresis| h.frequency_hz.is_some_and(|g| (g / f - 1.0).abs() < 1e-3);
        for straight in [true, false] {
            let own: Vec<&Hysteresis> =
                rows.iter().filter(near).copied().filter(|h| h.stick_slope().is_some() == straight).collect();
            let slopes: Vec<OverCycles> =
                own.iter().filter_map(|h| if straight { h.stick_slope() } else { h.k_eq_n_per_m }).collect();
            let Some((mean, std)) = pooled(&slopes) else { continue };
            let levels = if own.len() == 1 { "1 level".into() } else { format!("{} levels", own.len()) };
            let name = if straight { slope_name(&own) } else { "k_eq" };
            kinds.push(Kind {
                found: format!("{name}, shaker, {} Hz, {levels}", short(f)),
                mean_n_per_m: mean,
                std_n_per_m: std,
                // if one loop slips, its meaning applies to all: slopes of stick parts
                meaning: own.iter().max_by_key(|h| slips(h)).map_or(String::new(), |h| meaning(h, results)),
            });
        }
    }
    kinds
}

fn slips(row: &Hysteresis) -> bool {
    matches!(row.shape, Shape::Microslip | Shape::GrossSlip)
}

fn meaning(row: &Hysteresis, results: &Results) -> String {
    let hidden = results.check(HIDDEN_RESONANCE).filter(|c| c.ok == Some(false)).and_then(|c| c.frequency_hz);
    match (row.shape, hidden) {
        (Shape::Stuck, Some(f)) => format!(
            "a straight loop: the contact between the laser spots, with some per cent of the {} Hz resonance in Δx",
            short(f)
        ),
        (Shape::Stuck, None) => {
            "a straight loop: what lies between the spots, contact and specimens' tilt".into()
        }
        (Shape::Elliptical, Some(f)) => format!(
            "an ellipse near the resonance at {} Hz: an equivalent stiffness of this structure at this frequency, no contact stiffness",
            short(f)
        ),
        (Shape::Elliptical, None) => {
            "an ellipse: an equivalent stiffness of this structure at this frequency, no contact stiffness"
                .into()
        }
        (Shape::Microslip | Shape::GrossSlip, _) if row.stick_slope().is_some() => {
            "slope of the stick part after each reversal, between the spots".into()
        }
        (Shape::Microslip | Shape::GrossSlip, _) => "the whole slipping loop: falls with amplitude".into(),
    }
}

fn impacts(results: &Results) -> Vec<Kind> {
    let Some(row) = results.impact_loops() else { return Vec::new() };
    let mut kinds = Vec::new();
    let hits = row.k_eq_n_per_m.map_or(0, |k| k.cycles as u64);
    if let Some(k) = row.stick_slope().or(row.k_eq_n_per_m) {
        let straight = row.stick_slope().is_some();
        kinds.push(Kind {
            found: format!(
                "{}, impacts, first cycle of {} hits",
                if straight { BETWEEN_SPOTS } else { "k_eq" },
                count(hits)
            ),
            mean_n_per_m: k.mean,
            std_n_per_m: k.std,
            meaning: if straight {
                "contains all modes, but none of them lies between the spots: contact and specimens' tilt".into()
            } else {
                "contains all modes, including the local one of a specimen: near the contact's stiffness, but not equal to it"
                    .into()
            },
        });
    }
    if let Some(step) = row.decay.iter().find(|d| d.cycle == LATER_CYCLE) {
        kinds.push(Kind {
            found: format!("k_eq, impacts, cycle {LATER_CYCLE}"),
            mean_n_per_m: step.k_eq_n_per_m.mean,
            std_n_per_m: step.k_eq_n_per_m.std,
            meaning: format!(
                "Δx lags T by {}° on average: depends on the phase of the decaying modes and belongs to no single frequency",
                decimals(step.phase_deg, 0)
            ),
        });
    }
    kinds
}

/// Mean of the means, and the scatter of all cycles about it.
fn pooled(slopes: &[OverCycles]) -> Option<(f64, f64)> {
    let n = slopes.len() as f64;
    let mean = slopes.iter().map(|k| k.mean).sum::<f64>() / n;
    let variance = slopes.iter().map(|k| k.std.powi(2) + (k.mean - mean).powi(2)).sum::<f64>() / n;
    (!slopes.is_empty()).then(|| (mean, variance.sqrt()))
}

/// Whether the contacts differ, by the quantity that decides it; a fixed sentence if neither
/// quantity is known in both.
pub fn verdict(told: Option<&Difference>) -> String {
    told.map_or_else(
        || {
            "It cannot be decided whether the contacts differ: neither k_T nor the stiffness between the arms is known in both."
                .into()
        },
        of_difference,
    )
}

/// Sentence for a quantity that one of the two lacks.
pub fn lacking(quantity: &str, which: &str) -> String {
    format!("{quantity}: the {which} campaign has none")
}

fn of_difference(d: &Difference) -> String {
    let micro = |k: f64| 1e-6 * k;
    let Interval { mean, ci95: [low, high] } = d.b_minus_a;
    let part = 100.0 * mean / d.a.mean;
    if d.differ {
        let way = if mean > 0.0 { "stiffer" } else { "softer" };
        // the smaller change first, whatever its sign
        let [near, far] = if mean > 0.0 { [low, high] } else { [-high, -low] };
        format!(
            "They differ: {}, the second is {way} by {:.1} N/µm (95 % {:.1}…{:.1}), {:.0} % of the first.",
            d.quantity,
            micro(mean.abs()),
            micro(near),
            micro(far),
            part.abs()
        )
    } else {
        format!(
            "They do not differ within the uncertainty of this measurement: {}, second minus first is {:.1} N/µm (95 % {:.1}…{:.1}).",
            d.quantity,
            micro(mean),
            micro(low),
            micro(high)
        )
    }
    .replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::example_tests as example;

    #[test]
    fn every_number_has_a_sentence_that_says_what_it_is() {
        let kinds = kinds(&example::results());
        assert!(kinds.iter().all(|k| k.mean_n_per_m.is_finite() && !k.meaning.is_empty()));
        let of = |word: &str| kinds.iter().find(|k| k.found.contains(word)).expect(word);
        assert!(of("FBS").meaning.contains("in series"));
        assert!(
            of("200 Hz").meaning.contains("no contact stiffness") && of("200 Hz").found.starts_with("k_eq")
        );
        assert!(of("250 Hz").found.starts_with(BETWEEN_SPOTS) && of("250 Hz").found.contains("2 levels"));
        assert!(of("first cycle").found.starts_with("k_eq"));
    }

    #[test]
    fn levels_are_pooled_with_what_is_between_them() {
        let one = |mean| OverCycles { mean, std: 3.0, cycles: 10, ci95: None };
        assert_eq!(pooled(&[one(100.0)]), Some((100.0, 3.0)));
        assert_eq!(pooled(&[one(96.0), one(104.0)]), Some((100.0, 5.0)));
        assert_eq!(pooled(&[]), None);
    }
}

#[cfg(test)]
mod comparison_sentences_tests {
    use super::*;

    fn difference(mean: f64, differ: bool) -> Difference {
        let a = Interval { mean: 180e6, ci95: [174e6, 186e6] };
        let b = Interval { mean: 180e6 + mean, ci95: [174e6 + mean, 186e6 + mean] };
        let b_minus_a = Interval { mean, ci95: [mean - 7.8e6, mean + 7.8e6] };
        Difference { quantity: "k_T".into(), unit: "N/m", a, b, b_minus_a, differ }
    }

    #[test]
    fn the_smaller_change_comes_first_whichever_way_it_goes() {
        let softer = verdict(Some(&difference(-18e6, true)));
        assert!(softer.contains("softer by 18.0 N/µm (95 % 10.2…25.8), 10 %"), "{softer}");
        let stiffer = verdict(Some(&difference(18e6, true)));
        assert!(stiffer.contains("stiffer by 18.0 N/µm (95 % 10.2…25.8), 10 %"), "{stiffer}");
        let same = verdict(Some(&difference(-3e6, false)));
        assert!(same.contains("do not differ") && same.contains("−3.0 N/µm (95 % −10.8…4.8)"), "{same}");
    }
}

//! What a reader must know before using a number: warnings, and the data that were missing in an
//! analysis.

use super::number::{decimals, length, micro, prefixed, short};
use crate::analyse::{CellName, ImpactLoops, Missing, NoFit, SlopeIs};
use crate::hysteresis::LoopFinding;
use crate::results::rounded;
use crate::structure::Structure;
use crate::substructuring::direct::Direct;

/// Noise above this fraction of the stiffness is reported.
const LOUD: f64 = 0.3;

/// Warns if noise alone changes a line by a large fraction of the stiffness; both in N/m.
pub fn loud_noise(median: f64, noise: f64) -> Option<String> {
    (noise > LOUD * median.abs()).then(|| {
        format!(
            "noise alone shifts k_z of a line by {:.1} N/µm (median): {:.0} % of the value of the lines",
            noise * 1e-6,
            100.0 * noise / median.abs()
        )
    })
}

/// What T/Δx measures, and what it does not.
pub fn direct(found: &Direct) -> Vec<String> {
    let mut warnings = vec![
        "T is the load cells' sum, not the force at the contact: the static arm's inertia adds a few per cent, increasing with the square of the frequency".to_owned(),
    ];
    if found.is_drowned() {
        warnings.push("Δx is buried in noise here: no stiffness can be read from it".to_owned());
    }
    warnings
}

/// What the slope of first cycles measures, and what it may be called.
pub fn impact_loops(found: &ImpactLoops) -> Vec<String> {
    let mut warnings = vec![
        "Slope over the first cycle of a decay: it contains every mode that the hit excites, including the specimen's tilt on its clamp.".to_owned(),
    ];
    if found.open > 0 {
        warnings.push(format!(
            "In {} of {} first cycles a straight line explains less than 90 % of T: local modes open those loops.",
            found.open,
            found.records.len()
        ));
    }
    if found.slope_n_per_m.mean < 0.0 {
        warnings.push("A negative slope: the polarity of a vibrometer or of the load cells is wrong.".into());
    }
    match found.slope_is {
        SlopeIs::Contact | SlopeIs::NotStraight => {}
        SlopeIs::Resonant(f) => warnings.push(format!(
            "This slope is k_eq, not k_T: a resonance of one specimen at {} Hz is excited by every hit and moves Δx without the force.",
            short(f)
        )),
        SlopeIs::Slipping => warnings.push(
            "This slope is k_eq, not k_T: the contact slips under the hammer, so it depends on the force.".into(),
        ),
        SlopeIs::Undecided => warnings.push(
            "This slope is called k_eq, because these records do not show whether it contains a resonance of one specimen.".into(),
        ),
    }
    warnings
}

/// A frequency with two decimals, or more below 10 Hz.
fn hertz(frequency_hz: f64) -> String {
    decimals(frequency_hz, if frequency_hz < 10.0 { 4 } else { 2 })
}

/// A number of cycles in words.
fn cycles(count: usize) -> String {
    if count == 1 { "1 cycle".into() } else { format!("{count} cycles") }
}

/// The sentence for a finding on a loop.
pub fn loop_finding(found: &LoopFinding) -> String {
    let micros = |s: f64| short(1e6 * s);
    match *found {
        LoopFinding::ReversedForce { k_eq_n_per_m, .. } => format!(
            "the force falls while the contact is pushed ({} N/µm) and the loop dissipates no energy: the force's sign is wrong, or the signals of A \
             and B are swapped; no k_T is given",
            short(micro(k_eq_n_per_m))
        ),
        LoopFinding::LateForce { by_s, at_least: true, .. } => format!(
            "the loop generates energy instead of dissipating it: the force comes at least {} µs later than the motion, or something between the \
             spots resonates; check the channels' delays",
            micros(by_s)
        ),
        LoopFinding::LateForce { by_s, std_s, corrected: true, .. } => format!(
            "the force comes {} ± {} µs {} than the motion; it was put in step before k_T, friction and energy were determined; check the channels' delays",
            micros(by_s.abs()),
            micros(std_s),
            if by_s < 0.0 { "earlier" } else { "later" }
        ),
        LoopFinding::LateForce { by_s, .. } => format!(
            "the force is out of step with the motion, as if it came about {} µs {}, but it was not corrected: no delay turns this into a friction \
             loop, or damping in addition to the friction explains it as well; no k_T or friction limit is given, and energy and k_eq are those of \
             the uncorrected loop; check the channels' delays",
            micros(by_s.abs()),
            if by_s < 0.0 { "earlier" } else { "later" }
        ),
        LoopFinding::Play { size_m, std_m } => format!(
            "the contact has play: after each reversal it moves by {} while the force stays constant; look for backlash in the drive, the pins or the clamps",
            length(size_m, std_m)
        ),
        LoopFinding::Unsteady { left_out_first, left_out_last, used, amplitude_m, left_out_amplitude_m } => {
            let place = match (left_out_first, left_out_last) {
                (first, 0) => format!("the first {}", cycles(first)),
                (0, last) => format!("the last {}", cycles(last)),
                (first, last) => format!("the first {} and the last {}", cycles(first), cycles(last)),
            };
            format!(
                "the record is not steady: {place} differ from the others (amplitude of Δx {} against {}) and were left out; all figures are those of the {} in between",
                prefixed(left_out_amplitude_m, "m"),
                prefixed(amplitude_m, "m"),
                cycles(used)
            )
        }
        LoopFinding::Viscous { viscous_n_s_per_m, force_n, .. } => format!(
            "a force proportional to the velocity ({} N s/m, up to {} N) acts in addition to the friction: it was removed before k_T and μN were determined",
            short(viscous_n_s_per_m),
            short(force_n)
        ),
        LoopFinding::Hum { mains_hz, at_hz, part } => format!(
            "these signals contain mains hum ({} Hz), and one of its multiples ({} Hz) is the loop's own frequency: the slope may be {} % off; measure a few hertz away from it",
            short(mains_hz),
            short(at_hz),
            short(100.0 * part)
        ),
        LoopFinding::UnevenLoad { change, std } => format!(
            "the friction limit changes by {} ± {} % from the middle of the stroke to its end: the normal load varies while the contact slides; μN is that at the middle",
            short(100.0 * change),
            short(100.0 * std)
        ),
        LoopFinding::FrequencyOff { stated_hz, from_hz, to_hz } => {
            let stated = stated_hz.map_or(String::new(), |f| format!(", not at the stated {} Hz", hertz(f)));
            let (from, to) = (hertz(from_hz), hertz(to_hz));
            let at = if from == to { format!("at {from}") } else { format!("from {from} to {to}") };
            format!("the excitation runs {at} Hz{stated}: the cycles were cut at the frequency found")
        }
        _ => "this loop has another fault: see its findings".into(),
    }
}

/// The effect of a resonance of one specimen on a loop that still looks stuck.
pub fn beside_resonance(frequency_hz: f64, resonance_hz: f64) -> String {
    let (way, effect) = if frequency_hz < resonance_hz { ("adds to", "low") } else { ("reduces", "high") };
    format!(
        "a resonance of one specimen at {} Hz {way} Δx here: this slope reads {effect}, and the error grows towards the resonance",
        short(resonance_hz)
    )
}

/// Why there is no fit.
pub fn no_fit(why: &NoFit) -> String {
    match why {
        NoFit::ImportWithoutVariance => {
            "it needs the variance of A, B and AJB, and the imported FRFs have none".into()
        }
        NoFit::FileWithoutVariance(name) => format!(
            "{name} has no array `variance`, and `fit` weighs every cell with its noise: store it (`jointrig frf --out` does), or state --noise FRACTION"
        ),
        NoFit::Failed(error) => error.to_string(),
    }
}

/// The sentence for one missing item.
pub fn missing(missing: &Missing) -> String {
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
        Missing::Modes { configuration, why } => format!("{configuration}: no modes: {why}."),
        Missing::Bootstrap(error) => format!("No bootstrap over hits: {error}."),
        Missing::Estimate(error) => format!("No estimate with an interval by Eq. A.1: {error}."),
        Missing::Level(told) => told.clone(),
        Missing::LevelLoop { level, error } => format!("Shaker, {level}: no loop: {error}."),
        Missing::Wear(told) => format!("The wear runs cannot be read: {told}."),
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
pub fn no_records(configuration: Structure, file: &str) -> String {
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
    fn a_resonance_moves_k_t_the_other_way_on_its_other_side() {
        assert!(beside_resonance(250.0, 192.0).contains("reads high"));
        assert!(beside_resonance(100.0, 192.0).contains("reads low"));
    }
}

#[cfg(test)]
mod missing_sentences_tests {
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
            [group("A4", &["AZ1", "AZ2"]), group("A1", &["AZ1"])].map(|one| missing(&one)),
            [
                "A: A4 was given up for all 2 impacts: 0 of 3 good after 12 hits.",
                "A: A1 was given up for AZ1: 0 of 3 good after 12 hits."
            ]
        );
    }
}

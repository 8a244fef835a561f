//! Which cells come next, in words: the present interval, what further hits give, and what limits
//! it when they hardly help.

use super::answer_sentences::{of_cause, with_interval};
use crate::analyse::next_cell::{Again, Dominating, GROWTH, Outlook, Visit};
use crate::contact::Cause;
use crate::structure::Structure;

/// A relative half width.
fn half(width: f64) -> String {
    if width.is_finite() { format!("± {:.2} %", 100.0 * width) } else { "not identified".into() }
}

/// The present estimate.
pub fn now(found: &Outlook) -> Vec<String> {
    let estimate = format!(
        "k_T = {}: {} from {} hits",
        with_interval(&found.k_t_n_per_m),
        half(found.half_width()),
        found.hits
    );
    std::iter::once(estimate).chain(in_doubt(found)).collect()
}

/// Why more hits are no use before something else is settled; `None` if nothing speaks against
/// them.
pub fn in_doubt(found: &Outlook) -> Option<String> {
    (found.slips || !found.doubts.is_empty()).then(|| {
        "`jointrig analyse` gives no k_T for these hits, and says why: settle that first, because more hits do not change it"
            .to_owned()
    })
}

/// The cell that shrinks the interval most per minute.
pub fn best(found: &Outlook, visit: &Visit) -> String {
    let cell = &visit.cell;
    format!(
        "k_T is known to {}; {} more in {} {} {} would give {}",
        half(found.half_width()),
        if visit.more == 1 { "1 hit".into() } else { format!("{} hits", visit.more) },
        cell.configuration.name(),
        cell.impact,
        cell.response,
        half(visit.half_width)
    )
}

/// The head of the table of cells.
pub fn table_head() -> String {
    format!("{:<20} {:>4} {:>5} {:>8}   {}", "cell", "hits", "more", "minutes", "then k_T to")
}

/// A row of the table of cells.
pub fn table_row(visit: &Visit) -> String {
    let cell = &visit.cell;
    let name = format!("{} {} {}", cell.configuration.name(), cell.impact, cell.response);
    let minutes = visit.seconds / 60.0;
    format!("{name:<20} {:>4} {:>5} {minutes:>8.1}   {}", visit.hits, visit.more, half(visit.half_width))
}

/// A row of the table of cells for places that are measured again.
pub fn again_row(again: &Again) -> String {
    let minutes = again.seconds / 60.0;
    let what = format!("again: {}", again.cause.name());
    format!("{what:<31} {minutes:>8.1}   {}", half(again.half_width))
}

/// That places should be measured again before further hits, and how the run goes on.
pub fn rather_again(found: &Outlook, again: &Again) -> String {
    format!(
        "k_T is known to {}; half the errors of {} would give {} in {:.0} min, which is more per minute than further hits: measure them again, \
         enter them with `jointrig campaign places`, and run the same command again (or without --again-min)",
        half(found.half_width()),
        of_cause(again.cause),
        half(again.half_width),
        again.seconds / 60.0
    )
}

/// When the wanted half width is reached, or why it is not.
pub fn route(found: &Outlook, until: f64, most_hits: usize, visits: &[Visit]) -> String {
    if found.half_width() <= until {
        return reached(found, until);
    }
    let hits: usize = visits.iter().map(|visit| visit.more).sum();
    let minutes = visits.iter().map(|visit| visit.seconds).sum::<f64>() / 60.0;
    let then = visits.last().map_or(found.half_width(), |visit| visit.half_width);
    if then <= until {
        let count = visits.len();
        let visit = if count == 1 { "visit" } else { "visits" };
        return format!(
            "k_T is known to {}; {} is reached after about {hits} further hits in {count} {visit}, {minutes:.0} min",
            half(found.half_width()),
            half(until)
        );
    }
    if found.grown(None) > until {
        let why = if found.within_reach(until, found.mounted()) {
            format!("needs more than {GROWTH} times the hits, which is not predicted")
        } else {
            "is out of reach of further hits".into()
        };
        return format!("{} {why}: {}", half(until), limited(found));
    }
    format!(
        "{} is not reached with the next {hits} hits (of {most_hits}), which give {}: {}",
        half(until),
        half(then),
        limited(found)
    )
}

/// That the wanted half width is reached.
pub fn reached(found: &Outlook, until: f64) -> String {
    format!("k_T is known to {}; {} was wanted", half(found.half_width()), half(until))
}

/// Limits of what more hits can give, and what else would help if they hardly do.
pub fn limits(found: &Outlook) -> Vec<String> {
    let mut lines = Vec::new();
    if !found.unpredicted.is_empty() {
        lines.push(format!(
            "{} cells of the plan are not predicted, because too little of their impact is measured: `jointrig campaign run` measures them",
            found.unpredicted.len()
        ));
    }
    lines.push(limited(found));
    lines
}

/// Part of the present half width that more hits must be able to remove, to be worth their time.
const WORTH: f64 = 0.15;

fn limited(found: &Outlook) -> String {
    let (now, all, assembly) = (found.half_width(), found.grown(None), found.grown(Some(Structure::Ajb)));
    let without_b = if assembly > all * 1.02 {
        format!(" ({} without further hits on B alone)", half(assembly))
    } else {
        String::new()
    };
    let text =
        format!("with {GROWTH} times the hits in every cell, k_T is known to {}{without_b}", half(all));
    let Some(largest) = found.dominating() else { return text };
    let hardly = if all > (1.0 - WORTH) * now { "more hits hardly help" } else { "besides noise" };
    format!(
        "{text}; {hardly}: the largest cause is {} ({:.1} %): {}",
        of_cause(largest.cause),
        100.0 * largest.share,
        advice(&largest)
    )
}

/// What to do about a cause of uncertainty.
fn advice(largest: &Dominating) -> String {
    let what = match largest.cause {
        Cause::Noise => "add hits",
        Cause::Spots => {
            "measure again where the two spots are relative to the contact, and state it as spot_m in [priors]"
        }
        Cause::Centre => {
            "measure where the faces carry the load, and state it as contact_across_m and contact_height_m in [priors]"
        }
        Cause::SpecimenPoints => {
            "measure the positions of the points on the specimens again, and state them as specimen_point_m in [priors]"
        }
        Cause::ArmPoints => {
            "measure the positions of the points on arm B again, and state them as position_m in [priors]"
        }
        Cause::Aim => "aim hammer and vibrometer with a jig or marks, and state aim_m in [priors]",
        Cause::HammerTilt => "guide the hammer, and state hammer_angle_rad in [priors]",
        Cause::Gains => {
            "calibrate the sensors against each other, and state gain and hammer_gain in [priors]"
        }
        Cause::Skew => "measure the channels' delays, and state skew_s in [priors]",
        Cause::SensorAxes => "measure the axes of the fixed sensors, and state transverse in [priors]",
        Cause::Bending => "state the specimens' section, length and material in [specimens]",
        Cause::SecondPath => "remove the cable, hose or stop that joins the two sides beside the contact",
        Cause::Drift => "let the contact run in before the campaign",
        Cause::Misfit => {
            "look at the checks of `jointrig analyse` for signals that the model does not explain"
        }
    };
    match largest.half_width_if_halved {
        Some(then) => format!("{what}; errors half as large would give {} with the present hits", half(then)),
        None => what.into(),
    }
}

//! The answer in words: what an engineer would say about each number.

use super::number::{AnswerLine, BETWEEN, CLAMP, CONTACT};
use super::number::{micro, short};
#[cfg(feature = "sim")]
use crate::analyse::expected::Expected;
use crate::contact::{
    Cause, Contradiction, Diagnosis, Doubt, FORCE_BALANCE, HAMMER_GAIN, Interval, MASS_ERROR, Stiffness,
};
use crate::results::{Answer, Results};
use crate::substructuring::between_arms::Basis as Estimate;
use std::collections::BTreeMap;

/// A stiffness with its interval, in N/µm.
pub fn with_interval(k: &Interval) -> String {
    format!("{} N/µm (95 % {}…{})", short(micro(k.mean)), short(micro(k.ci95[0])), short(micro(k.ci95[1])))
}

/// Why this k_T is credible, and what determines its interval; `levels` is the number of shaker
/// levels used in addition to the hits.
pub fn identified(own: &Stiffness, budget: &BTreeMap<Cause, f64>, levels: usize) -> String {
    let planes = if own.includes_specimen_b {
        "between specimen A's surface and arm B: no sensor is on specimen B, so its bulk and its clamp are part of it"
    } else {
        "between the specimens' surfaces at the contact, without the specimens' bulk, and independent of the clamps"
    };
    let beside = match levels {
        0 => String::new(),
        1 => " A level of the shaker, corrected by the hits, is included as well.".into(),
        _ => format!(" {levels} levels of the shaker, corrected by the hits, are included as well."),
    };
    format!(
        "The force is calibrated with hits on B alone, and the specimen's rotation is measured: this is the contact's own stiffness, {planes}.{beside} \
         Most of its uncertainty comes from {}.{}{}",
        largest(budget),
        contradicted(&own.contradictions),
        if own.contradictions.is_empty() { "" } else { " The interval allows for these errors." }
    )
}

/// The two largest causes of uncertainty.
fn largest(budget: &BTreeMap<Cause, f64>) -> String {
    let mut causes: Vec<(&Cause, &f64)> = budget.iter().collect();
    causes.sort_by(|a, b| b.1.total_cmp(a.1));
    let told = |(cause, share): &(&Cause, &f64)| format!("{} ({:.1} %)", of_cause(**cause), 100.0 * **share);
    causes.iter().take(2).map(told).collect::<Vec<_>>().join(" and ")
}

/// What a plan lets expect, contact by contact, with the assumptions.
#[cfg(feature = "sim")]
pub fn expected(all: &[Expected]) -> Vec<String> {
    let mut lines = vec![
        "expected interval of k_T (95 %), an estimate for a structure like the simulated rig: its masses and clamps, the plan's hits and [priors], \
         accelerometers of 30 µg/√Hz (10 with a single axis) or lasers of 0.05 µm/s/√Hz, three load cells"
            .to_owned(),
    ];
    lines.extend(all.iter().map(|one| {
        let contact = format!("  a contact of {:.0} N/µm", micro(one.contact_n_per_m));
        match &one.found {
            Ok(found) => {
                let [low, high] = found.k_t_n_per_m.ci95;
                let half = 50.0 * (high - low) / found.k_t_n_per_m.mean;
                format!("{contact}: ± {half:.1} %, most of it from {}", largest(&found.budget))
            }
            Err(why) => format!("{contact}: none. {}", capital(&why.to_string())),
        }
    }));
    lines
}

/// A cause of uncertainty in words.
pub fn of_cause(cause: Cause) -> &'static str {
    match cause {
        Cause::Noise => "noise",
        Cause::Spots => "the positions of the spots next to the contact",
        Cause::Centre => "the position of the contact's centre",
        Cause::SpecimenPoints => "the positions of the points on the specimen",
        Cause::ArmPoints => "the positions of the points on arm B",
        Cause::Aim => "the aim of the hits in each cell",
        Cause::HammerTilt => "the hammer's tilt",
        Cause::Gains => "gains",
        Cause::Skew => "delays between channels",
        Cause::SensorAxes => "the directions of the fixed sensors' axes",
        Cause::Bending => "bending and shear of the specimens between sensors and contact",
        Cause::Drift => "the contact's change while it was hit",
        Cause::SecondPath => "the force that passes beside the contact",
        Cause::Misfit => "signals that the model does not explain",
    }
}

/// Why a fitted k_T is not reported.
pub fn doubted(own: &Stiffness) -> String {
    let reasons: Vec<String> = own.doubts.iter().map(|doubt| of_doubt(*doubt, &own.diagnosis)).collect();
    format!(
        "No k_T is given, although the fit came out at {}: {}.{}",
        with_interval(&own.k_t_n_per_m),
        reasons.join("; "),
        contradicted(&own.contradictions)
    )
}

/// What of the plan the data contradict, and what to do; each as a sentence after a space.
fn contradicted(all: &[Contradiction]) -> String {
    if all.is_empty() {
        return String::new();
    }
    let told: Vec<String> = all.iter().map(|one| format!(" {}", of_contradiction(one))).collect();
    format!(" The data contradict the plan.{}", told.concat())
}

/// What of the plan is contradicted, in a few words.
pub fn contradicted_quantity(one: &Contradiction) -> String {
    match one.cause {
        Cause::SecondPath => "a second path beside the contact".into(),
        cause if one.scatter.is_some() => of_cause(cause).into(),
        Cause::SpecimenPoints | Cause::ArmPoints => one.what.clone(),
        _ => format!("the {}", one.what.trim_start_matches("the ")),
    }
}

/// What of the plan is contradicted, by how much, and what to do.
pub fn of_contradiction(one: &Contradiction) -> String {
    if let Some(times) = one.scatter {
        return format!(
            "{} are off {times:.1} times as far as stated: measure them again, or state in [priors] how well they are known.",
            capitalised(of_cause(one.cause))
        );
    }
    let name = capitalised(&contradicted_quantity(one));
    if let Some(other) = &one.exchanged_with {
        return format!("{name} was found where the plan has {other}, and the reverse: are they exchanged?");
    }
    let off = how_far(one);
    match one.cause {
        Cause::Spots | Cause::Centre => format!(
            "{name} seems off by {off}: measure its place again, and the height of the contact's faces. A cable, rod or stop that joins the two sides \
             beside the contact looks the same: remove it."
        ),
        Cause::Gains if one.what == "the load cells' gain" => format!(
            "{name} in the assembly seems off by {off}: calibrate them again. Something that touches arm B in the assembly only, for example a cable, \
             looks the same: remove it."
        ),
        Cause::Gains if one.what == FORCE_BALANCE => force_balance(one.off[0][0], &off),
        Cause::Gains if one.what == HAMMER_GAIN => format!(
            "On the known mass {} seems off by {off}, or all vibrometers together: calibrate them again. k_T allows for it.",
            one.what
        ),
        Cause::Gains if one.what == MASS_ERROR => format!(
            "On the known mass the hammer's force and all vibrometers contradict each other by {off}: calibrate the hammer's force cell and the \
             vibrometers again, weigh the mass, and strike it in the middle. Which of them is off cannot be told."
        ),
        Cause::Gains => format!("{name} seems off by {off}: calibrate it again."),
        Cause::Drift => format!(
            "The contact changed between the first and the last hits on A: T over the displacement between the spots changed by {off}. Look for wear, for a \
             normal load that relaxes, and for temperature."
        ),
        Cause::SecondPath => format!(
            "About {off} of the force between the arms passes beside the contact, by {}, as the hits with the joint open show, and makes k_T seem stiffer by as much: \
             remove the cable, hose or stop that joins the two sides, and measure the assembly again.",
            one.what
        ),
        Cause::Skew => {
            format!("{name} seems off by {off}: check the filters and the clock of its channel.")
        }
        Cause::HammerTilt => format!("{name} seems off by {off}: check the direction of these hits."),
        Cause::SensorAxes => format!("{name} seems off by {off}: check how it is mounted."),
        _ => format!(
            "{name} seems off by {off}: measure its place again, and enter it with `jointrig campaign places`."
        ),
    }
}

/// The hammer's force against the load cells' in the hits on B alone.
fn force_balance(off: f64, told: &str) -> String {
    let how = if off < 0.0 {
        "in the hits on B alone the load cells show more force than the hammer gives"
    } else {
        "in the hits on B alone much more force passes beside the load cells than `parallel_path` states, or so it seems"
    };
    format!(
        "The hammer's force cell or the load cells seem off by {told}: {how}. k_T is in proportion to the hammer's force: calibrate both, and strike a body of known mass \
         (`campaign check --mass`)."
    )
}

/// Deviations that are significant against their own uncertainty, or the largest.
fn how_far(one: &Contradiction) -> String {
    let significance = |[off, sigma]: &[f64; 2]| (off / sigma).abs();
    let most = one.off.iter().map(significance).fold(0.0, f64::max);
    let of = |(axis, own): (usize, &[f64; 2])| {
        let [off, _] = *own;
        (significance(own) >= most.min(3.0)).then(|| match one.cause {
            Cause::Gains | Cause::SensorAxes | Cause::Drift | Cause::SecondPath => {
                format!("{:.1} %", 100.0 * off.abs())
            }
            Cause::Skew => format!("{:.0} µs", 1e6 * off.abs()),
            Cause::HammerTilt => format!("{:.1}°", off.abs().asin().to_degrees()),
            _ => format!("{:.2} mm along {}", 1e3 * off.abs(), ["x", "y", "z"][axis % 3]),
        })
    };
    one.off.iter().enumerate().filter_map(of).collect::<Vec<_>>().join(" and ")
}

/// With a capital first letter.
fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map(|first| first.to_uppercase().chain(letters).collect()).unwrap_or_default()
}

fn of_doubt(doubt: Doubt, diagnosis: &Diagnosis) -> String {
    match doubt {
        Doubt::Force => {
            "the load cells and arm B's motion do not give the force in the hits on B alone (is a cell loose, or a point misplaced?)"
        }
        Doubt::SpecimenA => {
            "the points on specimen A do not move as one body that bends under the contact's force (is one misplaced or loose?)"
        }
        Doubt::Spots => {
            "the spots next to the contact do not move with arm B and the specimen (a specimen that moves against arm B needs points of its own: grouping 6)"
        }
        Doubt::Stated => {
            let farthest = diagnosis.farthest.as_ref();
            return farthest.map_or_else(String::new, |far| {
                format!(
                    "{} differs from the plan by {:.0} times its stated error (is something misplaced or uncalibrated, or are the plan's [priors] too small?)",
                    far.what, far.deviations
                )
            });
        }
        Doubt::Drift => "the contact changed too much while it was hit for one stiffness to describe it",
        Doubt::SecondPath => {
            "much of the force between the arms passes beside the contact, as the hits with the joint open show"
        }
        Doubt::Flatness => "the stiffness changes with frequency, which a contact's stiffness does not",
        Doubt::Sides => {
            "hits on A and on the moving mass give different values (has the contact changed between them? compare the first hits with later ones)"
        }
    }
    .to_owned()
}

/// Source of the stiffness between the arms.
pub fn between_the_arms(basis: Estimate) -> String {
    match basis {
        Estimate::Fit => {
            "Maximum likelihood over A, B and the assembly (300–600 Hz): everything between the arms in series, clamps and contact."
        }
        Estimate::Recommended => {
            "Eq. (A.1) of the assembly, averaged (300–600 Hz): everything between the arms in series, clamps and contact."
        }
    }
    .into()
}

/// Sentence for a slipping contact, which has no k_T.
pub fn slipping() -> String {
    "The contact slips under the hammer, so its stiffness depends on the force: to measure the stuck stiffness, hit more softly or increase the normal load.".into()
}

/// Sentence if the stiffness between the arms cannot be determined.
pub fn without_all_three() -> String {
    "It needs FRFs of A, B and the assembly.".into()
}

/// Sentence if it was not requested.
pub fn not_looked_for() -> String {
    "It was not requested.".into()
}

/// An error message as a sentence.
pub fn capital(text: &str) -> String {
    format!("{}.", capitalised(text))
}

/// Why the stiffness of the contact and that between the arms differ, in one sentence; `None` if
/// one of them is not known.
pub fn why_they_differ(results: &Results) -> Option<AnswerLine> {
    let answer = results.answer.as_ref()?;
    let contact = answer.contact.k_t_n_per_m.as_ref()?.mean;
    let between = answer.between_arms.k_n_per_m.as_ref()?.mean;
    let Some(clamp) = &answer.clamp else {
        return Some(AnswerLine::words(
            "Nothing soft was found between the arms and the contact, so both stiffnesses are the same."
                .into(),
        ));
    };
    let clamps = clamp.k_n_per_m.mean;
    let [of_clamps, of_contact, of_both] = [clamps, contact, between].map(|k| short(micro(k)));
    let text = format!(
        "They differ because the clamps ({of_clamps} N/µm) and the contact ({of_contact}) act in series: together they have {of_both} N/µm."
    );
    Some(
        AnswerLine::words(text)
            .stiffness(clamps, &format!("{CLAMP}/mean"))
            .stiffness(contact, &format!("{CONTACT}/mean"))
            .stiffness(between, &format!("{BETWEEN}/mean")),
    )
}

/// The answer's lines: the first lines on the terminal, and the head of the report.
pub fn lines(results: &Results) -> Vec<String> {
    let Some(answer) = &results.answer else { return Vec::new() };
    let mut lines = vec![contact(answer)];
    lines.push(match &answer.between_arms.k_n_per_m {
        Some(k) => format!("Between the arms: {} ({}).", with_interval(k), answer.between_arms.basis),
        None => format!("Between the arms: no stiffness. {}", answer.between_arms.why),
    });
    if let Some(clamp) = &answer.clamp {
        lines.push(format!(
            "The difference is due to what lies in series with the contact, mainly the clamps: {}.",
            with_interval(&clamp.k_n_per_m)
        ));
    }
    lines.push(match answer.slip.found {
        // the corresponding check states how this was determined
        Some(true) => "The contact slips under the hammer.".into(),
        Some(false) => "The contact sticks under the hammer.".into(),
        None => answer.slip.why.clone(),
    });
    if let Some(truth) = &answer.truth {
        lines.push(format!(
            "SIMULATED rig: the truth is {} N/µm for the contact and {} N/µm between the arms.",
            short(micro(truth.contact_k_t_n_per_m)),
            short(micro(truth.between_arms_k_n_per_m))
        ));
    }
    lines
}

fn contact(answer: &Answer) -> String {
    let own = &answer.contact;
    match (&own.k_t_n_per_m, &own.c_t_n_s_per_m) {
        (Some(k), c) => format!(
            "The contact: k_T = {}{}. {}",
            with_interval(k),
            c.as_ref().map_or(String::new(), |c| format!(
                ", c_T = {} N s/m ({}…{})",
                short(c.mean),
                short(c.ci95[0]),
                short(c.ci95[1])
            )),
            own.why
        ),
        (None, _) => format!("The contact: no k_T. {}", own.why),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contradiction_says_what_is_off_and_what_to_do() {
        let of = |what: &str, cause, off: &[[f64; 2]]| Contradiction {
            what: what.into(),
            cause,
            off: off.to_vec(),
            scatter: None,
            exchanged_with: None,
        };
        let point = of("point C3", Cause::SpecimenPoints, &[[1e-5, 1e-4], [-1.2e-3, 1e-4], [0.0, 1e-4]]);
        let spot = of("the spot on A", Cause::Spots, &[[0.0, 1e-5], [1.5e-4, 1e-5]]);
        let gain = of("gain of the vibrometer on A's spot", Cause::Gains, &[[0.043, 0.005]]);
        let exchanged = Contradiction { exchanged_with: Some("point C1".into()), ..point.clone() };
        let kind = Contradiction { scatter: Some(2.9), off: Vec::new(), ..point.clone() };
        for (one, wanted) in [
            (
                &point,
                "Point C3 seems off by 1.20 mm along y: measure its place again, and enter it with `jointrig campaign places`.",
            ),
            (&gain, "The gain of the vibrometer on A's spot seems off by 4.3 %: calibrate it again."),
            (&exchanged, "Point C3 was found where the plan has point C1"),
            (&kind, "The positions of the points on the specimen are off 2.9 times as far as stated"),
            (&spot, "joins the two sides beside the contact looks the same"),
        ] {
            let text = of_contradiction(one);
            assert!(text.contains(wanted) && !text.contains("  "), "{text}");
        }
        assert_eq!(contradicted(&[]), "");
    }
}

//! The checks, each with its outcome, its figures, and its meaning for the reader.

use super::answer_sentences::{contradicted_quantity, of_contradiction};
use super::number::{decimals, micro, short};
use crate::analyse::Findings;
use crate::analyse::checks::contact_change::ContactChange;
use crate::analyse::checks::{
    BackCoupled, HiddenResonance, InternalsFound, Reach, SameStructures, Sameness, SensorMasses,
    SeriesCompliance, Sizes, rigid_motions_suffice,
};
use crate::contact::{Cause, Contradiction, HeldOut};
use crate::hysteresis::compliance::ImaginaryPeak;
use crate::hysteresis::contact_drift::ContactDrift;
use crate::hysteresis::hammer_slip::{HammerSlip, Unclear};
use crate::hysteresis::phase_split::{PhaseSplit, Specimen};
use crate::results::{
    AS_STATED, BACK_COUPLING, Check, HAMMER_SLIP, HIDDEN_RESONANCE, INTERFACE_MODES, INTERNALS,
    ONE_STRUCTURE, PREDICTED, SAME_IN_ALL, SENSOR_MASSES, SERIES_COMPLIANCE, STEADY, UNCHANGED,
};
use crate::substructuring::cmif::Cmif;
use crate::substructuring::explained::BEYOND;
use crate::substructuring::identify::Internals;
use crate::substructuring::joint_over_bands::NORMAL_95;

/// All checks that were made.
pub fn all(found: &Findings) -> Vec<Check> {
    let mut checks = Vec::new();
    checks.extend(one_structure(&found.source.structure_changes));
    if let Some(of_frfs) = &found.substructured {
        checks.extend(of_frfs.cmif.as_ref().ok().map(interface_modes));
        checks.extend(of_frfs.internals.as_ref().map(internals));
        checks.extend(of_frfs.same_structures.as_ref().map(same_structures));
        checks.extend(of_frfs.back_coupled.as_ref().map(back_coupled));
    }
    if let Some(Ok(own)) = &found.own_stiffness {
        checks.push(as_stated(&own.contradictions, !own.doubts.is_empty()));
        checks.extend(predicted(&own.held_out));
    }
    if let Some(contact) = &found.contact {
        checks.push(series_compliance(&contact.series));
        checks.push(hidden_resonance(&contact.hidden));
        checks.push(hammer_slip(&contact.slip));
        checks.extend(contact.drift.as_ref().map(contact_drift));
        checks.extend(contact.change.as_ref().map(contact_change));
        checks.extend(contact.masses.as_ref().map(sensor_masses));
    }
    checks
}

/// Records of several structures were combined because the user accepted that.
fn one_structure(changes: &[String]) -> Option<Check> {
    let meaning = format!(
        "The campaign was continued although the device reported another structure, because --new-structure was given ({}). If the structure really \
         changed, the results describe neither of the two.",
        changes.join("; ")
    );
    (!changes.is_empty()).then(|| Check::new(ONE_STRUCTURE, Some(false), meaning))
}

/// The set of modes suggested by the CMIF, and whether rigid motions are sufficient.
fn interface_modes(found: &Cmif) -> Check {
    let enough = rigid_motions_suffice(found);
    let mut meaning = format!("The CMIF suggests {} modes: {}.", found.suggested, found.reason);
    if enough == Some(false) {
        meaning.push_str(
            " What six rigid motions do not describe is noise or deformation of the interface: check the virtual points' consistency.",
        );
    }
    let mut check = Check::new(INTERFACE_MODES, Some(enough == Some(true)), meaning)
        .with("suggested_modes", found.suggested as f64);
    for (count, part) in &found.explained {
        check = check.with(&format!("explained_by_{count}"), *part);
    }
    check
}

/// What the masses of fixed sensors change.
fn sensor_masses(found: &SensorMasses) -> Check {
    let sums = format!(
        "The fixed sensors add {} g to A's side and {} g to B's: the structure that was measured includes them. k_T does not depend on those on A, \
         because the force at the contact is known from B's side.",
        short(1e3 * found.on_a_kg),
        short(1e3 * found.on_b_kg)
    );
    let names = found.in_one.join(", ");
    let on_b = match found.change {
        _ if found.in_one.is_empty() => {
            "Those on B were measured on B alone and in the assembly: arm B has their inertia in both, and k_T does not depend on them either.".to_owned()
        }
        Some(change) => format!(
            "{names} on B was measured on B alone or in the assembly, but not in both: if it was mounted only there, the force at the contact is up to \
             {} % off, and k_T as much. Leave the sensors on B in place for both.",
            short(100.0 * change)
        ),
        None => format!(
            "{names} on B was measured on B alone or in the assembly, but not in both: what that changes is not known. Leave the sensors on B in place \
             for both."
        ),
    };
    let meaning = format!("{sums} {on_b}");
    let check = Check::new(SENSOR_MASSES, found.ok(), meaning)
        .with("on_a_kg", found.on_a_kg)
        .with("on_b_kg", found.on_b_kg);
    match found.change {
        Some(change) => check.with("change_of_k_t", change),
        None => check,
    }
}

fn internals(found: &InternalsFound) -> Check {
    let has = |i: &Internals| {
        format!("{} impacts on A and {} responses on B for {} interface DoFs", i.impacts, i.responses, i.idms)
    };
    let mut sentences = Vec::new();
    if let Some(i) = &found.least_squares {
        sentences.push(format!(
            "Eq. 3 in least squares has {}; P has rank {} (condition {}), Q rank {} (condition {}).",
            has(i),
            i.rank_p,
            short(i.condition_p),
            i.rank_q,
            short(i.condition_q)
        ));
    }
    if let Some(refused) = &found.refused {
        sentences.push(format!(
            "Eq. 3 in least squares with {} IDMs was refused: {}.",
            refused.idms, refused.reason
        ));
    }
    if let Some(i) = &found.printed {
        let exact = if found.printed_is_exact() {
            "exact"
        } else {
            "with n_i ≠ n_c it is right only for the forces that these internals generate"
        };
        sentences.push(format!("As printed it has {}: {exact}.", has(i)));
    }
    let check = Check::new(INTERNALS, Some(found.ok()), sentences.join(" "));
    let Some(i) = &found.least_squares else { return check };
    check
        .with("interface_dofs", i.idms as f64)
        .with("internal_impacts", i.impacts as f64)
        .with("internal_responses", i.responses as f64)
        .with("rank_p", i.rank_p as f64)
        .with("rank_q", i.rank_q as f64)
        .with("condition_p", i.condition_p)
        .with("condition_q", i.condition_q)
}

fn same_structures(found: &SameStructures) -> Check {
    let meaning = match found.sameness {
        Sameness::Untold => "Eq. A.1 and A.2 scatter too much to tell whether A and B are the same structures in the assembly as alone.".to_owned(),
        Sameness::Same => "Eq. A.1, which needs neither A nor B alone, and both blocks of A.2 agree: there is no sign that A or B is different in the assembly."
            .to_owned(),
        Sameness::Changed(changed) => {
            let sides = found.differences_n_per_m.iter().zip(changed).filter(|(_, changed)| *changed);
            let sides: Vec<String> =
                sides.map(|((side, by), _)| format!("{side} (by {} N/µm)", short(micro(*by)))).collect();
            format!(
                "Eq. A.2 differs from A.1 for {}: that substructure is not the same alone as in the assembly. Methods that use it (Eq. 3, A.3, its \
                 block of A.2) attribute the difference to the joint; A.1 and the other block of A.2 do not.",
                sides.join(" and ")
            )
        }
    };
    let mut check =
        Check::new(SAME_IN_ALL, found.ok(), meaning).with("inverse_n_per_m", found.inverse_n_per_m);
    for (side, difference) in found.differences_n_per_m {
        check = check.with(&format!("primal_{}_minus_inverse_n_per_m", side.to_lowercase()), difference);
    }
    check
}

fn back_coupled(found: &BackCoupled) -> Check {
    let percent = |part: f64| if part < 1e-3 { "less than 0.1".into() } else { short(100.0 * part) };
    let sizes = format!(
        "in the main band they are {} % off, and noise and errors of position explain {} %",
        percent(found.median_error),
        percent(found.median_explained)
    );
    let coupled = "A and B, coupled by the joint of Eq. A.1 (its mean over the main band)";
    let meaning = match found.reach {
        Reach::Untold => format!("It is unknown if {coupled}, reproduce the measured assembly: {sizes}."),
        Reach::Doubtful => format!(
            "{coupled}, reproduce the measured assembly no worse than {} times what noise and errors of position explain ({sizes}): too little to \
             conclude that there is another path, too much to exclude one.",
            short(BEYOND)
        ),
        Reach::Whole([from, to]) => format!(
            "{coupled}, reproduce the measured assembly from {} to {} Hz: {sizes}. There is no sign of another path between A and B.",
            short(from),
            short(to)
        ),
        Reach::UpTo(to) => format!(
            "{coupled}, reproduce the measured assembly up to {} Hz ({sizes}), but not above: another path couples A and B there (springs or a \
             foundation that supports both), or the joint has a mass. Use no lines above it.",
            short(to)
        ),
        Reach::Within([from, to]) => format!(
            "{coupled}, reproduce the measured assembly only from {} to {} Hz: {sizes}. Elsewhere a single stiffness does not describe what was measured: A or B changed, \
             another path couples them, or the joint is not a spring and damper.",
            short(from),
            short(to)
        ),
        Reach::Nowhere => format!(
            "{coupled}, do not reproduce the measured assembly: {sizes}. The joint is not a spring and damper, A or B changed between the configurations, \
             or another path couples them."
        ),
    };
    Check { frequency_hz: found.edge_hz(), ..Check::new(BACK_COUPLING, found.ok(), meaning) }
        .with("median_error", found.median_error)
        .with("median_explained", found.median_explained)
}

fn series_compliance(found: &SeriesCompliance) -> Check {
    let both = |sizes: &Sizes| [sizes.loops_n_per_m, sizes.fbs_n_per_m].map(|k| short(micro(k)));
    let check = |meaning: String| Check::new(SERIES_COMPLIANCE, found.ok(), meaning);
    let with = |sizes: &Sizes, check: Check| {
        check
            .with("ratio", sizes.ratio())
            .with("fbs_stiffness_n_per_m", sizes.fbs_n_per_m)
            .with("loop_stiffness_n_per_m", sizes.loops_n_per_m)
    };
    match found {
        SeriesCompliance::NotBoth => check(
            "FBS and loops are both needed to tell whether clamp and contact are in series; only one of them is available. An FBS value measured on the arms includes the clamps."
                .into(),
        ),
        SeriesCompliance::NotIdentified => check(
            "FBS did not identify a stiffness well enough to compare it with the loops: its scatter is larger than its value.".into(),
        ),
        SeriesCompliance::ClampGivesWay { sizes, compliance_m_per_n, std_m_per_n } => {
            let [loops, fbs] = both(sizes);
            let [series, low, high] = found.between_n_per_m().unwrap_or([f64::NAN; 3]);
            let meaning = format!(
                "Between the laser spots it is {} times stiffer than between the arms, where FBS measures ({loops} against {fbs} N/µm). Clamp and contact are in series, and the clamp gives way: \
                 the FBS value is not k_T. What lies between arms and contact has about {} N/µm by itself \
                 (95 % {}…{}).",
                short(sizes.ratio()),
                short(micro(series)),
                short(micro(low)),
                if high.is_finite() { short(micro(high)) } else { "∞".into() }
            );
            with(sizes, check(meaning))
                .with("series_stiffness_n_per_m", series)
                .with("series_stiffness_low_n_per_m", low)
                .with("series_stiffness_high_n_per_m", high)
                .with("series_compliance_m_per_n", *compliance_m_per_n)
                .with("series_compliance_std_m_per_n", *std_m_per_n)
        }
        SeriesCompliance::Softer(sizes) => {
            let [loops, fbs] = both(sizes);
            with(sizes, check(format!(
                "Between the laser spots it is softer than between the arms, where FBS measures ({loops} against {fbs} N/µm): no series compliance explains that. Look at the loops' shape \
                 and at the FBS methods' agreement first."
            )))
        }
        SeriesCompliance::SameSize(sizes) => {
            let [loops, fbs] = both(sizes);
            with(sizes, check(format!(
                "Between the arms, where FBS measures, and between the laser spots the stiffness is about the same ({fbs} and {loops} N/µm): there is no \
                 sign of anything much softer than the contact between them. Neither value is the contact's own."
            )))
        }
    }
}

/// Whether the contact slips under the hammer.
pub fn hammer_slip(found: &HammerSlip) -> Check {
    let meaning = match found {
        HammerSlip::Slips(scaling) => format!(
            "The contact slips under the hammer: its response per newton depends on how hard it is hit. 1 % more force changes T per newton by \
             {} %, which {}. The stiffness from the hits is not k_T: hit more gently, or load the contact more.",
            short(scaling.change_per_force),
            if scaling.chance < 1e-6 {
                "is not due to chance".into()
            } else {
                format!("a sticking contact shows once in {:.0} campaigns by chance", scaling.chance.recip())
            }
        ),
        HammerSlip::Sticks(scaling) => format!(
            "The contact sticks under the hammer: over {} hits whose forces scatter by {} %, T and the specimens' motions per newton do not depend on the force (T by \
             {} ± {} % for 1 % of force).",
            scaling.hits,
            short(100.0 * scaling.force_scatter),
            short(scaling.change_per_force),
            short(scaling.std)
        ),
        HammerSlip::CannotTell(Unclear::TooFewHits { differences, needed }) => format!(
            "It cannot be determined whether the contact slips under the hammer: {differences} hits can be compared with another hit of their cell, {needed} are needed."
        ),
        HammerSlip::CannotTell(Unclear::TooAlike { force_scatter, .. }) => format!(
            "It cannot be determined whether the contact slips under the hammer: the hits of a cell differ by only {} % in force. Vary the coil's pulse by some per cent.",
            short(100.0 * force_scatter)
        ),
    };
    let check = Check::new(HAMMER_SLIP, found.found().map(|slips| !slips), meaning);
    match found {
        HammerSlip::Slips(scaling) | HammerSlip::Sticks(scaling) => check
            .with("change_per_force", scaling.change_per_force)
            .with("change_per_force_std", scaling.std)
            .with("chance", scaling.chance)
            .with("force_scatter", scaling.force_scatter)
            .with("peak_tangential_n", scaling.peak_tangential_n),
        HammerSlip::CannotTell(_) => check,
    }
}

fn hidden_resonance(found: &HiddenResonance) -> Check {
    let check = |meaning: String| Check::new(HIDDEN_RESONANCE, found.ok(), meaning);
    let over = |peak: &ImaginaryPeak, check: Check| check.with("peak_over_level", peak.over_level);
    match found {
        HiddenResonance::NoSignals => check(
            "Hits along z on A with both specimens' vibrometers and the load cells are needed to look for a hidden resonance.".into(),
        ),
        HiddenResonance::TooFewLines => check("Too few lines between 100 and 400 Hz to look for a hidden resonance.".into()),
        HiddenResonance::Quiet(peak) => over(
            peak,
            check("Both specimens move in phase with the force between 100 and 400 Hz: there is no hidden resonance.".into()),
        ),
        HiddenResonance::Unclear(peak) => over(
            peak,
            check(format!(
                "There is some phase difference between the specimens near {} Hz, but it does not stand out enough from the noise to call it a resonance.",
                short(peak.frequency_hz)
            ))
            .at(peak.frequency_hz),
        ),
        HiddenResonance::Found(peak, split) => {
            let meaning = format!(
                "Specimen A and specimen B move out of phase near {} Hz, while the force does not: a resonance of one specimen in its clamp. Loops near it \
                 become ellipses whose slope is k_eq, not k_T.{}",
                short(peak.frequency_hz),
                split.as_ref().map_or(String::new(), phases)
            );
            let check = over(peak, check(meaning).at(peak.frequency_hz));
            let Some(split) = split else { return check };
            check
                .with("phase_specimen_a_to_b_deg", split.specimens)
                .with("phase_specimen_a_to_arm_deg", split.a)
                .with("phase_specimen_b_to_arm_deg", split.b)
                .with("phase_arm_a_to_b_deg", split.arms)
        }
    }
}

fn phases(split: &PhaseSplit) -> String {
    let degrees = |value: f64| decimals(value, 0);
    let whose = match split.moves() {
        Some(Specimen::A) => " So it is specimen A that moves in its clamp.",
        Some(Specimen::B) => " So it is specimen B that moves in its clamp.",
        None => "",
    };
    format!(
        " At {} Hz specimen A turns by {}° against specimen B; against their own arms A turns by {}° and B by {}°, and the arms by {}° \
         against each other.{whose}",
        short(split.frequency_hz),
        degrees(split.specimens),
        degrees(split.a),
        degrees(split.b),
        degrees(split.arms)
    )
}

/// Whether the fit of the contact finds places, gains, delays and directions as the plan states
/// them; a fit that is itself in doubt does not show it. That the contact changed is a check of its
/// own.
fn as_stated(all: &[Contradiction], doubted: bool) -> Check {
    let own: Vec<&Contradiction> = all.iter().filter(|one| one.cause != Cause::Drift).collect();
    if own.is_empty() && doubted {
        return Check::new(
            AS_STATED,
            None,
            "The fit of the contact is in doubt, so that it does not show whether places, gains, delays and directions are as the plan states them.",
        );
    }
    if own.is_empty() {
        return Check::new(
            AS_STATED,
            Some(true),
            "Places, gains, delays and directions are as the plan states them, within its stated errors.",
        );
    }
    let names: Vec<String> = own.iter().map(|one| contradicted_quantity(one)).collect();
    let told: Vec<String> = own.iter().map(|one| of_contradiction(one)).collect();
    Check::new(
        AS_STATED,
        Some(false),
        format!("Not as the plan states: {}. {}", names.join("; "), told.join(" ")),
    )
}

/// Standard deviations, as an rms over a cell's axes and lines, by which a predicted cell may be
/// off. A few errors, such as an aim, move all its lines together, so that this scatters more than
/// an rms of independent differences.
const PREDICTED_WITHIN: f64 = 3.0;

/// Whether cells that the fit of the contact has not seen are as it predicts them.
fn predicted(all: &[HeldOut]) -> Option<Check> {
    let worst = all.iter().max_by(|a, b| a.deviation.total_cmp(&b.deviation))?;
    let HeldOut { impact, point, deviation, part, .. } = worst;
    let largest = all.iter().map(|one| one.part).fold(0.0, f64::max);
    let off = format!(
        "{impact} × {point} is off by {} %, {} times what noise, aims and places explain",
        decimals(100.0 * part, 2),
        decimals(*deviation, 1)
    );
    let ok = *deviation < PREDICTED_WITHIN;
    let meaning = if ok {
        format!(
            "The fit of the contact predicts cells that were left out of it ({} of them) within {} % of their signals: {off}.",
            all.len(),
            decimals(100.0 * largest, 2)
        )
    } else {
        format!(
            "The fit of the contact does not predict a cell that was left out of it: {off}. Look at its hits and its place; if they are right, the bodies are \
             not as the model has them."
        )
    };
    Some(
        Check::new(PREDICTED, Some(ok), meaning)
            .with("worst_deviation", *deviation)
            .with("worst_part", *part),
    )
}

/// Whether the contact's stiffness changed from the first hits on A to the last.
fn contact_drift(found: &ContactDrift) -> Check {
    let ContactDrift { change, std, cells, .. } = *found;
    let [percent, half] = [100.0 * change, 100.0 * NORMAL_95 * std].map(|value| decimals(value, 1));
    let meaning = match found.found() {
        Some(true) => format!(
            "The contact changed between the first and the last hits on A: T over the displacement between the spots changed by {percent} ± {half} %. k_T is a \
             mean over that time, and its interval contains the change. Look for wear, for a normal load that relaxes, and for temperature."
        ),
        Some(false) => format!(
            "The contact is the same in the first and the last hits on A: T over the displacement between the spots changed by {percent} ± {half} % over {cells} cells."
        ),
        None => format!(
            "It is not clear whether the contact changed between the first and the last hits on A: T over the displacement between the spots changed by \
             {percent} ± {half} % over {cells} cells."
        ),
    };
    Check::new(STEADY, found.found().map(|changed| !changed), meaning)
        .with("change_percent", 100.0 * change)
        .with("change_std_percent", 100.0 * std)
}

fn contact_change(found: &ContactChange) -> Check {
    let ContactChange { pairs, beyond, worst, worst_at } = found;
    let where_most = format!("most at {worst_at}: {} %", short(100.0 * worst));
    let meaning = if *beyond == 0 {
        format!(
            "{pairs} levels of the shaker gave the same values before and after the hammer's cells ({where_most}): the contact did not change."
        )
    } else {
        format!(
            "{beyond} of {pairs} levels of the shaker gave other values after the hammer's cells than before ({where_most}): the contact changed \
             during the measurement, and FBS mixes both states."
        )
    };
    Check::new(UNCHANGED, Some(*beyond == 0), meaning)
        .with("worst_change_percent", 100.0 * worst)
        .with("levels", f64::from(*pairs))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::plan::level::{Held, Level};

    #[test]
    fn a_soft_clamp_is_named_with_its_stiffness() {
        let sizes = Sizes { fbs_n_per_m: 26.6e6, loops_n_per_m: 180e6 };
        let check = series_compliance(&SeriesCompliance::ClampGivesWay {
            sizes,
            compliance_m_per_n: 1.0 / 31.2e6,
            std_m_per_n: 1.42e-9,
        });
        assert!((check.values["series_stiffness_n_per_m"] / 31.2e6 - 1.0).abs() < 1e-9);
        assert!(check.meaning.contains("not k_T") && check.meaning.contains("in series"));
        assert_eq!(check.values.len(), 8);
        // an interval without an upper end is stated in words, not as a number
        let open = SeriesCompliance::ClampGivesWay { sizes, compliance_m_per_n: 1e-9, std_m_per_n: 1e-8 };
        let open = series_compliance(&open);
        assert!(open.meaning.contains("…∞") && open.values.len() == 7, "{open:?}");
    }

    #[test]
    fn what_the_data_contradict_is_named_first() {
        let of = |what: &str, cause, off: f64| Contradiction {
            what: what.into(),
            cause,
            off: vec![[off, 0.1 * off]],
            scatter: None,
            exchanged_with: None,
        };
        let gain = of("gain of the vibrometer on A's spot", Cause::Gains, 0.043);
        let path = of("2.8 N/µm", Cause::SecondPath, 0.1);
        let check = as_stated(&[gain, path, of("the contact", Cause::Drift, 0.1)], false);
        assert_eq!((check.name.as_str(), check.ok), (AS_STATED, Some(false)));
        assert_eq!(
            super::super::brief::failed(&check),
            "Not as the plan states: the gain of the vibrometer on A's spot; a second path beside the contact."
        );
        let told = &check.meaning;
        assert!(told.contains("4.3 %") && told.contains("2.8 N/µm") && !told.contains("changed"), "{told}");
        assert_eq!(as_stated(&[], false).ok, Some(true));
        // a doubted fit may have put everything where the plan has it by mistake
        assert_eq!(as_stated(&[], true).ok, None);
    }

    #[test]
    fn the_specimen_that_leaves_its_arm_is_named() {
        let peak = ImaginaryPeak { frequency_hz: 192.0, over_level: 0.9, over_median: 9.0 };
        let plain = hidden_resonance(&HiddenResonance::Found(peak, None));
        assert_eq!((plain.ok, plain.frequency_hz), (Some(false), Some(192.0)));
        for (a, b, name) in [(40.0, 2.0, "specimen A"), (-2.0, -40.0, "specimen B")] {
            let split = PhaseSplit { frequency_hz: 193.0, specimens: a - b, a, b, arms: 0.0 };
            let check = hidden_resonance(&HiddenResonance::Found(peak, Some(split)));
            assert!(check.meaning.starts_with(&plain.meaning));
            assert!(check.meaning.contains(&format!("it is {name} that moves")), "{}", check.meaning);
            assert_eq!(check.values["phase_specimen_a_to_b_deg"], a - b);
        }
    }

    #[test]
    fn a_path_above_a_frequency_is_named_with_it() {
        let of = |reach| back_coupled(&BackCoupled { reach, median_error: 0.02, median_explained: 0.06 });
        let path = of(Reach::UpTo(699.0));
        assert_eq!((path.ok, path.frequency_hz), (Some(false), Some(699.0)));
        assert!(path.meaning.contains("Use no lines above"), "{}", path.meaning);
        assert!(of(Reach::Nowhere).meaning.contains("do not reproduce"));
        assert_eq!(of(Reach::Doubtful).values["median_explained"], 0.06);
    }

    #[test]
    fn wear_is_told_with_the_level_that_shows_it() {
        let worst_at =
            Level { frequency_hz: 300.0, end_hz: None, held: Held::Displacement, amplitude: 1.5e-7 };
        let worn = contact_change(&ContactChange { pairs: 2, beyond: 1, worst: -0.17, worst_at });
        assert_eq!(worn.ok, Some(false));
        assert!(worn.meaning.contains("1 of 2") && worn.meaning.contains("300 Hz"), "{}", worn.meaning);
    }
}

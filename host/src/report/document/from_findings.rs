//! Converts findings to the format of the results: the answer, the joint by substructuring and the
//! contact by loops.

use crate::analyse::{Contact, Findings, ImpactLoops, RecordLoops, Row, SlopeIs, Substructured};
use crate::contact::{self, HeldOut, Interval, Stiffness};
use crate::hysteresis::{Kind, LoopAnalysis, OverCycles};
use crate::report::words::check_sentences::hammer_slip;
use crate::report::words::{answer_sentences as say, level_sentences, warning_sentences};
use crate::results::{
    Answer, Basis, BetweenArms, Clamp, ContactAnswer, DIRECT, DecayStep, Force, Goodness, Hysteresis, Joint,
    JointSpectrum, Refusal, Slip, SpectrumCurve, ranges, rounded,
};
use crate::substructuring::between_arms::Basis as Estimate;
use crate::substructuring::direct::Direct;
use crate::substructuring::fit::Fitted;
use crate::substructuring::joint_over_bands::NORMAL_95;
use crate::substructuring::{BandStatistic, Dof, JointRow, fit};
use std::collections::BTreeMap;

/// The rows, and what was refused: line-by-line methods, fits, T/Δx.
pub fn joint_rows(found: &Findings) -> (Vec<Joint>, Vec<Refusal>) {
    let of_frfs = found.substructured.as_ref();
    let mut joint: Vec<Joint> = of_frfs.iter().flat_map(|s| &s.rows).map(by_line).collect();
    let refusal = |method: &str, idms, reason| Refusal { method: method.into(), idms, reason };
    let mut refused: Vec<Refusal> = (of_frfs.iter().flat_map(|s| &s.refused))
        .map(|r| refusal(r.method.name(), r.idms, r.reason.clone()))
        .collect();
    for one in &found.fits {
        match &one.outcome {
            Ok(fitted) => joint.push(by_fit(fitted)),
            Err(why) => refused.push(refusal(fit::NAME, one.idms.count(), warning_sentences::no_fit(why))),
        }
    }
    joint.extend(found.contact.as_ref().and_then(|contact| contact.direct.as_ref()).map(at_the_specimens));
    (joint, refused)
}

fn by_line(row: &Row) -> Joint {
    let mut joint = of_row(&row.joint);
    joint.noise_n_per_m = row.noise_n_per_m.iter().map(|(dof, noise)| (dof.name().into(), *noise)).collect();
    if let Some((k, noise)) = joint.sliding_stiffness().zip(joint.noise_n_per_m.get("z")) {
        joint.warnings.extend(warning_sentences::loud_noise(k.median, *noise));
    }
    joint
}

fn by_fit(fitted: &Fitted) -> Joint {
    let goodness = Goodness {
        chi_square_per_dof: fitted.chi_square_per_dof,
        largest_error: fitted.largest_error,
        settled: fitted.converged,
    };
    Joint { goodness: Some(goodness), ..of_row(&fitted.row()) }
}

fn at_the_specimens(found: &Direct) -> Joint {
    let along_z = |s| BTreeMap::from([("z".to_owned(), s)]);
    Joint {
        method: DIRECT.into(),
        band_hz: found.band_hz,
        stiffness_n_per_m: along_z(found.stiffness_n_per_m),
        damping_n_s_per_m: along_z(found.damping_n_s_per_m),
        lines: found.lines,
        warnings: warning_sentences::direct(found),
        ..Joint::default()
    }
}

fn of_row(row: &JointRow) -> Joint {
    let finite = |s: &BandStatistic| s.mean.is_finite() && s.std.is_finite();
    let split = |all: &BTreeMap<Dof, BandStatistic>, is: fn(Dof) -> bool| {
        all.iter()
            .filter(|(dof, s)| is(**dof) && finite(s))
            .map(|(dof, s)| (dof.name().to_owned(), *s))
            .collect::<BTreeMap<String, BandStatistic>>()
    };
    let coupling = |all: &BTreeMap<String, BandStatistic>| {
        all.iter().filter(|(_, s)| finite(s)).map(|(pair, s)| (pair.clone(), *s)).collect()
    };
    Joint {
        method: row.method.clone(),
        idms: row.idms,
        modes: row.modes.clone(),
        band_hz: row.band_hz,
        stiffness_n_per_m: split(&row.stiffness_n_per_m, Dof::is_translation),
        damping_n_s_per_m: split(&row.damping_n_s_per_m, Dof::is_translation),
        stiffness_n_m_per_rad: split(&row.stiffness_n_per_m, Dof::is_rotation),
        damping_n_m_s_per_rad: split(&row.damping_n_s_per_m, Dof::is_rotation),
        stiffness_flexible_si: split(&row.stiffness_n_per_m, Dof::is_flexible),
        coupling_si: coupling(&row.coupling_si),
        coupling_damping_si: coupling(&row.coupling_damping_si),
        lines: row.lines,
        warnings: row.warnings.clone(),
        ..Joint::default()
    }
}

/// Significant digits of a curve: FRFs have six digits.
const DIGITS: i32 = 6;
/// Digits of a line's standard deviation, which a few hits determine to a tenth at best.
const NOISE_DIGITS: i32 = 3;
/// Digits of a line's damping, which scatters more than its stiffness; all means are computed
/// before rounding.
const DAMPING_DIGITS: i32 = 4;

/// Translations line by line, as shown in the figures. `None` if nothing was identified.
pub fn spectrum(found: &Substructured) -> Option<JointSpectrum> {
    let mut curves = Vec::new();
    for (spectrum, noise) in &found.spectra {
        for (dof, stiffness) in spectrum.stiffness_n_per_m.iter().filter(|(dof, _)| dof.is_translation()) {
            let noise = noise.as_ref().and_then(|noise| noise.stiffness_n_per_m.get(dof));
            curves.push(SpectrumCurve {
                method: spectrum.method.clone(),
                idms: spectrum.idms,
                dof: dof.name().into(),
                stiffness_n_per_m: column(Some(stiffness), DIGITS),
                stiffness_noise_n_per_m: column(noise, NOISE_DIGITS),
                damping_n_s_per_m: column(spectrum.damping_n_s_per_m.get(dof), DAMPING_DIGITS),
            });
        }
    }
    let frequency_hz = found.frequency_hz.clone();
    (!frequency_hz.is_empty()).then_some(JointSpectrum { frequency_hz, curves })
}

fn column(values: Option<&Vec<f64>>, digits: i32) -> Vec<Option<f64>> {
    values.map_or_else(Vec::new, |v| v.iter().map(|v| v.is_finite().then(|| rounded(*v, digits))).collect())
}

/// The answer of a campaign; `None` if no campaign was analysed.
pub fn answer(found: &Findings) -> Option<Answer> {
    let own = found.own_stiffness.as_ref()?;
    let slip = slip(found);
    let contact = match own {
        Ok(own) => {
            let joint = found.contact.as_ref().and_then(|contact| contact.joint.as_ref());
            of_stiffness(own, joint, slip.found == Some(true))
        }
        Err(_) if slip.found == Some(true) => unknown(say::slipping()),
        Err(error) => unknown(say::capital(&error.to_string())),
    };
    let between_arms = between_arms(found);
    let clamp = contact.k_t_n_per_m.zip(between_arms.k_n_per_m).and_then(|(own, whole)| clamp(own, whole));
    Some(Answer { contact, between_arms, clamp, slip, truth: None })
}

fn of_stiffness(own: &Stiffness, joint: Option<&contact::Joint>, slips: bool) -> ContactAnswer {
    let trusted = own.doubts.is_empty() && !slips;
    let joint = joint.filter(|_| trusted);
    let (k_t, budget) = joint.map_or((own.k_t_n_per_m, &own.budget), |both| (both.k_t_n_per_m, &both.budget));
    ContactAnswer {
        k_t_n_per_m: trusted.then_some(k_t),
        c_t_n_s_per_m: trusted.then_some(own.c_t_n_s_per_m),
        basis: match (trusted, joint) {
            (false, _) => Basis::None,
            (true, None) => Basis::SpecimenPoints,
            (true, Some(_)) => Basis::Joint,
        },
        band_hz: Some(own.band_hz.into()),
        budget: budget.iter().map(|(cause, share)| (cause.name(), *share)).collect(),
        why: match (trusted, slips) {
            (true, _) => say::identified(own, budget, joint.map_or(0, |both| both.levels)),
            (_, true) => say::slipping(),
            _ => say::doubted(own),
        },
        of_frequency: if trusted { own.of_frequency.clone() } else { Vec::new() },
        held_out: own.held_out.iter().map(shortened).collect(),
        diagnosis: Some(own.diagnosis.clone()),
        contradictions: own.contradictions.clone(),
        doubts: own.doubts.clone(),
    }
}

/// Rounded to the digits of a curve.
fn shortened(one: &HeldOut) -> HeldOut {
    let short = |all: &[f64]| all.iter().map(|value| rounded(*value, DIGITS)).collect();
    HeldOut {
        frequency_hz: short(&one.frequency_hz),
        measured_m_per_n: short(&one.measured_m_per_n),
        predicted_m_per_n: short(&one.predicted_m_per_n),
        off: short(&one.off),
        half_width: short(&one.half_width),
        deviation: rounded(one.deviation, NOISE_DIGITS),
        part: rounded(one.part, NOISE_DIGITS),
        ..one.clone()
    }
}

fn unknown(why: String) -> ContactAnswer {
    ContactAnswer {
        k_t_n_per_m: None,
        c_t_n_s_per_m: None,
        basis: Basis::None,
        band_hz: None,
        budget: std::collections::BTreeMap::new(),
        why,
        of_frequency: Vec::new(),
        held_out: Vec::new(),
        diagnosis: None,
        contradictions: Vec::new(),
        doubts: Vec::new(),
    }
}

fn between_arms(found: &Findings) -> BetweenArms {
    match &found.between_arms {
        Some(Ok(between)) => BetweenArms {
            k_n_per_m: Some(Interval { mean: between.stiffness_n_per_m, ci95: between.ci95 }),
            basis: match between.basis {
                Estimate::Fit => "fit",
                Estimate::Recommended => "recommended",
            },
            why: say::between_the_arms(between.basis),
        },
        // without all three configurations there is no estimate
        Some(Err(_)) if found.substructured.is_none() => {
            BetweenArms { k_n_per_m: None, basis: "none", why: say::without_all_three() }
        }
        Some(Err(why)) => BetweenArms { k_n_per_m: None, basis: "none", why: say::capital(&why.to_string()) },
        None => BetweenArms { k_n_per_m: None, basis: "none", why: say::not_looked_for() },
    }
}

/// The compliance of the whole minus that of the contact; `None` unless it is significant.
fn clamp(own: Interval, whole: Interval) -> Option<Clamp> {
    let compliance = whole.mean.recip() - own.mean.recip();
    let sigma = |i: Interval| (i.ci95[0].recip() - i.ci95[1].recip()) / (2.0 * NORMAL_95);
    let half = NORMAL_95 * sigma(own).hypot(sigma(whole));
    (compliance > half).then(|| Clamp {
        k_n_per_m: Interval {
            mean: compliance.recip(),
            ci95: [(compliance + half).recip(), (compliance - half).recip()],
        },
    })
}

fn slip(found: &Findings) -> Slip {
    found.contact.as_ref().map_or_else(
        || Slip { found: None, why: say::not_looked_for() },
        |contact| Slip { found: contact.slip.found(), why: hammer_slip(&contact.slip).meaning },
    )
}

/// The impacts together, the shaker's levels, and a separate record: each with the raw force, then
/// with the corrected one.
pub fn loop_rows(found: &Findings) -> Vec<Hysteresis> {
    let contact = found.contact.as_ref();
    let mut rows: Vec<Hysteresis> =
        contact.and_then(|contact| contact.impacts.as_ref()).map_or_else(Vec::new, of_impacts);
    let levels = contact.map_or(&[][..], |contact| &contact.levels);
    rows.extend(of_records(levels, contact.and_then(|contact: &Contact| contact.hidden.resonance_hz())));
    rows.extend(of_records(found.record.as_slice(), None));
    rows
}

fn of_impacts(impacts: &ImpactLoops) -> Vec<Hysteresis> {
    let warnings = warning_sentences::impact_loops(impacts);
    let row = |force, slope: OverCycles, decay: &[DecayStep]| Hysteresis {
        force,
        kind: Kind::Impact,
        frequency_hz: impacts.frequency_hz,
        amplitude_m: impacts.amplitude_m,
        shape: impacts.shape,
        k_t_n_per_m: None,
        c_t_n_s_per_m: None,
        k_t_budget: None,
        k_t_why: None,
        slope_between_spots_n_per_m: (impacts.slope_is == SlopeIs::Contact).then_some(slope),
        stick_part: None,
        k_eq_n_per_m: Some(slope),
        k_secant_n_per_m: None,
        k_fundamental_n_per_m: None,
        // the first cycle of a decay is not closed
        energy_j: None,
        friction_limit_n: None,
        friction_limit_ci95_n: None,
        friction_coefficient: None,
        friction_coefficient_ci95: None,
        phase_deg: impacts.phase_deg,
        shape_evidence: None,
        decay_cycles: Vec::new(),
        decay: decay.to_vec(),
        level: None,
        moment: None,
        records: ranges(impacts.records.iter().copied()),
        findings: Vec::new(),
        warnings: warnings.clone(),
    };
    let mut rows = vec![row(Force::Raw, impacts.slope_n_per_m, &impacts.decay)];
    rows.extend(impacts.corrected_n_per_m.map(|slope| row(Force::Corrected, slope, &[])));
    rows
}

/// All rows with the raw force, then all with the corrected one; `resonance_hz` is a resonance of a
/// specimen, which affects Δx at every frequency.
fn of_records(records: &[RecordLoops], resonance_hz: Option<f64>) -> Vec<Hysteresis> {
    let row = |one: &RecordLoops, found: &LoopAnalysis, force| {
        let mut row = of_record(found, force);
        if one.level.is_some() {
            row = row.between_spots();
        }
        (row.level, row.moment) = (one.level.map(|(id, _)| id), one.level.map(|(_, moment)| moment.name()));
        if let (Some(_), Some(resonance_hz)) = (found.k_t_n_per_m, resonance_hz) {
            row.warnings.push(warning_sentences::beside_resonance(found.frequency_hz, resonance_hz));
        }
        row
    };
    let raw = records.iter().map(|one| at_the_contact(row(one, &one.raw, Force::Raw), one));
    let corrected = |one: &RecordLoops| Some(row(one, one.corrected.as_ref()?, Force::Corrected));
    raw.chain(records.iter().filter_map(corrected)).collect()
}

/// The row of a level, with the results for the contact alone added.
fn at_the_contact(row: Hysteresis, one: &RecordLoops) -> Hysteresis {
    match &one.own {
        None => row,
        Some(Err(why)) => Hysteresis { k_t_why: Some(level_sentences::none(why)), ..row },
        Some(Ok(own)) => {
            let k = own.k_t_n_per_m;
            let (std, cycles) = (own.std_n_per_m, one.raw.k_eq_n_per_m.cycles);
            Hysteresis {
                k_t_n_per_m: Some(OverCycles { mean: k.mean, std, cycles, ci95: Some(k.ci95) }),
                c_t_n_s_per_m: Some(own.c_t_n_s_per_m),
                k_t_budget: Some(own.shares),
                k_t_why: Some(level_sentences::corrected(&own.shares, own.correction)),
                ..row
            }
        }
    }
}

/// One record's loops with this force.
fn of_record(found: &LoopAnalysis, force: Force) -> Hysteresis {
    Hysteresis {
        force,
        kind: found.kind,
        frequency_hz: Some(found.frequency_hz),
        amplitude_m: Some(found.amplitude_m),
        shape: found.shape,
        k_t_n_per_m: found.k_t_n_per_m,
        c_t_n_s_per_m: None,
        k_t_budget: None,
        k_t_why: None,
        slope_between_spots_n_per_m: None,
        stick_part: found.stick_part,
        k_eq_n_per_m: Some(found.k_eq_n_per_m),
        k_secant_n_per_m: found.k_secant_n_per_m,
        k_fundamental_n_per_m: found.k_fundamental_n_per_m.map(num_complex::Complex::norm),
        energy_j: found.energy_j,
        friction_limit_n: found.friction_limit_n,
        friction_limit_ci95_n: found.friction_limit_ci95_n,
        friction_coefficient: found.friction_coefficient,
        friction_coefficient_ci95: found.friction_coefficient_ci95,
        phase_deg: Some(found.phase_deg),
        shape_evidence: found.shape_evidence,
        decay_cycles: found.decay_cycles.clone(),
        decay: Vec::new(),
        level: None,
        moment: None,
        records: Vec::new(),
        findings: found.findings.clone(),
        warnings: found
            .warnings
            .iter()
            .cloned()
            .chain(found.findings.iter().map(warning_sentences::loop_finding))
            .collect(),
    }
}

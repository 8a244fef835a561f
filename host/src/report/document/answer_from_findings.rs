//! Builds the answer from the findings.

use crate::analyse::Findings;
use crate::contact::{Interval, Joint, Stiffness};
use crate::report::words::answer_sentences as say;
use crate::report::words::check_sentences::hammer_slip;
use crate::results::{Answer, Basis, BetweenArms, Clamp, ContactAnswer, Slip};
use crate::substructuring::between_arms::Basis as Estimate;
use crate::substructuring::joint_over_bands::NORMAL_95;

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

fn of_stiffness(own: &Stiffness, joint: Option<&Joint>, slips: bool) -> ContactAnswer {
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
            (true, _) => say::identified(budget, joint.map_or(0, |both| both.levels)),
            (_, true) => say::slipping(),
            _ => say::doubted(own),
        },
        of_frequency: if trusted { own.of_frequency.clone() } else { Vec::new() },
        diagnosis: Some(own.diagnosis.clone()),
        doubts: own.doubts.clone(),
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
        diagnosis: None,
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

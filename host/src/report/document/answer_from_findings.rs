//! The answer, from what was found.

use crate::analyse::Findings;
use crate::contact::{ContactError, Interval, Stiffness};
use crate::report::words::answer_sentences::{self as say, Unanswered};
use crate::results::{Answer, Basis, BetweenArms, Clamp, ContactAnswer, MAIN_BAND, Slip};
use crate::substructuring::Dof;
use crate::substructuring::joint_over_bands::NORMAL_95;

/// The answer of a campaign; none where no campaign was analysed.
pub fn answer(found: &Findings) -> Option<Answer> {
    let own = found.own_stiffness.as_ref()?;
    let contact = match own {
        Ok(own) => of_stiffness(own),
        Err(error) => unknown(error),
    };
    let between_arms = between_arms(found);
    let clamp = contact.k_t_n_per_m.zip(between_arms.k_n_per_m).and_then(|(own, whole)| clamp(own, whole));
    Some(Answer { contact, between_arms, clamp, slip: slip(found), truth: None })
}

fn of_stiffness(own: &Stiffness) -> ContactAnswer {
    let trusted = own.doubts.is_empty();
    ContactAnswer {
        k_t_n_per_m: trusted.then_some(own.k_t_n_per_m),
        c_t_n_s_per_m: trusted.then_some(own.c_t_n_s_per_m),
        basis: if trusted { Basis::SpecimenPoints } else { Basis::None },
        band_hz: Some(own.band_hz.into()),
        budget: own.budget.iter().map(|(cause, share)| (cause.name(), *share)).collect(),
        why: if trusted { say::identified(own) } else { say::doubted(own) },
        of_frequency: own.of_frequency.clone(),
        diagnosis: Some(own.diagnosis.clone()),
        doubts: own.doubts.clone(),
    }
}

fn unknown(error: &ContactError) -> ContactAnswer {
    ContactAnswer {
        k_t_n_per_m: None,
        c_t_n_s_per_m: None,
        basis: Basis::None,
        band_hz: None,
        budget: std::collections::BTreeMap::new(),
        why: say::unanswered(&Unanswered::Contact(error)),
        of_frequency: Vec::new(),
        diagnosis: None,
        doubts: Vec::new(),
    }
}

fn between_arms(found: &Findings) -> BetweenArms {
    let quoted = found.recommended.iter().find(|r| r.band_hz == MAIN_BAND);
    let z = quoted.and_then(|r| r.joint.get(&Dof::Z)).filter(|z| z.identified);
    match z {
        Some(z) => BetweenArms {
            k_n_per_m: Some(Interval { mean: z.stiffness, ci95: z.ci95 }),
            basis: "recommended",
            why: say::between_the_arms(),
        },
        None => {
            BetweenArms { k_n_per_m: None, basis: "none", why: say::unanswered(&Unanswered::BetweenArms) }
        }
    }
}

/// What is left of the whole's compliance when the contact's is taken away; none unless that is clearly something.
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

fn slip(_found: &Findings) -> Slip {
    Slip { found: None, why: say::unanswered(&Unanswered::Slip) }
}

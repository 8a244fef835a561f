//! Which law the loops support.
//!
//! Every law is fitted. A law is refused when its residuals contradict the noise, when it loses or
//! gains energy, when a parameter is not determined, or when another law explains the same loops
//! better by far. The law to use is the one with the smallest criterion, unless it is refused:
//! then there is none.

use super::fit::{FittedLaw, FittedLoop, fit};
use super::law::LawKind;
use super::{FrictionError, MeasuredLoop};
use serde::Serialize;

/// Residuals contradict the noise beyond this many standard deviations: a right law is refused in
/// about 1 of 1000 fits by each of the two measures.
pub const CONTRADICTS: f64 = 3.1;

/// Largest relative difference between the energies of law and loop, if it exceeds three standard
/// deviations of the measured one.
pub const ENERGY: f64 = 0.02;

/// Another law is better by far if its criterion is smaller by this much (Kass & Raftery, J. Am.
/// Stat. Assoc. 90 (1995) 773: above 10 is very strong).
pub const DECISIVE: f64 = 10.0;

/// Why a law is not accepted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "refused")]
#[non_exhaustive]
pub enum LawRefusal {
    /// The residuals contradict the noise.
    Residual {
        /// By how many standard deviations their squares exceed the noise's.
        excess: f64,
        /// The same for their smooth part.
        smooth_excess: f64,
    },
    /// The law's loop has another energy.
    Energy {
        /// Amplitude of the loop, m.
        amplitude_m: f64,
        /// Energy of the law over the measured one, less 1.
        change: f64,
    },
    /// The loops do not determine all parameters: one of them is not identified, or none
    /// of the loops dissipates more than three standard deviations of its energy.
    NotDetermined,
    /// Another law explains the loops better by far.
    Evidence {
        /// By how much the criterion is larger than the smallest.
        behind: f64,
    },
}

/// A law of the choice.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JudgedLaw {
    /// The law.
    #[serde(flatten)]
    pub fit: FittedLaw,
    /// Probability among the fitted laws, all equally likely before: exp(−BIC/2), normalised.
    pub weight: f64,
    /// Why it is not accepted; empty if it is.
    pub refusals: Vec<LawRefusal>,
}

/// The laws that were fitted to the loops of one contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LawChoice {
    /// All, the smallest criterion first.
    pub laws: Vec<JudgedLaw>,
}

impl LawChoice {
    /// The law to use; `None` if the best one is refused.
    pub fn chosen(&self) -> Option<&JudgedLaw> {
        self.laws.first().filter(|law| law.refusals.is_empty())
    }
}

/// Fits these laws to the loops of one contact and judges them. A law that cannot be fitted at all
/// is left out.
///
/// # Errors
/// No loops, or no law that can be fitted.
pub fn choose(kinds: &[LawKind], loops: &[MeasuredLoop]) -> Result<LawChoice, FrictionError> {
    let mut fits = Vec::new();
    let mut failed = FrictionError::NoLoops;
    for &kind in kinds {
        match fit(kind, loops) {
            Ok(found) => fits.push(found),
            Err(error) => failed = error,
        }
    }
    fits.sort_by(|a, b| a.bic.total_cmp(&b.bic));
    let least = fits.first().ok_or(failed)?.bic;
    let share = |fit: &FittedLaw| (-0.5 * (fit.bic - least)).exp();
    let all: f64 = fits.iter().map(share).sum();
    let judged = |fit: FittedLaw| {
        let mut refusals = refusals(&fit);
        let behind = fit.bic - least;
        if behind > DECISIVE {
            refusals.push(LawRefusal::Evidence { behind });
        }
        JudgedLaw { weight: share(&fit) / all, refusals, fit }
    };
    Ok(LawChoice { laws: fits.into_iter().map(judged).collect() })
}

/// What a fit by itself is refused for.
fn refusals(fit: &FittedLaw) -> Vec<LawRefusal> {
    let mut found = Vec::new();
    let FittedLaw { excess, smooth_excess, .. } = *fit;
    if excess > CONTRADICTS || smooth_excess > CONTRADICTS {
        found.push(LawRefusal::Residual { excess, smooth_excess });
    }
    let change = |one: &FittedLoop| one.law_energy_j / one.energy_j - 1.0;
    let worst = fit
        .loops
        .iter()
        .filter(|one| (one.law_energy_j - one.energy_j).abs() > 3.0 * one.energy_std_j)
        .max_by(|a, b| change(a).abs().total_cmp(&change(b).abs()));
    if let Some(one) = worst.filter(|one| change(one).abs() > ENERGY) {
        found.push(LawRefusal::Energy { amplitude_m: one.amplitude_m, change: change(one) });
    }
    // a limit just below the largest noise would look determined
    let sticks = fit.loops.iter().all(|one| one.law_energy_j < 3.0 * one.energy_std_j);
    if sticks || fit.covariance.is_none() || fit.parameters.iter().any(|parameter| !parameter.identified) {
        found.push(LawRefusal::NotDetermined);
    }
    found
}

//! The stiffness between the arms along z: one of two estimates, or the reason why neither can be
//! given.
//!
//! `fit` uses more information: errors that are common to all cells and configurations, and the
//! noise of all three configurations. If its model does not hold, the fit detects it. The
//! recommended estimate (Eq. A.1, averaged) needs the assembly only. It is used if the fit's model
//! holds but its interval is too wide. It is not used if the fit's model failed or no fit was made:
//! on random rigs with a lever between clamp and contact, or with a specimen that resonates between
//! the arms, it was wrong by up to a third, with an interval of 4 %.
//!
//! A specimen that turns in its clamp has a mode, and above it the lever between clamp and contact
//! no longer gives way: the lines of the band can then show a spring, but not the static one. On 50
//! random rigs with levers of 0.1 to 1.5 mm the fit's model held on ten in 300–600 Hz, with
//! stiffnesses up to four times the static one. So the same model must also hold in the lines below
//! the band ([`BELOW`]): on all of those rigs it fails there.
//!
//! Both estimate the static compliance along z of everything between the virtual points, contact
//! and clamps in series, including the tilt of the clamps with their lever arms: 1/C_zz. `fit` uses
//! the diagonal form of the joint. The joint's rotational stiffnesses are negligible against the
//! arms' inertia, so the couplings of a leaning clamp act on z through a lever arm of hundredths of
//! a millimetre only, and the full form would spend thirty more parameters on them.

use super::averaged::Averaged;
use super::fit::{FitError, Fitted};
use super::idm::Dof;
use crate::band::Band;
use serde::Serialize;

/// χ² per degree of freedom up to which a fit is accepted; its interval is widened by the square
/// root of it.
pub const BELIEVED: f64 = 4.0;
/// The lines below the main band in which the fit's model must hold too, Hz.
pub const BELOW: Band = Band { low_hz: 100.0, high_hz: 300.0 };
/// The recommended estimate is rejected if noise alone would have changed it by more than this
/// fraction. A correction that large is computed from FRFs with noise of the same size, and was
/// found to be wrong by as much.
pub const MOVED: f64 = 0.05;
/// Two results contradict each other if they differ by more than this many standard deviations of
/// their difference.
const APART: f64 = 4.0;

/// The estimate that the result is taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// Maximum likelihood over A, B and AJB.
    Fit,
    /// Eq. (A.1) of the assembly, averaged as a compliance.
    Recommended,
}

/// The stiffness between the arms along z.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BetweenArms {
    /// Stiffness, N/m.
    pub stiffness_n_per_m: f64,
    /// Its 95 % interval, N/m.
    pub ci95: [f64; 2],
    /// The estimate that it is taken from.
    pub basis: Basis,
}

/// The reason why an estimate gives no stiffness along z.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Unfit {
    /// It was not made.
    #[error("it was not made")]
    NotMade,
    /// The fit ended without a result.
    #[error("{0}")]
    Failed(FitError),
    /// The model of a spring and a damper between A and B does not describe the data.
    #[error(
        "the residuals are {:.1} times what noise and errors of position allow, so the arms are not connected by a spring and damper alone, or A or B changed",
        chi_square.sqrt()
    )]
    Misfit {
        /// χ² per degree of freedom.
        chi_square: f64,
    },
    /// The model holds in the band, but not below it.
    #[error(
        "the residuals from {:.0} to {:.0} Hz are {:.1} times what noise and errors of position allow, so something between the arms has a mode below the band, and the stiffness above it is not the static one",
        BELOW.low_hz, BELOW.high_hz, chi_square.sqrt()
    )]
    Below {
        /// χ² per degree of freedom below the band.
        chi_square: f64,
    },
    /// The model was not tested below the band.
    #[error("whether something between the arms has a mode below the band was not tested: {0}")]
    UncheckedBelow(FitError),
    /// No fit has tested its model.
    #[error(
        "it was not tested whether a spring and a damper alone connect the arms: measure A and B alone as well"
    )]
    Unchecked,
    /// It relies on the model that failed in the fit.
    #[error("its model failed in the fit: the arms are not connected by a spring and damper alone")]
    SameModel,
    /// Noise or errors of geometry leave no narrow interval.
    #[error("the data give only a lower limit, {:.0} N/µm", low_n_per_m * 1e-6)]
    NotIdentified {
        /// The lower limit that is left, N/m.
        low_n_per_m: f64,
    },
    /// The noise of the FRFs is not known, so the interval would contain only part of the errors.
    #[error("the noise of the FRFs is not known")]
    NoiseUnknown,
    /// Noise changes the estimate by more than can be corrected.
    #[error("noise alone shifts it by {:.0} %, which is too much to be corrected", fraction * 100.0)]
    Moved {
        /// Fraction of the stiffness.
        fraction: f64,
    },
}

impl Unfit {
    /// Whether the model failed, as opposed to the data being too imprecise.
    fn is_model(&self) -> bool {
        matches!(self, Unfit::Misfit { .. } | Unfit::Failed(FitError::Misfit { .. }))
    }
}

/// The reason why there is no stiffness between the arms.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoStiffness {
    /// Neither estimate holds.
    #[error("not identified: by the fit, {fit}; by the assembly alone, {recommended}")]
    Neither {
        /// Why the fit gives none.
        fit: Unfit,
        /// Why the recommended estimate gives none.
        recommended: Unfit,
    },
    /// Both hold, and contradict each other.
    #[error(
        "not identified: the fit says {:.1} N/µm and the assembly alone {:.1}, further apart than both intervals allow; A or B is not the same alone as in the assembly",
        fit_n_per_m * 1e-6, recommended_n_per_m * 1e-6
    )]
    Contradiction {
        /// Stiffness from the fit, N/m.
        fit_n_per_m: f64,
        /// The recommended estimate, N/m.
        recommended_n_per_m: f64,
    },
}

/// Decides between the outcome of [`fit`](super::fit::fit) and the recommended estimate for the
/// same band and modes; `None` if one was not made. `below` fits the lines of [`BELOW`]; it is
/// called if there is a stiffness to be confirmed.
///
/// # Errors
/// [`NoStiffness`] if neither holds, or both contradict each other.
pub fn between_arms(
    fit: Option<Result<&Fitted, &FitError>>,
    recommended: Option<&Averaged>,
    below: impl FnOnce() -> Result<Fitted, FitError>,
) -> Result<BetweenArms, NoStiffness> {
    let found = match (by_fit(fit), by_assembly(recommended)) {
        // with a specimen that resonates between the arms the mean compliance has a narrow interval
        // and is wrong
        (Err(misfit), _) if misfit.is_model() => {
            Err(NoStiffness::Neither { fit: misfit, recommended: Unfit::SameModel })
        }
        (Err(fit @ (Unfit::NotMade | Unfit::Failed(_))), Ok(_)) => {
            Err(NoStiffness::Neither { fit, recommended: Unfit::Unchecked })
        }
        (Ok(fit), Ok(other)) if apart(&fit, &other) > APART => Err(NoStiffness::Contradiction {
            fit_n_per_m: fit.stiffness_n_per_m,
            recommended_n_per_m: other.stiffness_n_per_m,
        }),
        (Ok(found), _) | (Err(_), Ok(found)) => Ok(found),
        (Err(fit), Err(recommended)) => Err(NoStiffness::Neither { fit, recommended }),
    }?;
    let fit = match below() {
        Ok(fit) if fit.chi_square_per_dof <= BELIEVED => return Ok(found),
        Ok(Fitted { chi_square_per_dof: chi_square, .. }) | Err(FitError::Misfit { chi_square }) => {
            Unfit::Below { chi_square }
        }
        Err(error) => Unfit::UncheckedBelow(error),
    };
    Err(NoStiffness::Neither { fit, recommended: Unfit::SameModel })
}

fn by_fit(fit: Option<Result<&Fitted, &FitError>>) -> Result<BetweenArms, Unfit> {
    let fit = fit.ok_or(Unfit::NotMade)?.map_err(|error| Unfit::Failed(error.clone()))?;
    let z = fit.joint.get(&Dof::Z).ok_or(Unfit::NotMade)?;
    if fit.chi_square_per_dof > BELIEVED {
        return Err(Unfit::Misfit { chi_square: fit.chi_square_per_dof });
    }
    if !z.identified {
        return Err(Unfit::NotIdentified { low_n_per_m: z.ci95[0].max(0.0) });
    }
    Ok(BetweenArms { stiffness_n_per_m: z.stiffness, ci95: z.ci95, basis: Basis::Fit })
}

fn by_assembly(recommended: Option<&Averaged>) -> Result<BetweenArms, Unfit> {
    let recommended = recommended.ok_or(Unfit::NotMade)?;
    let z = recommended.joint.get(&Dof::Z).ok_or(Unfit::NotMade)?;
    if !recommended.noise_known {
        return Err(Unfit::NoiseUnknown);
    }
    if !z.identified {
        return Err(Unfit::NotIdentified { low_n_per_m: z.ci95[0] });
    }
    let fraction = (z.bias / z.stiffness).abs();
    if fraction > MOVED {
        return Err(Unfit::Moved { fraction });
    }
    Ok(BetweenArms { stiffness_n_per_m: z.stiffness, ci95: z.ci95, basis: Basis::Recommended })
}

/// The difference of the two compliances in standard deviations: as compliances both are nearly
/// normally distributed.
fn apart(one: &BetweenArms, other: &BetweenArms) -> f64 {
    let compliance = |b: &BetweenArms| {
        let [low, high] = b.ci95.map(f64::recip);
        (b.stiffness_n_per_m.recip(), (low - high).abs() / 2.0 / super::joint_over_bands::NORMAL_95)
    };
    let ((a, a_std), (b, b_std)) = (compliance(one), compliance(other));
    (a - b).abs() / a_std.hypot(b_std)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::substructuring::averaged::{DofEstimate, Priors};
    use crate::substructuring::fit::{FittedDof, FreeEntries};
    use std::collections::BTreeMap;

    const BAND: Band = Band { low_hz: 300.0, high_hz: 600.0 };

    fn fitted(stiffness: f64, std: f64, chi_square: f64, identified: bool) -> Fitted {
        let ci95 = [stiffness - 2.0 * std, stiffness + 2.0 * std];
        let z = FittedDof {
            stiffness,
            std,
            ci95,
            identified,
            damping: 0.0,
            damping_std: 1.0,
            damping_identified: false,
        };
        Fitted {
            band_hz: BAND,
            lines: 601,
            idms: 6,
            priors: Priors::default(),
            mounting: 0.005,
            shape: FreeEntries::Diagonal,
            joint: BTreeMap::from([(Dof::Z, z)]),
            coupling_si: BTreeMap::new(),
            chi_square_per_dof: chi_square,
            largest_error: 2.0,
            converged: true,
        }
    }

    fn averaged(stiffness: f64, std: f64, bias: f64) -> Averaged {
        let z = DofEstimate {
            stiffness,
            std,
            std_noise: std,
            std_geometry: 0.0,
            ci95: [stiffness - 2.0 * std, stiffness + 2.0 * std],
            bias,
            damping: 0.0,
            identified: true,
        };
        Averaged {
            band_hz: BAND,
            lines: 601,
            idms: 6,
            priors: Priors::default(),
            noise_known: true,
            joint: BTreeMap::from([(Dof::Z, z)]),
        }
    }

    /// With a model that holds below the band too.
    fn decided(
        fit: Option<Result<&Fitted, &FitError>>,
        recommended: Option<&Averaged>,
    ) -> Result<BetweenArms, NoStiffness> {
        between_arms(fit, recommended, || Ok(fitted(27e6, 0.5e6, 1.1, true)))
    }

    #[test]
    fn the_fit_goes_before_what_agrees_with_it() {
        let (fit, other) = (fitted(27e6, 0.5e6, 0.9, true), averaged(26e6, 0.4e6, 0.0));
        let found = decided(Some(Ok(&fit)), Some(&other)).expect("both hold");
        assert_eq!((found.basis, found.stiffness_n_per_m), (Basis::Fit, 27e6));
        assert_eq!(decided(Some(Ok(&fit)), None), Ok(found));
    }

    #[test]
    fn the_assembly_alone_answers_where_the_fit_cannot() {
        let other = averaged(26e6, 0.4e6, 0.1e6);
        let wide = fitted(30e6, 9e6, 0.9, false);
        let found = decided(Some(Ok(&wide)), Some(&other)).expect("the assembly's holds");
        assert_eq!((found.basis, found.stiffness_n_per_m), (Basis::Recommended, 26e6));
    }

    #[test]
    fn the_assembly_alone_does_not_answer_where_no_fit_looked_at_its_model() {
        let other = averaged(26e6, 0.4e6, 0.1e6);
        for fit in [None, Some(Err(&FitError::NoMinimum))] {
            let why = decided(fit, Some(&other)).expect_err("no fit was made").to_string();
            assert!(why.contains("measure A and B alone"), "{why}");
        }
    }

    #[test]
    fn what_neither_holds_is_said_and_not_guessed() {
        let wide = fitted(30e6, 9e6, 0.9, false);
        let noisy = averaged(26e6, 0.4e6, 5e6);
        let mut unknown = averaged(26e6, 0.4e6, 0.0);
        unknown.noise_known = false;
        for (other, says) in [(noisy, "19 %"), (unknown, "noise of the FRFs")] {
            let why = decided(Some(Ok(&wide)), Some(&other)).expect_err("neither holds").to_string();
            assert!(why.contains(says) && why.contains("12 N/µm"), "{why}");
        }
    }

    #[test]
    fn where_the_model_fails_no_mean_takes_its_place() {
        let other = averaged(26e6, 0.4e6, 0.0);
        let (poor, misfit) = (fitted(30e6, 0.5e6, 5.0, true), FitError::Misfit { chi_square: 40.0 });
        for fit in [Ok(&poor), Err(&misfit)] {
            let why = decided(Some(fit), Some(&other)).expect_err("refused").to_string();
            assert!(why.contains("by a spring and damper alone"), "{why}");
        }
    }

    #[test]
    fn two_that_contradict_each_other_are_no_answer() {
        let (fit, other) = (fitted(27e6, 0.2e6, 0.9, true), averaged(32e6, 0.2e6, 0.0));
        let why = decided(Some(Ok(&fit)), Some(&other)).expect_err("five apart").to_string();
        assert!(why.contains("27.0") && why.contains("32.0"), "{why}");
    }

    #[test]
    fn a_mode_below_the_band_is_no_answer() {
        let (fit, wide) = (fitted(27e6, 0.5e6, 0.9, true), fitted(30e6, 9e6, 0.9, false));
        let other = averaged(26e6, 0.4e6, 0.0);
        for own in [&fit, &wide] {
            let says = |below: Result<Fitted, FitError>| {
                between_arms(Some(Ok(own)), Some(&other), || below).expect_err("refused").to_string()
            };
            let mode = says(Err(FitError::Misfit { chi_square: 900.0 }));
            assert!(mode.contains("30.0 times") && mode.contains("a mode below the band"), "{mode}");
            let poor = says(Ok(fitted(27e6, 0.5e6, 9.0, true)));
            assert!(poor.contains("3.0 times"), "{poor}");
            let not_tested = says(Err(FitError::NoMinimum));
            assert!(not_tested.contains("was not tested: not identified"), "{not_tested}");
        }
    }
}

//! Whether the interface is described well enough: modes, internals, A and B the same in all configurations.

use crate::identified::SCATTER_OF_LINES;
use crate::results::number::{micro, short};
use crate::results::{Check, MAIN_BAND};
use crate::substructuring::cmif::Cmif;
use crate::substructuring::identify::{Identification, Internals};
use crate::substructuring::{BandStatistic, Dof, JointSpectrum, Method};

/// Name of the check on which rigid motions coupling adds.
pub const INTERFACE_MODES: &str = "interface-modes";
/// Name of the check on n_i against n_c.
pub const INTERNALS: &str = "internals";
/// Name of the check on A and B being the same structures in all configurations.
pub const SAME_IN_ALL: &str = "same-in-all-configurations";

/// Six rigid motions must explain this part of what coupling adds.
const RIGID: f64 = 0.9;
/// A difference of this part of the stiffness matters.
const MATTERS: f64 = 0.1;

/// Which set of modes the CMIF suggests, and whether rigid motions are enough at all.
pub fn modes(found: &Cmif) -> Check {
    let six = found.explained.get(&6).copied().unwrap_or(f64::NAN);
    let mut meaning = format!("The CMIF suggests {} modes: {}.", found.suggested, found.reason);
    if six < RIGID {
        meaning.push_str(
            " What six rigid motions leave over is noise or an interface that deforms: look at the virtual points' consistency.",
        );
    }
    let mut check = Check::new(INTERFACE_MODES, Some(six >= RIGID), meaning)
        .with("suggested_modes", found.suggested as f64);
    for (count, part) in &found.explained {
        check = check.with(&format!("explained_by_{count}"), *part);
    }
    check
}

/// n_i against n_c, and the ranks of P and Q, for both forms of Eq. (3) with the most modes; none where neither was asked for.
pub fn internals(found: &Identification) -> Option<Check> {
    let most = |method: Method| found.internals.iter().filter(|i| i.method == method).max_by_key(|i| i.idms);
    let full = |i: &Internals| i.impacts.min(i.responses) >= i.idms && i.rank_p.min(i.rank_q) >= i.idms;
    let has = |i: &Internals| {
        format!("{} impacts on A and {} responses on B for {} interface DoFs", i.impacts, i.responses, i.idms)
    };
    let mut sentences = Vec::new();
    let exact = most(Method::Internal);
    if let Some(i) = exact {
        sentences.push(format!(
            "Eq. 3 in least squares has {}; P has rank {} (condition {}), Q rank {} (condition {}).",
            has(i),
            i.rank_p,
            short(i.condition_p),
            i.rank_q,
            short(i.condition_q)
        ));
    }
    let refused = found.refused.iter().find(|r| r.method == Method::Internal);
    if let Some(refused) = refused {
        sentences.push(format!(
            "Eq. 3 in least squares with {} IDMs was refused: {}.",
            refused.idms, refused.reason
        ));
    }
    if let Some(i) = most(Method::InternalPrinted) {
        let exact = i.impacts == i.idms && i.responses == i.idms && full(i);
        sentences.push(format!(
            "As printed it has {}: {}.",
            has(i),
            if exact {
                "exact"
            } else {
                "with n_i ≠ n_c it is right only for the forces that these internals generate"
            }
        ));
    }
    if sentences.is_empty() {
        return None;
    }
    let ok = refused.is_none() && exact.is_some_and(full);
    let mut check = Check::new(INTERNALS, Some(ok), sentences.join(" "));
    if let Some(i) = exact {
        check = check
            .with("interface_dofs", i.idms as f64)
            .with("internal_impacts", i.impacts as f64)
            .with("internal_responses", i.responses as f64)
            .with("rank_p", i.rank_p as f64)
            .with("rank_q", i.rank_q as f64)
            .with("condition_p", i.condition_p)
            .with("condition_q", i.condition_q);
    }
    Some(check)
}

/// k_z of a method with the most modes, over the main band.
fn sliding(found: &Identification, method: Method) -> Option<(&JointSpectrum, &[f64])> {
    let spectra = found.spectra.iter().filter(|s| s.method == method.name());
    let spectrum = spectra.max_by_key(|s| s.idms)?;
    Some((spectrum, spectrum.stiffness_n_per_m.get(&Dof::Z)?))
}

/// Eq. (A.1) needs neither A nor B alone, the blocks of Eq. (A.2) need one of them each: where they differ by more than their lines
/// scatter, that substructure is another one in the assembly than alone (a clamp that sits otherwise under load, a wire in
/// place of a rod). None without these methods.
pub fn configuration(found: &Identification) -> Option<Check> {
    let (reference, inverse) = sliding(found, Method::Inverse)?;
    let inside: Vec<usize> =
        (0..inverse.len()).filter(|&l| MAIN_BAND.contains(reference.frequency_hz[l])).collect();
    let of = |values: &dyn Fn(usize) -> f64| {
        BandStatistic::of(&inside.iter().map(|&l| values(l)).collect::<Vec<f64>>())
    };
    let k = of(&|l| inverse[l])?;
    let mut changed = Vec::new();
    let mut clear = true;
    let mut figures = Vec::new();
    for (side, method) in [("A", Method::PrimalA), ("B", Method::PrimalB)] {
        let (spectrum, values) = sliding(found, method)?;
        if spectrum.idms != reference.idms {
            return None;
        }
        let difference = of(&|l| values[l] - inverse[l])?;
        let [low, high] = difference.ci95.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        figures.push((side, difference.mean));
        if (low > 0.0 || high < 0.0) && difference.mean.abs() > MATTERS * k.mean.abs() {
            changed.push(format!("{side} (by {} N/µm)", short(micro(difference.mean))));
        }
        clear &= high - low < k.mean.abs();
    }
    let clear = clear && k.std <= SCATTER_OF_LINES * k.mean.abs();
    let (ok, meaning) = if !clear {
        (None, "Eq. A.1 and A.2 scatter too much to tell whether A and B are the same structures in the assembly as alone.".to_owned())
    } else if changed.is_empty() {
        (
            Some(true),
            "Eq. A.1, which needs neither A nor B alone, and both blocks of A.2 agree: nothing shows that A or B is another structure in the assembly than alone."
                .to_owned(),
        )
    } else {
        (
            Some(false),
            format!(
                "Eq. A.2 differs from A.1 for {}: that substructure is not the same alone as in the assembly. Methods that use it (Eq. 3, A.3, its block of A.2) see the \
                 difference as joint; A.1 and the other block of A.2 do not.",
                changed.join(" and ")
            ),
        )
    };
    let mut check = Check::new(SAME_IN_ALL, ok, meaning).with("inverse_n_per_m", k.mean);
    for (side, difference) in figures {
        check = check.with(&format!("primal_{}_minus_inverse_n_per_m", side.to_lowercase()), difference);
    }
    Some(check)
}

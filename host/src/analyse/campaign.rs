//! The analysis of a campaign, from top to bottom: the cells, the FRFs of each configuration, the
//! joint line by line, the stiffness between the arms, the contact's own stiffness, the specimens.
//! Each stage gets what it needs from the earlier ones as arguments.

use super::assemble::everything;
use super::averages::{CellAverage, LINES_HZ};
use super::cell::{BANDS, Measurements, Progress, Wanted};
use super::checks::between_the_arms;
use super::findings::{Findings, Settings};
use super::from_frfs::{Fit, NoFit, Substructured, fits, recommended};
use super::missing::{Missing, given_up};
use super::modal::{FoundModes, MODES_HZ};
use super::{
    cells_stage, chosen, configuration_stage, contact_answer, contact_stage, first_mode, separate_cells,
};
use crate::contact::SecondPath;
use crate::results::MAIN_BAND;
use crate::spectra::Windowing;
use crate::structure::Structure;
use crate::substructuring::averaged::{Averaged, Priors};
use crate::substructuring::between_arms::{BELOW, BetweenArms, NoStiffness, Unfit, between_arms};
use crate::substructuring::fit::{FitError, Fitted};
use crate::substructuring::geometry::Grouping;
use crate::substructuring::{Band, Frf, Geometry, IdmSet, Method, fit, identify, keep_common_lines};
use rayon::prelude::*;
use std::collections::HashSet;

/// Analyses the measurements. The caller adds the provenance and the equipment used.
pub fn analyse_measurements<M: Measurements>(
    measurements: &M,
    wanted: Wanted,
    progress: &(dyn Fn(Progress) + Sync),
) -> Findings {
    let (names, geometry) = (measurements.cells(), measurements.geometry());

    // the cells, read hit by hit: average FRFs, loops of the impacts, responses at the contact
    let mut cells = cells_stage::read_all(measurements, &names, wanted.replicates > 0, progress);
    let mut missing = std::mem::take(&mut cells.missing);
    missing.extend(given_up(&names, measurements.given_up()));
    let known_mass = separate_cells::known_mass(measurements).unwrap_or_else(|why| {
        missing.push(why);
        None
    });
    let second_path = separate_cells::second_path(measurements).unwrap_or_else(|why| {
        missing.push(why);
        None
    });
    let data_quality = chosen::data_quality(geometry, &cells.averages);

    // the FRF matrix of each configuration
    let place = |structure: Structure| Structure::ALL.iter().position(|s| *s == structure);
    cells.averages.sort_by_key(|average| place(average.name.configuration));
    let (mut configurations, mut of_all_pairs) = (Vec::new(), Vec::new());
    let matrices = Structure::ALL.map(|structure| {
        let planned = names.iter().filter(|c| c.configuration == structure).count();
        let own = of_configuration(&cells.averages, structure);
        let points = geometry.points(structure);
        let (one, all_pairs) = rayon::join(
            || configuration_stage::of(measurements, structure, points, own, planned),
            || wanted.frfs.then(|| everything(points, own, measurements.quantity())).flatten(),
        );
        of_all_pairs.extend(Some(structure).zip(all_pairs));
        missing.extend(one.missing);
        configurations.push(one.measured);
        one.frf
    });
    forget_frfs(&mut cells.averages);
    let frfs = matrices.each_ref().map(Option::as_ref);
    let common = on_common_lines(frfs, &mut missing);
    let alike = common.as_ref().map_or(frfs, |common| common.each_ref().map(Some));

    // the joint by substructuring, line by line
    let substructured = match all_three(alike).and_then(|frfs| substructured(frfs, geometry)) {
        Ok(found) => {
            missing.extend(found.cmif.as_ref().err().cloned().map(Missing::Cmif));
            Some(found)
        }
        Err(why) => {
            missing.push(why);
            None
        }
    };

    // the stiffness between the arms, from the assembly alone; a plan without A's interface does
    // not measure it
    let priors = measurements.contact_priors().positions;
    let asks = geometry.ajb.channels.iter().any(|p| p.grouping == Grouping::InterfaceA);
    let assembly = frfs[2].filter(|_| asks);
    let recommended = assembly
        .map(|ajb| recommended(geometry, ajb, &priors, &cells.hits, wanted.replicates))
        .unwrap_or_default();
    missing.extend(recommended.missing);

    // the fit between the arms, and beside it the contact's own stiffness from the hits and the
    // modes: each uses cores that the others leave idle
    let between_the_arms_by_fit = || {
        let Ok([a, b, ajb]) = all_three(alike) else {
            let without = NoStiffness::Neither { fit: Unfit::NotMade, recommended: Unfit::Unchecked };
            return (Vec::new(), Err(without));
        };
        let options = fit::Options { priors, ..fit::Options::default() };
        let fits = fit_of_the_main_band([a, b, ajb], geometry, &options);
        let below = || fit::fit(a, b, ajb, geometry, IdmSet::Six, BELOW, &options);
        let decided = decided(&fits, &recommended.estimates, below);
        (fits, decided)
    };
    let modes_of = |(structure, frf): (Structure, Option<&Frf>)| {
        let points = geometry.points(structure);
        frf.map(|frf| (structure, FoundModes::of_structure(structure, frf, points, MODES_HZ)))
    };
    let all_modes = || Structure::ALL.into_par_iter().zip(frfs).filter_map(modes_of).collect::<Vec<_>>();
    let ((fits, between_arms), (own, all_modes)) = rayon::join(between_the_arms_by_fit, || {
        rayon::join(|| contact_answer::answer(measurements, &cells.averages, known_mass), all_modes)
    });
    let mut modes = Vec::new();
    for (configuration, found) in all_modes {
        match found {
            Ok(found) => modes.push(found),
            Err(why) => missing.push(Missing::Modes { configuration, why }),
        }
    }

    // the specimens: loops, levels, and their stiffness compared with that between the arms
    let fitted: Vec<_> = fits.iter().filter_map(|fit| Some(fit.outcome.as_ref().ok()?.row())).collect();
    let rows = substructured.iter().flat_map(|s| &s.rows).map(|row| &row.joint).chain(&fitted);
    let fbs = between_the_arms(&recommended.estimates, rows);
    let (mut contact, absent) =
        contact_stage::at_the_contact(measurements, &cells, fbs.as_ref(), own.as_ref());
    missing.extend(absent);
    let mut own_stiffness = own.map(|(stiffness, _)| stiffness);
    if let Some(drift) = contact.drift.filter(|drift| drift.found() == Some(true)) {
        if let Ok(own) = &mut own_stiffness {
            own.allow_for(&drift);
        }
        if let Some(joint) = &mut contact.joint {
            joint.allow_for(&drift);
        }
    }
    if let Some(path) = second_path.filter(SecondPath::found) {
        if let Ok(own) = &mut own_stiffness {
            own.allow_for_path(&path);
        }
        if let Some(joint) = &mut contact.joint {
            joint.allow_for_path(&path);
        }
    }

    let windowing = Windowing { sigma_per_s: measurements.sigma_per_s(), ..Windowing::default() };
    Findings {
        settings: Some(Settings { windowing, lines_hz: LINES_HZ }),
        data_quality,
        configurations,
        frfs: of_all_pairs,
        substructured,
        fits,
        priors: assembly.map(|_| priors),
        recommended: recommended.estimates,
        bootstrap: recommended.bootstrap,
        contact: Some(contact),
        own_stiffness: Some(own_stiffness),
        between_arms: Some(between_arms),
        first_mode: first_mode::first_mode(&modes, &cells.at_contact, |record| {
            measurements.session_of(record)
        }),
        modes,
        missing,
        ..Findings::default()
    }
}

/// Removes the FRFs that are now in the matrices from the averages; otherwise both copies would be
/// kept to the end. FRFs of impacts that are also used for the contact are kept, because they are
/// shown with it.
fn forget_frfs(averages: &mut [CellAverage]) {
    let of_assembly = |average: &CellAverage| average.name.configuration == Structure::Ajb;
    let seen = averages.iter().filter(|average| of_assembly(average) && average.contact.is_some());
    let seen: HashSet<String> = seen.map(|average| average.name.impact.clone()).collect();
    for average in averages {
        if !of_assembly(average) || !seen.contains(&average.name.impact) {
            average.spectra = average.spectra.of_outputs(0..0);
        }
    }
}

/// The averages of one configuration, from all averages sorted by configuration.
fn of_configuration(sorted: &[CellAverage], structure: Structure) -> &[CellAverage] {
    sorted
        .chunk_by(|a, b| a.name.configuration == b.name.configuration)
        .find(|own| own[0].name.configuration == structure)
        .unwrap_or_default()
}

/// The FRFs of A, B and AJB; otherwise the configurations that have none.
fn all_three(frfs: [Option<&Frf>; 3]) -> Result<[&Frf; 3], Missing> {
    if let [Some(a), Some(b), Some(ajb)] = frfs {
        return Ok([a, b, ajb]);
    }
    let absent = Structure::ALL.into_iter().zip(frfs).filter(|(_, frf)| frf.is_none());
    Err(Missing::Configurations(absent.map(|(structure, _)| structure).collect()))
}

/// Copies of all three restricted to their common lines; `None` if one is missing, if their lines
/// are equal, or if there is no common grid, which [`identify`](fn@identify) then reports.
fn on_common_lines(frfs: [Option<&Frf>; 3], missing: &mut Vec<Missing>) -> Option<[Frf; 3]> {
    let [a, b, ajb] = all_three(frfs).ok()?;
    if b.frequency_hz() == a.frequency_hz() && ajb.frequency_hz() == a.frequency_hz() {
        return None;
    }
    let mut own = [a, b, ajb].map(Frf::clone);
    let left_out = keep_common_lines(&mut own).ok()?;
    missing.extend(left_out.map(Missing::LinesLeftOut));
    Some(own)
}

fn substructured(frfs: [&Frf; 3], geometry: &Geometry) -> Result<Substructured, Missing> {
    let [a, b, ajb] = frfs;
    let bands: Vec<Band> =
        BANDS.into_iter().filter(|band| a.frequency_hz().iter().any(|f| band.contains(*f))).collect();
    let identified = identify(a, b, ajb, geometry, &Method::ALL, &IdmSet::ALL, &bands);
    let mut found = identified
        .map(|found| Substructured::of(frfs, geometry, &Priors::default(), found))
        .map_err(Missing::Substructuring)?;
    // of the paper's methods the results include the spectra; the second form of A.1 is omitted
    // because it differs only by rounding
    let kept = |name: &str| Method::PAPER.iter().any(|m| *m != Method::InverseBa && m.name() == name);
    found.spectra.retain(|(spectrum, _)| kept(&spectrum.method));
    Ok(found)
}

/// The fit over the main band, from all three configurations and their noise.
fn fit_of_the_main_band(frfs: [&Frf; 3], geometry: &Geometry, options: &fit::Options) -> Vec<Fit> {
    let idms = IdmSet::Six;
    if frfs.iter().any(|frf| frf.variance().is_none()) {
        return vec![Fit { idms, outcome: Err(NoFit::ImportWithoutVariance) }];
    }
    fits(frfs, geometry, &[idms], &[MAIN_BAND], options)
}

/// Decides which estimate of the main band is the stiffness between the arms; `below` is the fit to
/// the lines below it.
fn decided(
    fits: &[Fit],
    recommended: &[Averaged],
    below: impl FnOnce() -> Result<Fitted, FitError>,
) -> Result<BetweenArms, NoStiffness> {
    let fitted = fits.first().and_then(|fit| match &fit.outcome {
        Ok(fitted) => Some(Ok(fitted)),
        Err(NoFit::Failed(error)) => Some(Err(error)),
        Err(_) => None,
    });
    between_arms(fitted, recommended.iter().find(|r| r.band_hz == MAIN_BAND), below)
}

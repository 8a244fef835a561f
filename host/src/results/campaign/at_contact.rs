//! Everything that is read at the specimens themselves: the impacts' loops, the shaker's levels, the contact in frequency.

use super::averages::CellAverage;
use super::cell::Measurements;
use super::checks;
use super::contact::{self, specimen_curves};
use super::loops::{self, ImpactLoop};
use super::phase_split::with_phases;
use super::{chosen, shaker, static_arm};
use crate::hysteresis::compliance::ContactCompliance;
use crate::hysteresis::compliance::SEARCH_HZ;
use crate::hysteresis::static_arm::{Identified, from_levels};
use crate::results::{Check, LoopCurve, Reconstruction, Results, words};
use crate::spectra::CrossSpectra;
use crate::substructuring::geometry::{Geometry, Grouping};

/// Adds what the contact's own signals say.
pub fn at_the_contact<M: Measurements>(
    results: &mut Results,
    measurements: &M,
    averages: &[CellAverage],
    impact_loops: &[ImpactLoop],
    sigma_per_s: f64,
) {
    let geometry = measurements.geometry();
    let (levels, complaints) = measurements.shaker_levels();
    results.missing.extend(complaints);
    let (steady, complaints) = shaker::analysed(&levels);
    results.missing.extend(complaints);

    let (frequency_hz, by_impact) = summed(averages);
    let sums: Vec<&CrossSpectra> =
        by_impact.iter().map(|(_, c)| c).filter(|c| c.lines() == frequency_hz.len()).collect();
    let compliance = contact::compliance(frequency_hz, sigma_per_s, &sums);
    if let Some(impact) = show_specimens(results, geometry, &by_impact) {
        let (points, quantity) = (&geometry.ajb, measurements.quantity());
        results.frfs.extend(chosen::arms(impact, points, averages, quantity));
    }
    let hidden = hidden_resonance(compliance.as_ref(), &shaker::swept(&levels));
    let hidden = with_phases(hidden, &results.frfs);
    let resonance_hz = hidden.frequency_hz.filter(|_| hidden.ok == Some(false));

    let arm = static_arm(measurements, averages, &steady, sigma_per_s);
    if arm.is_none() && !(steady.is_empty() && impact_loops.is_empty()) {
        results.missing.push(
            "No loops of the corrected force: the static arm's effective mass is not known. Hits on B alone give it, or stuck loops of the shaker at three \
             frequencies or more; or state it (--effective-mass KG)."
                .into(),
        );
    }
    results.static_arm = arm;

    let mut of_impacts = loops::gathered(impact_loops, arm.as_ref());
    for row in &mut of_impacts {
        loops::judge(row, &hidden);
    }
    results.hysteresis.extend(of_impacts);
    let mut of_levels = shaker::rows(&steady, arm.as_ref());
    if let Some(resonance_hz) = resonance_hz {
        shaker::warn_of_resonance(&mut of_levels, resonance_hz);
    }
    results.hysteresis.extend(of_levels);
    results.shaker_loops = shaker::curves(&steady);
    results.backbones = shaker::backbones(&steady);
    results.impact_slopes = loops::slopes(impact_loops);
    let shown = example(measurements, averages, impact_loops, resonance_hz);
    (results.example_loop, results.reconstruction) = shown.unwrap_or_default();

    let direct = compliance.as_ref().and_then(|c| contact::direct(c, sigma_per_s));
    let loops = results.impact_loops().and_then(words::slope).map(|(_, k)| k);
    let series = checks::series_compliance(
        checks::between_the_arms(results).as_ref(),
        checks::at_the_specimens(direct.as_ref(), loops),
    );
    results.joint.extend(direct);
    results.checks.push(series);
    results.checks.push(hidden);
    results.checks.extend(shaker::unchanged(&steady));
}

/// The contact's spectra of the assembly, summed over the cells of each impact.
fn summed(averages: &[CellAverage]) -> (&[f64], Vec<(&str, CrossSpectra)>) {
    let mut frequency_hz: &[f64] = &[];
    let mut by_impact: Vec<(&str, CrossSpectra)> = Vec::new();
    for cell in averages.iter().filter(|cell| cell.name.configuration == "AJB") {
        let Some(contact) = &cell.contact else { continue };
        if frequency_hz.is_empty() {
            frequency_hz = cell.spectra.frequency_hz();
        }
        match by_impact.iter_mut().find(|(name, _)| *name == cell.name.impact) {
            // spectra of other lines do not count
            Some((_, sum)) => sum.add(contact).unwrap_or_default(),
            None => by_impact.push((&cell.name.impact, contact.clone())),
        }
    }
    (frequency_hz, by_impact)
}

/// The FRFs of both specimens, and the impact that they are from: the moving mass drives the contact as the shaker does; any other
/// impact will do.
fn show_specimens<'a>(
    results: &mut Results,
    geometry: &Geometry,
    by_impact: &[(&'a str, CrossSpectra)],
) -> Option<&'a str> {
    let point = |name: &str| geometry.ajb.impacts.iter().find(|p| p.name == name);
    let on_mass = |name: &str| point(name).is_some_and(|p| p.grouping == Grouping::InternalA);
    let (name, sum) = by_impact.iter().max_by_key(|(name, _)| on_mass(name))?;
    let sign = point(name).map_or(1.0, |p| p.direction[2].signum());
    results.frfs.extend(specimen_curves(name, sign, sum));
    Some(name)
}

/// The clearest answer of hits and sweeps.
fn hidden_resonance(hits: Option<&ContactCompliance>, sweeps: &[ContactCompliance]) -> Check {
    let rank = |check: &Check| match check.ok {
        Some(false) => 2,
        Some(true) => 1,
        None => 0,
    };
    let of_hits = checks::hidden_resonance(hits);
    // the last of equals counts: hits before sweeps
    sweeps
        .iter()
        .map(|sweep| checks::hidden_resonance(Some(sweep)))
        .chain([of_hits])
        .max_by_key(rank)
        .unwrap_or_else(|| checks::hidden_resonance(None))
}

/// What the force is corrected by: stated, or from hits on B alone, or from stuck levels.
fn static_arm<M: Measurements>(
    measurements: &M,
    averages: &[CellAverage],
    steady: &[shaker::Analysed<'_>],
    sigma_per_s: f64,
) -> Option<Identified> {
    let known = measurements.known_contact();
    if let Some(mass) = known.effective_mass_kg {
        return Some(shaker::given(mass, known.parallel_path.unwrap_or(0.0)));
    }
    let geometry = measurements.geometry();
    let (points, at) = (&geometry.b, geometry.virtual_point_b_m);
    static_arm::from_hits(averages, points, at, sigma_per_s, known.parallel_path)
        .or_else(|| from_levels(&shaker::stuck(steady), known.parallel_path.unwrap_or(0.0)))
}

/// The signals of the hit whose slope is the middle of all, read once more.
fn example<M: Measurements>(
    measurements: &M,
    averages: &[CellAverage],
    impact_loops: &[ImpactLoop],
    resonance_hz: Option<f64>,
) -> Option<(Option<LoopCurve>, Option<Reconstruction>)> {
    let shown = loops::middle(impact_loops)?;
    let name = &averages.iter().find(|c| c.records.contains(&shown.record))?.name;
    let cell = measurements.read(name).ok()?;
    let hit = cell.hits.iter().find(|h| h.record == shown.record)?;
    let (contact, delays) = (hit.contact.as_ref()?, hit.contact.as_ref()?.delay_s);
    let inside = resonance_hz.filter(|f| (SEARCH_HZ[0]..=SEARCH_HZ[1]).contains(f));
    Some((
        Some(loops::drawn(shown, cell.fs_hz, contact, delays)),
        inside.and_then(|f| loops::rebuilt(shown, cell.fs_hz, contact, delays, f)),
    ))
}

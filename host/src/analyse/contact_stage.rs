//! Evaluates all measurements at the specimens: the static arm (stated, from hits on B alone where
//! the force at the contact is the hammer's, or from levels that stick), the impacts' loops, the
//! shaker's levels, the specimens' FRFs for the report, and the contact in the frequency domain.

use super::averages::CellAverage;
use super::cell::Measurements;
use super::cells_stage::{Cells, drift_of_the_contact, slip_under_the_hammer};
use super::checks::contact_change::ContactChange;
use super::checks::{HiddenResonance, SensorMasses, SeriesCompliance, at_the_specimens};
use super::impact_loops::{ImpactLoop, ImpactLoops};
use super::missing::Missing;
use super::shaker_levels::RecordLoops;
use super::{chosen, impact_loops, shaker_levels};
use crate::contact::{ContactError, Joint, Known, Stiffness};
use crate::hysteresis::Correction;
use crate::hysteresis::compliance::{ContactCompliance, SEARCH_HZ};
use crate::hysteresis::contact_drift::ContactDrift;
use crate::hysteresis::hammer_slip::HammerSlip;
use crate::hysteresis::static_arm::{CorrectionSource, Identified, from_known_force, from_levels};
use crate::results::{Backbone, FrfCurve, LoopCurve, Reconstruction, Role, ShakerLoop, rounded};
use crate::spectra::CrossSpectra;
use crate::structure::Structure;
use crate::substructuring::direct::Direct;
use crate::substructuring::geometry::{Configuration, Geometry, Grouping, Point};
use crate::substructuring::idm::{Dof, IdmSet};
use crate::substructuring::{BandStatistic, vpt};
use nalgebra::Vector3;
use num_complex::Complex;
use std::f64::consts::TAU;

/// Number of groups of hits used to distinguish a resonance from noise.
const GROUPS: usize = 4;

/// Results from the contact's signals.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// FRFs of the specimens, and of both arms from the same impact.
    pub frfs: Vec<FrfCurve>,
    /// T/Δx in the frequency domain.
    pub direct: Option<Direct>,
    /// Whether Δx contains a resonance of one specimen.
    pub hidden: HiddenResonance,
    /// Parameters of the force correction.
    pub arm: Option<Identified>,
    /// Whether the contact slips under the hammer.
    pub slip: HammerSlip,
    /// Whether it changed during the hits; `None` with too few cells.
    pub drift: Option<ContactDrift>,
    /// The loops of the impacts.
    pub impacts: Option<ImpactLoops>,
    /// The one with the median slope.
    pub example_loop: Option<LoopCurve>,
    /// Its decay, reconstructed from two sinusoids.
    pub reconstruction: Option<Reconstruction>,
    /// The loops of the shaker's levels.
    pub levels: Vec<RecordLoops>,
    /// k_T of the hits and the levels combined; `None` if the levels add nothing.
    pub joint: Option<Joint>,
    /// One loop of the shaker at each frequency.
    pub shaker_loops: Vec<ShakerLoop>,
    /// Dependence of a slipping contact on amplitude.
    pub backbones: Vec<Backbone>,
    /// Comparison of FBS with the specimens.
    pub series: SeriesCompliance,
    /// Comparison of the levels before and after the hammer's cells.
    pub change: Option<ContactChange>,
    /// What the masses of fixed sensors change.
    pub masses: Option<SensorMasses>,
}

/// Runs this stage. `between_the_arms` is the stiffness from FBS, `own` the contact stiffness from
/// the hits.
pub fn at_the_contact<M: Measurements>(
    measurements: &M,
    cells: &Cells,
    between_the_arms: Option<&BandStatistic>,
    own: Result<&(Stiffness, Known), &ContactError>,
) -> (Contact, Vec<Missing>) {
    let (averages, impact_loops) = (&cells.averages[..], &cells.loops[..]);
    let (geometry, sigma_per_s) = (measurements.geometry(), measurements.sigma_per_s());

    // the loops of the shaker's levels, corrected if the arm is known without them
    let (levels, complaints) = measurements.shaker_levels();
    let mut missing: Vec<Missing> = complaints.into_iter().map(Missing::Level).collect();
    let mut unfit = Vec::new();
    let known = known_arm(measurements, averages, &mut unfit);
    let (steady, no_loop) = shaker_levels::analysed(&levels, known.as_ref());
    missing.extend(no_loop);

    // T/Δx of the hits in the frequency domain, and whether a specimen's resonance hides in it
    let by_impact = summed(averages, &mut missing);
    let spectra: Vec<&CrossSpectra> = by_impact.iter().map(|(_, sum)| sum).collect();
    let compliance = ContactCompliance::of_impacts(&spectra);
    let mut frfs = Vec::new();
    if let Some((impact, sign, sum)) = shown_impact(geometry, &by_impact) {
        frfs.extend(specimen_curves(impact, sign, sum));
        frfs.extend(chosen::arms(impact, &geometry.ajb, averages, measurements.quantity()));
    }
    let hidden =
        HiddenResonance::of(compliance.as_ref(), &in_groups(averages), &shaker_levels::swept(&levels))
            .with_phases(&frfs);
    let direct = compliance.and_then(|c| Direct::of(&c.frequency_hz, &c.compliance_m_per_n, sigma_per_s));

    // the static arm: known, or from the levels that stick
    missing.extend(unfit);
    let parallel_path = measurements.known_contact().parallel_path.unwrap_or(0.0);
    let arm = known.or_else(|| from_levels(&shaker_levels::stuck(&steady), parallel_path));
    if arm.is_none() && !(steady.is_empty() && impact_loops.is_empty()) {
        missing.push(Missing::EffectiveMass);
    }

    // the loops of the impacts
    let slip = slip_under_the_hammer(&cells.at_contact);
    let slips = slip.found() == Some(true);
    let impacts = impact_loops::gathered(impact_loops, arm.as_ref(), &hidden, slips);
    let shown = example(measurements, averages, impact_loops, hidden.resonance_hz());
    let (example_loop, reconstruction) =
        shown.map_or((None, None), |(drawn, rebuilt)| (Some(drawn), rebuilt));

    // k_T of the levels, and the stiffness between the arms compared with that at the specimens
    let loops: Vec<_> = steady.iter().map(|one| (one.level, &one.raw)).collect();
    let at_levels = shaker_levels::k_t_of_levels(measurements, averages, own, slips, &loops);
    let at_the_specimens = at_the_specimens(direct.as_ref(), impacts.as_ref().map(|i| i.slope_n_per_m));
    let found = Contact {
        frfs,
        direct,
        hidden,
        arm,
        slip,
        drift: drift_of_the_contact(&cells.at_contact),
        impacts,
        example_loop,
        reconstruction,
        shaker_loops: shaker_levels::curves(&steady),
        backbones: shaker_levels::backbones(&steady),
        series: SeriesCompliance::of(between_the_arms, at_the_specimens),
        change: ContactChange::of(&steady),
        masses: SensorMasses::of(measurements, averages),
        joint: shaker_levels::combined_with_hits(own, &at_levels),
        levels: shaker_levels::loops(steady, arm.as_ref(), at_levels),
    };
    (found, missing)
}

/// The contact's spectra of the assembly, summed over the cells of each impact; cells whose lines
/// differ from those of the first are reported in `missing`.
fn summed<'a>(
    averages: impl IntoIterator<Item = &'a CellAverage>,
    missing: &mut Vec<Missing>,
) -> Vec<(&'a str, CrossSpectra)> {
    let mut by_impact: Vec<(&str, CrossSpectra)> = Vec::new();
    let of_assembly = averages.into_iter().filter(|cell| cell.name.configuration == Structure::Ajb);
    for (name, contact) in of_assembly.filter_map(|cell| Some((&cell.name, cell.contact.as_ref()?))) {
        let unlike =
            by_impact.first().is_some_and(|(_, first)| first.frequency_hz() != contact.frequency_hz());
        let added = match by_impact.iter_mut().find(|(impact, _)| *impact == name.impact) {
            _ if unlike => false,
            Some((_, sum)) => sum.add(contact).is_ok(),
            None => {
                by_impact.push((&name.impact, contact.clone()));
                true
            }
        };
        if !added {
            missing.push(Missing::OtherLines(name.clone()));
        }
    }
    by_impact
}

/// Δx/T of groups of cells that share no hits: the cells of each impact are distributed over the
/// groups in rotation. If an impact has too few cells, each cell forms a separate group, and
/// differences between impacts count as noise.
fn in_groups(averages: &[CellAverage]) -> Vec<ContactCompliance> {
    let cells = || averages.iter().filter(|c| c.contact.is_some() && c.name.configuration == Structure::Ajb);
    let mut dealt: Vec<Vec<&CellAverage>> = vec![Vec::new(); GROUPS];
    let mut counts: Vec<(&str, usize)> = Vec::new();
    for cell in cells() {
        let impact = cell.name.impact.as_str();
        let place = counts.iter().position(|(name, _)| *name == impact).unwrap_or_else(|| {
            counts.push((impact, 0));
            counts.len() - 1
        });
        dealt[counts[place].1 % GROUPS].push(cell);
        counts[place].1 += 1;
    }
    if counts.iter().any(|(_, count)| *count < GROUPS) {
        dealt = cells().map(|cell| vec![cell]).collect();
    }
    let of = |cells: &Vec<&CellAverage>| {
        // cells left out are already reported by the sum over all cells
        let sums = summed(cells.iter().copied(), &mut Vec::new());
        ContactCompliance::of_impacts(&sums.iter().map(|(_, sum)| sum).collect::<Vec<_>>())
    };
    dealt.iter().filter_map(of).collect()
}

/// The impact for which the specimens are shown, with the sign of its direction along z: preferably
/// one on the moving mass, which drives the contact as the shaker does; otherwise any impact.
fn shown_impact<'a>(
    geometry: &Geometry,
    by_impact: &'a [(&'a str, CrossSpectra)],
) -> Option<(&'a str, f64, &'a CrossSpectra)> {
    let point = |name: &str| geometry.ajb.impacts.iter().find(|p| p.name == name);
    let on_mass = |name: &str| point(name).is_some_and(|p| p.grouping == Grouping::InternalA);
    let (name, sum) = by_impact.iter().max_by_key(|(name, _)| on_mass(name))?;
    Some((name, point(name).map_or(1.0, |p| p.direction[2].signum()), sum))
}

/// The parameters of the force correction if they do not depend on the levels: stated, or from hits
/// on B alone.
fn known_arm<M: Measurements>(
    measurements: &M,
    averages: &[CellAverage],
    missing: &mut Vec<Missing>,
) -> Option<Identified> {
    let known = measurements.known_contact();
    if let Some(effective_mass_kg) = known.effective_mass_kg {
        let correction = Correction { effective_mass_kg, parallel_path: known.parallel_path.unwrap_or(0.0) };
        return Some(Identified { correction, basis: CorrectionSource::Given, residual: 0.0 });
    }
    let geometry = measurements.geometry();
    let (points, at, sigma_per_s) = (&geometry.b, geometry.virtual_point_b_m, measurements.sigma_per_s());
    arm_from_hits(averages, points, at, sigma_per_s, known.parallel_path, missing)
}

/// Reads the signals of the hit with the median slope once more.
fn example<M: Measurements>(
    measurements: &M,
    averages: &[CellAverage],
    impact_loops: &[ImpactLoop],
    resonance_hz: Option<f64>,
) -> Option<(LoopCurve, Option<Reconstruction>)> {
    let shown = impact_loops::middle(impact_loops)?;
    let name = &averages.iter().find(|c| c.records.contains(&shown.record))?.name;
    let cell = measurements.read(name, true).ok()?;
    let hit = cell.hits.iter().find(|h| h.record == shown.record)?;
    let contact = hit.contact.as_ref()?;
    let delays = contact.delay_s;
    let inside = resonance_hz.filter(|f| (SEARCH_HZ[0]..=SEARCH_HZ[1]).contains(f));
    Some((
        impact_loops::drawn(shown, cell.fs_hz, contact, delays),
        inside.and_then(|f| impact_loops::rebuilt(shown, cell.fs_hz, contact, delays, f)),
    ))
}

/// Frequency range of the fit, Hz: above the hammer's drift, below the first mode of the arm on its
/// cells.
const FIT_HZ: [f64; 2] = [100.0, 600.0];

/// Fits mass and parallel path to the hits on B alone; `None` without a complete set of them.
///
/// Cells whose lines differ from those of the first are reported in `missing`. The hits are
/// transformed to the virtual point by the impacts' transformation, so that a hit away from the
/// contact is weighted by its lever arm.
fn arm_from_hits(
    averages: &[CellAverage],
    points: &Configuration,
    virtual_point_m: [f64; 3],
    sigma_per_s: f64,
    parallel_path: Option<f64>,
    missing: &mut Vec<Missing>,
) -> Option<Identified> {
    let mut hit: Vec<(&Point, CrossSpectra)> = Vec::new();
    let mut frequency_hz: &[f64] = &[];
    for cell in averages.iter().filter(|cell| cell.name.configuration == Structure::B) {
        let Some(contact) = &cell.contact else { continue };
        if frequency_hz.is_empty() {
            frequency_hz = cell.spectra.frequency_hz();
        }
        let added = match hit.iter_mut().find(|(point, _)| point.name == cell.name.impact) {
            Some((_, sum)) => sum.add(contact).is_ok(),
            None if contact.lines() != frequency_hz.len() => false,
            None => {
                let point = points.impacts.iter().find(|point| point.name == cell.name.impact)?;
                hit.push((point, contact.clone()));
                true
            }
        };
        if !added {
            missing.push(Missing::OtherLines(cell.name.clone()));
        }
    }
    if hit.is_empty() {
        return None;
    }
    let impacts: Vec<Point> = hit.iter().map(|(point, _)| (*point).clone()).collect();
    let transformation = vpt::impacts(&impacts, Vector3::from(virtual_point_m), IdmSet::Six, None).ok()?;
    let z = IdmSet::Six.position(Dof::Z)?;
    let lines: Vec<(Complex<f64>, Complex<f64>)> = frequency_hz
        .iter()
        .enumerate()
        .filter(|(_, f)| (FIT_HZ[0]..=FIT_HZ[1]).contains(*f))
        .map(|(l, f)| {
            let per_newton = |signal: usize| -> Complex<f64> {
                hit.iter().enumerate().map(|(i, (_, sum))| sum.h1(l, signal) * transformation.t[(i, z)]).sum()
            };
            // the cells' sum, and B's acceleration from its velocity
            (per_newton(2), per_newton(1) * Complex::new(sigma_per_s, TAU * f))
        })
        .filter(|(t, a)| t.is_finite() && a.is_finite())
        .collect();
    from_known_force(&lines, parallel_path)
}

/// The two specimens' receptances from one impact, their difference, and the load cells' force; hit
/// and response are positive along +z, so `sign` is −1 for a hit towards −z.
fn specimen_curves(impact: &str, sign: f64, average: &CrossSpectra) -> [FrfCurve; 4] {
    let of = |output: usize, line: usize| sign * average.h1(line, output);
    let receptance = |output: usize| move |line: usize| of(output, line) / average.s(line);
    [
        curve(impact, average, (Role::SpecimenA, "x_A", Some(0)), receptance(0)),
        curve(impact, average, (Role::SpecimenB, "x_B", Some(1)), receptance(1)),
        curve(impact, average, (Role::Relative, "Δx", None), |line| {
            (of(0, line) - of(1, line)) / average.s(line)
        }),
        curve(impact, average, (Role::Force, "T", Some(2)), |line| of(2, line)),
    ]
}

/// One curve; its coherence is that of the measured output, if it is a measured one.
fn curve(
    impact: &str,
    average: &CrossSpectra,
    (role, output, measured): (Role, &str, Option<usize>),
    value: impl Fn(usize) -> Complex<f64>,
) -> FrfCurve {
    let frequency_hz = average.frequency_hz();
    let step_hz = if frequency_hz.len() > 1 { frequency_hz[1] - frequency_hz[0] } else { 0.0 };
    let (magnitude_m_per_n, phase_deg) = (0..average.lines())
        .map(value)
        .map(|y| (rounded(y.norm(), 5), rounded(y.arg().to_degrees(), 5)))
        .unzip();
    let coherence = measured.filter(|_| average.hits() > 1).map_or_else(Vec::new, |i| {
        (0..average.lines())
            .map(|l| average.coherence(l, i))
            .map(|c| rounded(if c.is_finite() { c } else { 0.0 }, 5))
            .collect()
    });
    FrfCurve {
        configuration: Structure::Ajb.into(),
        role,
        output: output.into(),
        input: impact.into(),
        hits: average.hits(),
        first_hz: frequency_hz.first().copied().unwrap_or(0.0),
        step_hz,
        magnitude_m_per_n,
        phase_deg,
        coherence,
    }
}

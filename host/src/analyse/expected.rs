//! The interval of k_T to expect from a plan, before anything is measured.
//!
//! The FRFs of the simulated rig's structure at the plan's points are exact, the noise of usual
//! sensors is added to them, and the estimator reads the result as it would read a campaign. So the
//! interval contains the plan's positions, hits and priors, and the noise; what it assumes of the
//! structure (masses, clamps, load cells) is that of the simulated rig.

use super::cell::CellName;
use super::contact_answer::reads;
use super::plan_geometry::geometry;
use crate::campaign::plan::{Plan, structure};
use crate::contact::{
    Axes, BAND, ContactCell, ContactError, ContactPriors, Input, KnownMass, SIGMA_PER_S, Stiffness, stiffness,
};
use crate::spectra::cross_spectra::OutputSums;
use crate::spectra::{CrossSpectra, MotionQuantity};
use crate::structure::Structure;
use crate::substructuring::geometry::{Geometry, Grouping, Point};
use jointrig_hil_sim::rig::config::BodyName;
use jointrig_hil_sim::rig::{Configuration, Probe, Quantity, RigConfig, exact_frf};
use num_complex::Complex;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use std::f64::consts::{PI, TAU};

/// The contacts for which an interval is estimated, N/m.
const CONTACTS_N_PER_M: [f64; 3] = [60e6, 180e6, 300e6];
/// Spacing of the lines, Hz.
const STEP_HZ: f64 = 5.0;
/// Duration of a hit, s.
const PULSE_S: f64 = 4.1e-4;
/// Noise of a triaxial accelerometer, m/s²/√Hz: 30 µg/√Hz.
const TRIAXIAL_FLOOR: f64 = 3e-4;
/// Noise of an accelerometer with a single axis, m/s²/√Hz: 10 µg/√Hz.
const SINGLE_FLOOR: f64 = 1e-4;
/// Seed of the noise: the same plan always gives the same estimate.
const SEED: u64 = 1;

/// What a plan would give on the simulated rig with one contact.
#[derive(Debug, Clone, PartialEq)]
pub struct Expected {
    /// k_T of the contact, N/m.
    pub contact_n_per_m: f64,
    /// The estimate, or why there is none.
    pub found: Result<Stiffness, ContactError>,
}

/// What the plan would give for a soft, a usual and a stiff contact; `None` if the plan
/// slides along another direction than the simulated rig.
pub fn expected(plan: &Plan) -> Option<Vec<Expected>> {
    // spots and load cells of the simulated rig are along z
    if !plan.slides_along_z() {
        return None;
    }
    let geometry = geometry(plan);
    CONTACTS_N_PER_M.into_iter().map(|k| one(plan, &geometry, k)).collect()
}

/// What the plan's known mass will show: nothing is off, and noise is far below the mass's own
/// error.
fn expected_on_mass(plan: &Plan) -> Option<KnownMass> {
    let (own, cell) = (plan.known_mass.as_ref()?.get_ref(), plan.known_mass_cell()?);
    let right = Some([1.0, 1e-3]);
    let spots = if cell.lasers { [right; 2] } else { [None; 2] };
    Some(KnownMass { sigma: own.sigma(), spots, point: right, axis: cell.axis })
}

/// A cell's spectra, with what identifies its hits.
struct SimulatedCell {
    name: CellName,
    spectra: CrossSpectra,
    hits: i64,
    fixed: bool,
}

fn one(plan: &Plan, geometry: &Geometry, contact_n_per_m: f64) -> Option<Expected> {
    let mut rig = RigConfig::elastic();
    let stiffer = contact_n_per_m / rig.contact.stiffness_n_per_m[2];
    rig.contact.stiffness_n_per_m = rig.contact.stiffness_n_per_m.map(|k| k * stiffer);
    let spots = spots(plan);
    let mut simulation = Simulation {
        plan,
        geometry,
        rig: &rig,
        spots,
        random: Xoshiro256PlusPlus::seed_from_u64(SEED),
        sets: 0,
        cells: Vec::new(),
    };
    for structure in [Structure::B, Structure::Ajb] {
        for impact in &geometry.points(structure).impacts {
            simulation.strike(structure, impact)?;
        }
    }
    let cells = simulation.cells;
    let sets: Vec<[i64; 1]> = cells.iter().map(|cell| [cell.hits]).collect();
    let sigma_m = |name: &str| plan.response(name).and_then(|point| point.sigma_m);
    let mut input = Input {
        cells: Vec::new(),
        contact_m: geometry.virtual_point_b_m,
        spots_m: spots,
        specimens: plan.known_specimens(),
        parallel_path: None,
        priors: plan.priors.as_ref().map_or_else(ContactPriors::default, |p| p.get_ref().known()),
        known_mass: expected_on_mass(plan),
        band_hz: BAND,
    };
    for (cell, records) in cells.iter().zip(&sets) {
        let points = geometry.points(cell.name.configuration);
        let impact = points.impacts.iter().find(|p| p.name == cell.name.impact)?;
        let own: Vec<&Point> = points.channels.iter().filter(|p| p.name == cell.name.response).collect();
        let point = *own.first()?;
        let axes = Axes::new(&own.iter().map(|p| p.direction).collect::<Vec<_>>())?;
        input.cells.push(ContactCell {
            structure: cell.name.configuration,
            impact: &impact.name,
            impact_m: impact.position_m,
            direction: impact.direction,
            impact_grouping: impact.grouping,
            point: &point.name,
            point_m: point.position_m,
            point_sigma_m: sigma_m(&point.name),
            point_grouping: point.grouping,
            axes,
            fixed: cell.fixed,
            lasers: plan.response(&point.name).is_some_and(|point| point.lasers),
            records,
            spectra: &cell.spectra,
            quantity: if cell.fixed { MotionQuantity::Acceleration } else { MotionQuantity::Velocity },
        });
    }
    Some(Expected { contact_n_per_m, found: stiffness(&input) })
}

/// Positions of the lasers next to the contact; `None` without.
fn spots(plan: &Plan) -> Option<[[f64; 3]; 2]> {
    let at = |name: &str| {
        let mut sensors = plan.geometry.sensor.iter().map(toml::Spanned::get_ref);
        sensors.find(|sensor| sensor.name == name).map(|sensor| sensor.position_m)
    };
    Some([at("LDV_A")?, at("LDV_B")?])
}

struct Simulation<'a> {
    plan: &'a Plan,
    geometry: &'a Geometry,
    rig: &'a RigConfig,
    spots: Option<[[f64; 3]; 2]>,
    random: Xoshiro256PlusPlus,
    /// Number of sets of hits so far.
    sets: i64,
    cells: Vec<SimulatedCell>,
}

/// Signals of one output: by line, then hit, each as a transform (unit × s).
type Hits = Vec<Vec<Complex<f64>>>;

impl Simulation<'_> {
    /// Hits one impact and adds the cells that the estimator reads; `None` if a point is on no
    /// body.
    fn strike(&mut self, of: Structure, impact: &Point) -> Option<()> {
        let (plan, rig) = (self.plan, self.rig);
        let own = |cell: &&crate::campaign::plan::Cell| {
            structure(cell.configuration) == of && cell.impact == impact.name
        };
        let cells = plan.cells();
        let names: Vec<CellName> = (cells.iter().filter(own))
            .map(|cell| CellName {
                configuration: of,
                impact: cell.impact.clone(),
                response: cell.response.clone(),
            })
            .filter(|name| reads(self.geometry, name))
            .collect();
        let points = &self.geometry.points(of).channels;
        let mut outputs: Vec<Probe> = Vec::new();
        for point in names.iter().flat_map(|name| points.iter().filter(|p| p.name == name.response)) {
            outputs.push(self.probe(point.grouping, point.position_m, point.direction));
        }
        let measured = outputs.len();
        let along_z = |body, position_m| Probe { body, position_m, direction: [0.0, 0.0, 1.0] };
        outputs.extend(rig.load_cells.iter().map(|cell| along_z(BodyName::ArmB, cell.position_m)));
        if let Some([a, b]) = self.spots {
            let [a, b] = [a, b].map(|at| self.relative(at));
            outputs.push(along_z(BodyName::SpecimenB, b));
            if of == Structure::Ajb {
                outputs.push(along_z(BodyName::SpecimenA, a));
            }
        }
        let hit = self.probe(impact.grouping, impact.position_m, impact.direction);
        let count = ((BAND.high_hz - BAND.low_hz) / STEP_HZ) as u32;
        let frequency_hz: Vec<f64> = (0..=count).map(|n| BAND.low_hz + STEP_HZ * f64::from(n)).collect();
        let s: Vec<Complex<f64>> = frequency_hz.iter().map(|f| Complex::new(SIGMA_PER_S, TAU * f)).collect();
        let configuration = if of == Structure::B { Configuration::B } else { Configuration::Ajb };
        let frf = exact_frf(rig, configuration, Quantity::Receptance, &s, &outputs, &[hit]).ok()?;

        // impulse of a half-sine, flat over the band
        let impulse_n_s = 2.0 * PULSE_S * plan.force.get_ref().target_n / PI;
        let cells_n_per_m: Vec<f64> = rig.load_cells.iter().map(|cell| cell.stiffness_n_per_m[2]).collect();
        let rate_hz = f64::from(rig.scan_rate_hz);
        let t_floor = rig.sensors.load_cells.noise_n * (cells_n_per_m.len() as f64 / (rate_hz / 2.0)).sqrt();
        let value = |line: usize, output: usize, order: i32| {
            impulse_n_s * frf[line][(output, 0)] * s[line].powi(order)
        };
        let lines = 0..s.len();
        let force: Vec<Complex<f64>> = lines
            .clone()
            .map(|l| cells_n_per_m.iter().enumerate().map(|(n, k)| value(l, measured + n, 0) * k).sum())
            .collect();
        let spot = |n: usize| -> Vec<Complex<f64>> {
            let place = measured + cells_n_per_m.len() + n;
            lines
                .clone()
                .map(|l| if place < outputs.len() { value(l, place, 1) } else { 0.0.into() })
                .collect()
        };
        let at_contact = self.spots.map(|_| [spot(1), spot(0)]);

        let mut shared: Option<(i64, Vec<Hits>)> = None;
        let mut from = 0;
        for name in names {
            let axes = points.iter().filter(|p| p.name == name.response).count();
            let fixed = plan.own_channels(&name.response).is_some();
            // on B alone both vibrometers may be aimed at the point, along z
            let together = of == Structure::B && plan.response(&name.response).is_some_and(|own| own.lasers);
            let at_point = || -> Option<[Vec<Complex<f64>>; 2]> {
                let mut own = (from..from + axes).filter(|place| outputs[*place].direction[2] > 0.9);
                let z = own.next()?;
                Some([0, 1].map(|_| lines.clone().map(|l| value(l, z, 1)).collect()))
            };
            let of_spots = if together { at_point() } else { at_contact.clone() };
            let (order, floor) = match (fixed, axes) {
                (false, _) => (1, rig.sensors.vibrometer.floor),
                (true, 1) => (2, SINGLE_FLOOR),
                (true, _) => (2, TRIAXIAL_FLOOR),
            };
            // v_A, v_B and T are those of the hits, which all fixed sensors share
            let (hits, beside) = if let Some(set) = shared.clone().filter(|_| fixed) {
                set
            } else {
                self.sets += 1;
                let mut signals = Vec::new();
                for spot in of_spots.iter().flatten() {
                    signals.push(self.noisy(spot, rig.sensors.ldv_a.floor));
                }
                signals.push(self.noisy(&force, t_floor));
                (self.sets, signals)
            };
            if fixed {
                shared = Some((hits, beside.clone()));
            }
            let mut all: Vec<Hits> = Vec::new();
            for output in from..from + axes {
                let exact: Vec<Complex<f64>> = lines.clone().map(|l| value(l, output, order)).collect();
                all.push(self.noisy(&exact, floor));
            }
            all.extend(beside);
            from += axes;
            let wanted = plan.hits.get_ref().wanted as usize;
            let sums = |hits: &Hits| OutputSums {
                s_xf: hits.iter().map(|own| own.iter().sum::<Complex<f64>>() * impulse_n_s).collect(),
                s_xx: hits.iter().map(|own| own.iter().map(Complex::norm_sqr).sum()).collect(),
                ..OutputSums::default()
            };
            let s_ff = vec![wanted as f64 * impulse_n_s * impulse_n_s; s.len()];
            let outputs = all.iter().map(sums).collect();
            let spectra =
                CrossSpectra::new(1.0, frequency_hz.clone(), SIGMA_PER_S, wanted, s_ff, outputs).ok()?;
            self.cells.push(SimulatedCell { name, spectra, hits, fixed });
        }
        Some(())
    }

    /// The plan's hits of one signal, with white noise of this floor (unit/√Hz).
    fn noisy(&mut self, exact: &[Complex<f64>], floor: f64) -> Hits {
        // E|N|² of a windowed transform is floor²/2 · ∫ e^(−2σt) dt; half of it is in each part
        let sigma = floor / (8.0 * SIGMA_PER_S).sqrt();
        let random = &mut self.random;
        let mut part = || {
            let normal: f64 = StandardNormal.sample(random);
            sigma * normal
        };
        let wanted = self.plan.hits.get_ref().wanted;
        let mut hit = |x: &Complex<f64>| x + Complex::new(part(), part());
        exact.iter().map(|x| (0..wanted).map(|_| hit(x)).collect()).collect()
    }

    /// A position relative to the contact, which is the simulated rig's origin.
    fn relative(&self, at: [f64; 3]) -> [f64; 3] {
        let contact_m = self.geometry.virtual_point_b_m;
        std::array::from_fn(|axis| at[axis] - contact_m[axis])
    }

    /// A direction at a point of the simulated rig's body with this grouping.
    fn probe(&self, grouping: Grouping, at: [f64; 3], direction: [f64; 3]) -> Probe {
        let body = match grouping {
            Grouping::InterfaceA => BodyName::ArmA,
            Grouping::InternalA => BodyName::Mass,
            Grouping::InterfaceB | Grouping::InternalB => BodyName::ArmB,
            Grouping::SpecimenA => BodyName::SpecimenA,
            Grouping::SpecimenB => BodyName::SpecimenB,
        };
        Probe { body, position_m: self.relative(at), direction }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::plan::{CONTACT, CONTACT_BY_HAND};

    /// With all sensors of side B on its arm, k_T includes specimen B: 10 mm of steel, 18 × 14 mm,
    /// in shear and bending (1040 N/µm) in series with 180 N/µm.
    const WITH_SPECIMEN_B: f64 = 153e6;

    /// Relative half width at 180 N/µm, where this stiffness is to be found.
    fn half(text: &str, contact_n_per_m: f64) -> f64 {
        let plan = Plan::parse(text, "plan").expect("a good plan");
        let all = expected(&plan).expect("on the rig's bodies");
        let found = all[1].found.as_ref().expect("identified");
        let [low, high] = found.k_t_n_per_m.ci95;
        assert!(low < contact_n_per_m && contact_n_per_m < high, "{:?}", found.k_t_n_per_m);
        0.5 * (high - low) / found.k_t_n_per_m.mean
    }

    #[test]
    fn the_interval_to_expect_is_what_campaigns_have() {
        // campaigns on the simulated rig have 4.5 % with lasers, and 15 % with accelerometers:
        // nothing is stated of the bulk between them and the contact
        let (lasers, accelerometers) = (half(CONTACT, 180e6), half(CONTACT_BY_HAND, WITH_SPECIMEN_B));
        assert!((0.02..0.06).contains(&lasers), "{lasers}");
        assert!((0.1..0.2).contains(&accelerometers), "{accelerometers}");
        let steel = "{ section_m = [0.018, 0.014], clamp_m = 0.012, young_pa = 2.1e11 }";
        let stated = format!("{CONTACT_BY_HAND}\n[specimens]\na = {steel}\nb = {steel}\n");
        assert!(half(&stated, WITH_SPECIMEN_B) < 0.7 * accelerometers);
        // more hits leave less noise, and worse positions widen it, although the signals correct
        // them
        let more = CONTACT_BY_HAND.replace("wanted = 10", "wanted = 25");
        assert!(half(&more, WITH_SPECIMEN_B) < 0.9 * accelerometers);
        let worse = CONTACT_BY_HAND.replace("sigma_m = 2e-4", "sigma_m = 1e-3");
        assert!(half(&worse, WITH_SPECIMEN_B) > 1.05 * accelerometers);
    }
}

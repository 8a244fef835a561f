//! A complete small simulated campaign with a known joint: two masses on springs, coupled, hit and
//! measured.

use super::assemble;
use super::campaign::analyse_measurements;
use super::cell::{CellName, ContactDelays, ContactSignals, Hit, Measurements};
use super::cell::{Progress, Wanted};
use super::checks::{HiddenResonance, SeriesCompliance};
use super::findings::Findings;
use super::missing::Missing;
use crate::results::MAIN_BAND;
use crate::spectra::MotionQuantity;
use crate::structure::Structure;
use crate::substructuring::geometry::{Configuration, Geometry, Grouping, Point};
use crate::substructuring::{Dof, JointRow};
use std::collections::BTreeSet;

const FS_HZ: f64 = 20_480.0;
const SAMPLES: usize = 40_960;
const SIGMA: f64 = 2.3;

/// Contact stiffness in z, N/m.
const CONTACT: f64 = 180e6;

/// A rig of rigid bodies guided along z: A (mass m_a on k_a), B (m_b on k_b); all points of a body
/// have the same motion in z.
struct Rig {
    geometry: Geometry,
    /// Cells that were not measured.
    absent: BTreeSet<(Structure, String, String)>,
    /// Responses to a hit of one newton on A alone, on B alone, and on A and on B in the assembly.
    units: [Unit; 4],
}

struct Unit {
    force: Vec<f64>,
    velocity: [Vec<f64>; 2],
}

fn point(name: &str, description: &str, grouping: Grouping, position_m: [f64; 3], axis: usize) -> Point {
    let mut direction = [0.0; 3];
    direction[axis] = 1.0;
    Point { name: name.into(), description: description.into(), grouping, position_m, direction }
}

fn location(name: &str, grouping: Grouping, position_m: [f64; 3]) -> Vec<Point> {
    ["x", "y", "z"]
        .iter()
        .enumerate()
        .map(|(axis, letter)| point(name, &format!("{name}:{letter}"), grouping, position_m, axis))
        .collect()
}

impl Rig {
    fn new() -> Self {
        use Grouping::{InterfaceA, InterfaceB};
        let at = |x: f64, side: f64| [x, side * 0.02, 0.03];
        let responses = |on_a: bool| -> Vec<Point> {
            let (letter, grouping, side) =
                if on_a { ("A", InterfaceA, 1.0) } else { ("B", InterfaceB, -1.0) };
            (0..2)
                .flat_map(|i| {
                    location(&format!("{letter}{}", i + 1), grouping, at(0.02 * f64::from(i), side))
                })
                .collect()
        };
        let impacts = |on_a: bool| -> Vec<Point> {
            let (letter, grouping, side) =
                if on_a { ("A", InterfaceA, 1.0) } else { ("B", InterfaceB, -1.0) };
            let mut points = Vec::new();
            for (axis, name) in [(1, "Y"), (2, "Z")] {
                for i in 0..2 {
                    points.push(point(
                        &format!("{letter}{name}{}", i + 1),
                        "",
                        grouping,
                        at(0.015 * f64::from(i), side),
                        axis,
                    ));
                }
            }
            points
        };
        let both = |part: &dyn Fn(bool) -> Vec<Point>| [part(true), part(false)].concat();
        Rig {
            geometry: Geometry {
                a: Configuration { channels: responses(true), impacts: impacts(true) },
                b: Configuration { channels: responses(false), impacts: impacts(false) },
                ajb: Configuration { channels: both(&responses), impacts: both(&impacts) },
                virtual_point_a_m: [0.0; 3],
                virtual_point_b_m: [0.0; 3],
            },
            absent: BTreeSet::new(),
            units: [(false, true), (false, false), (true, true), (true, false)].map(|(c, a)| unit_hit(c, a)),
        }
    }

    /// Adds a point on specimen A, whose motion differs from that of its arm; it is measured only
    /// with hits along z on A in the assembly.
    fn with_specimen(mut self) -> Self {
        let ajb = &mut self.geometry.ajb;
        ajb.channels.extend(location("S1", Grouping::SpecimenA, [0.009, 0.002, 0.03]));
        self.without(|cell| cell.response != "S1" || cell.impact.starts_with("AZ"))
    }

    fn without(mut self, keep: impl Fn(&CellName) -> bool) -> Self {
        self.absent = self
            .cells()
            .into_iter()
            .filter(|c| !keep(c))
            .map(|c| (c.configuration, c.impact, c.response))
            .collect();
        self
    }

    fn grouping(&self, configuration: Structure, name: &str) -> Grouping {
        let points = self.geometry.points(configuration);
        points.impacts.iter().chain(&points.channels).find(|p| p.name == name).expect("a point").grouping
    }
}

/// Force and velocities of both bodies along one axis after a half-sine hit of 1 N on A or B:
/// velocity Verlet at 6 µs. The pulse is 25 samples long, so that its aliases stay below 1e-3.
fn unit_hit(coupled: bool, on_a: bool) -> Unit {
    let (m, k, c) = ([4.0, 2.0], [8e6, 150e6], [120.0, 900.0]);
    let (contact, damper) = if coupled { (CONTACT, 600.0) } else { (0.0, 0.0) };
    let steps = 8;
    let dt = 1.0 / (FS_HZ * f64::from(steps));
    let hit = |t: f64| {
        let share = (t - 0.005) / 1.2e-3;
        if (0.0..1.0).contains(&share) { (std::f64::consts::PI * share).sin() } else { 0.0 }
    };
    let acceleration = |x: [f64; 2], v: [f64; 2], f: f64| -> [f64; 2] {
        let joint = contact * (x[0] - x[1]) + damper * (v[0] - v[1]);
        let (on_first, on_second) = if on_a { (f, 0.0) } else { (0.0, f) };
        [
            (on_first - joint - k[0] * x[0] - c[0] * v[0]) / m[0],
            (on_second + joint - k[1] * x[1] - c[1] * v[1]) / m[1],
        ]
    };
    let (mut x, mut v, mut a) = ([0.0f64; 2], [0.0f64; 2], [0.0f64; 2]);
    let mut unit = Unit { force: Vec::with_capacity(SAMPLES), velocity: [Vec::new(), Vec::new()] };
    for step in 0..SAMPLES * steps as usize {
        let t = step as f64 * dt;
        if step.is_multiple_of(steps as usize) {
            unit.force.push(hit(t));
            unit.velocity[0].push(v[0]);
            unit.velocity[1].push(v[1]);
        }
        let half = [v[0] + 0.5 * dt * a[0], v[1] + 0.5 * dt * a[1]];
        x = [x[0] + dt * half[0], x[1] + dt * half[1]];
        // damping uses the half-step velocity advanced by the old acceleration
        let ahead = [half[0] + 0.5 * dt * a[0], half[1] + 0.5 * dt * a[1]];
        a = acceleration(x, ahead, hit(t + dt));
        v = [half[0] + 0.5 * dt * a[0], half[1] + 0.5 * dt * a[1]];
    }
    unit
}

#[derive(Debug, thiserror::Error)]
#[error("damaged")]
struct Damaged;

impl Measurements for Rig {
    type Error = Damaged;

    fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    fn sigma_per_s(&self) -> f64 {
        SIGMA
    }

    fn quantity(&self) -> MotionQuantity {
        MotionQuantity::Velocity
    }

    fn cells(&self) -> Vec<CellName> {
        let mut cells = Vec::new();
        for configuration in Structure::ALL {
            let points = self.geometry.points(configuration);
            for impact in &points.impacts {
                for response in assemble::locations(points) {
                    cells.push(CellName {
                        configuration,
                        impact: impact.name.clone(),
                        response: response.into(),
                    });
                }
            }
        }
        cells
    }

    fn each_hit(
        &self,
        cell: &CellName,
        _: bool,
        look: &mut dyn FnMut(&Hit, f64),
    ) -> Result<Vec<String>, Damaged> {
        if self.absent.contains(&(cell.configuration, cell.impact.clone(), cell.response.clone())) {
            return Ok(Vec::new());
        }
        if cell.response == "damaged" {
            return Err(Damaged);
        }
        let hit_on_a = matches!(self.grouping(cell.configuration, &cell.impact), Grouping::InterfaceA);
        let seen_on = self.grouping(cell.configuration, &cell.response);
        let seen_on_a = matches!(seen_on, Grouping::InterfaceA | Grouping::SpecimenA);
        let (apart, own_records) = if seen_on.is_specimen() { (1.5, 10_000) } else { (1.0, 0) };
        let along_z = cell.impact.contains('Z');
        let place = self.cells().iter().filter(|c| c.response != "S1").position(|c| c == cell);
        let coupled = cell.configuration == Structure::Ajb;
        let unit = &self.units[2 * usize::from(coupled) + usize::from(!hit_on_a)];
        [50.0, 47.0]
            .into_iter()
            .enumerate()
            .map(|(i, peak)| {
                // y and z of a body are equivalent, each excited only by hits along it
                let scaled = |signal: &[f64]| signal.iter().map(|s| s * peak).collect::<Vec<f64>>();
                let (still, moved) = (vec![0.0; SAMPLES], scaled(&unit.velocity[usize::from(!seen_on_a)]));
                let moved: Vec<f64> = moved.into_iter().map(|v| apart * v).collect();
                let response = if along_z {
                    [still.clone(), still.clone(), moved]
                } else {
                    [still.clone(), moved, still.clone()]
                };
                let contact = (coupled && along_z).then(|| {
                    let [a, b] = [0, 1].map(|body| scaled(&unit.velocity[body]));
                    // the load cells measure the force in B's spring
                    let x_b = crate::hysteresis::cycles::open_record(&b, 0.0, 1.0 / FS_HZ);
                    let tangential_n = x_b.iter().map(|x| 150e6 * x).collect();
                    ContactSignals {
                        specimen_a_m_per_s: a,
                        specimen_b_m_per_s: b,
                        tangential_n,
                        delay_s: ContactDelays::default(),
                    }
                });
                Hit {
                    record: i64::try_from(10 * place.unwrap_or_default() + i).expect("small") + own_records,
                    of_row: false,
                    force_n: scaled(&unit.force),
                    response: response.to_vec(),
                    response_delay_s: vec![0.0; 3],
                    contact,
                    load_cells: None,
                }
            })
            .for_each(|hit| look(&hit, FS_HZ));
        Ok(Vec::new())
    }
}

fn quiet(_: Progress) {}

fn run(rig: &Rig) -> Findings {
    analyse_measurements(rig, Wanted::default(), &quiet)
}

fn rows(found: &Findings) -> Vec<&JointRow> {
    found.substructured.iter().flat_map(|s| &s.rows).map(|row| &row.joint).collect()
}

/// Whether there is a row of the paper's method over the main band with a stiffness along z.
fn headline(found: &Findings) -> bool {
    rows(found).iter().any(|row| {
        row.band_hz == MAIN_BAND
            && row.stiffness_n_per_m.get(&Dof::Z).is_some_and(|k| k.mean.is_finite() && k.std.is_finite())
    })
}

fn left_out(found: &Findings) -> bool {
    found
        .missing
        .iter()
        .any(|m| matches!(m, Missing::ImpactsLeftOut { .. } | Missing::ResponsesLeftOut { .. }))
}

#[test]
fn a_known_joint_comes_back_both_ways() {
    let found = run(&Rig::new());
    let rows = rows(&found);
    let two = rows
        .iter()
        .find(|j| j.method == "internal" && j.idms == 2 && j.band_hz == MAIN_BAND)
        .expect("two modes are all this rig has");
    let k = two.stiffness_n_per_m[&Dof::Z];
    // aliases of the pulse, 1e-3, are amplified by |Y_A + Y_B| / |Y_J|, about ten here
    assert!((k.mean / CONTACT - 1.0).abs() < 0.03, "{k:?}");
    let contact = found.contact.as_ref().expect("looked for");
    let impacts = contact.impacts.as_ref().expect("hits along z on A");
    // T is B's spring force, which lacks B's inertia: some tens of per cent at this rig's mode
    let slope = impacts.slope_n_per_m.mean;
    assert!((0.5..2.0).contains(&(slope / CONTACT)), "{slope}");
    assert_eq!(impacts.slopes.len(), 2 * 4 * 2);
    assert!(contact.example_loop.is_some());
    assert!(found.configurations.len() == 3 && found.configurations.iter().all(|c| !c.records.is_empty()));
    assert_ne!(contact.series, SeriesCompliance::NotBoth);
    assert_ne!(contact.hidden, HiddenResonance::NoSignals);
}

#[test]
fn without_a_there_are_still_loops() {
    let found = run(&Rig::new().without(|c| c.configuration != Structure::A));
    // the specimens' T/Δx needs only the assembly
    assert!(found.substructured.is_none() && found.fits.is_empty());
    let contact = found.contact.expect("looked for");
    assert!(contact.impacts.is_some() && contact.direct.is_some());
    for missing in [
        Missing::NotMeasured { configuration: Structure::A, planned: 8 },
        Missing::Configurations(vec![Structure::A]),
    ] {
        assert!(found.missing.contains(&missing), "{missing:?} not in {:?}", found.missing);
    }
}

#[test]
fn a_hole_costs_a_row_or_column_only_where_it_is_read() {
    let hole = |impact: &'static str, response: &'static str| {
        run(&Rig::new().without(|c| {
            !(c.configuration == Structure::Ajb && c.impact == impact && c.response == response)
        }))
    };
    let spare = hole("BZ2", "A1");
    let absent = Missing::CellsWithoutHit { configuration: Structure::Ajb, absent: 1, planned: 32 };
    assert!(spare.missing.contains(&absent), "{:?}", spare.missing);
    assert!(!left_out(&spare), "{:?}", spare.missing);
    assert!(headline(&spare), "{:?}", spare.missing);
    let read = hole("AZ2", "B1");
    assert!(left_out(&read), "{:?}", read.missing);
    assert!(headline(&read), "{:?}", read.missing);
}

#[test]
fn nothing_measured_is_no_error() {
    let found = run(&Rig::new().without(|_| false));
    let contact = found.contact.expect("looked for");
    assert!(found.substructured.is_none() && found.fits.is_empty() && found.recommended.is_empty());
    assert!(contact.direct.is_none() && contact.impacts.is_none() && contact.levels.is_empty());
    assert_eq!((contact.series.ok(), contact.hidden.ok(), contact.change), (None, None, None));
}

/// The added cells are measured and averaged, and give the contact stage more data; the results
/// from the arms' FRFs are unchanged.
#[test]
fn points_on_a_specimen_change_nothing_of_the_arms() {
    let (plain, whole) = (run(&Rig::new()), run(&Rig::new().with_specimen()));
    let arms = |found: &Findings| {
        let shown: Vec<_> = found.configurations.iter().map(|c| &c.frfs).collect();
        // compare as text, because some numbers are NaN and NaN is not equal to itself
        format!("{:?} {:?} {:?} {shown:?}", found.substructured, found.recommended, found.fits)
    };
    assert!(headline(&whole) && !left_out(&whole), "{:?}", whole.missing);
    let (plain_arms, whole_arms) = (arms(&plain), arms(&whole));
    let differs = plain_arms.bytes().zip(whole_arms.bytes()).position(|(one, other)| one != other);
    let shown = |text: &str, at: usize| text[at.saturating_sub(200)..(at + 100).min(text.len())].to_owned();
    assert_eq!(differs.map(|at| (shown(&plain_arms, at), shown(&whole_arms, at))), None);
    assert_eq!(plain_arms.len(), whole_arms.len());
    let records = |found: &Findings| found.configurations[2].records.len();
    assert_eq!(records(&whole), records(&plain) + 2 * 2);
    // six impacts have no cell on the specimen; a real plan would not have them either
    let absent = Missing::CellsWithoutHit { configuration: Structure::Ajb, absent: 6, planned: 40 };
    assert!(whole.missing.contains(&absent), "{:?}", whole.missing);
}

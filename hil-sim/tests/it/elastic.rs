//! Rigs whose bodies bend.
#![allow(clippy::unwrap_used)]

use jointrig_hil_sim::rig::config::{Beam, BodyName, ImpactPoint, OwnName, ResponsePoint, RigConfig, Side};
use jointrig_hil_sim::rig::config::{OwnBody, OwnStructure, Spring};
use jointrig_hil_sim::rig::structure::Structure;
use jointrig_hil_sim::rig::{CHANNELS, Configuration, Probe, Quantity, Rig, exact_frf};
use nalgebra::DMatrix;
use num_complex::Complex;
use std::f64::consts::TAU;

const ELASTIC: &str = include_str!("../../rigs/elastic.toml");

fn elastic() -> RigConfig {
    RigConfig::from_toml(ELASTIC).unwrap()
}

fn beams(config: &mut RigConfig) -> [&mut Option<Beam>; 4] {
    let bodies = &mut config.bodies;
    [&mut bodies.specimen_a, &mut bodies.specimen_b, &mut bodies.arm_a, &mut bodies.arm_b]
        .map(|body| &mut body.beam)
}

/// FRFs of all probes of a configuration.
fn frfs(config: &RigConfig, configuration: Configuration, hz: &[f64]) -> Vec<DMatrix<Complex<f64>>> {
    let there = |body| config.has(configuration, body);
    let points = config.responses.iter().filter(|point| there(point.body));
    let mut outputs: Vec<_> = points.flat_map(ResponsePoint::probes).collect();
    let spots = [&config.spots.ldv_a, &config.spots.ldv_b];
    outputs.extend(spots.into_iter().filter(|spot| there(spot.body)).map(Probe::along_z));
    let inputs: Vec<_> =
        config.impacts.iter().filter(|point| there(point.body)).map(ImpactPoint::probe).collect();
    let s: Vec<_> = hz.iter().map(|hz| Complex::new(2.3, TAU * hz)).collect();
    exact_frf(config, configuration, Quantity::Mobility, &s, &outputs, &inputs).unwrap()
}

/// Largest difference of two sets, relative to each frequency's largest value.
fn off(one: &[DMatrix<Complex<f64>>], other: &[DMatrix<Complex<f64>>]) -> f64 {
    let largest = |all: &DMatrix<Complex<f64>>| all.iter().map(|v| v.norm()).fold(0.0, f64::max);
    one.iter().zip(other).map(|(one, other)| largest(&(one - other)) / largest(other)).fold(0.0, f64::max)
}

const BAND_HZ: [f64; 8] = [30.0, 120.0, 192.0, 300.0, 600.0, 1200.0, 2500.0, 5000.0];

#[test]
fn bodies_that_hardly_bend_are_rigid() {
    for clamps in [[false, true], [true, false], [true, true], [false, false]] {
        let mut rigid = RigConfig::default();
        let mut stiff = elastic();
        for config in [&mut rigid, &mut stiff] {
            (config.clamp.rigid, config.clamp_b.rigid) = (clamps[0], clamps[1]);
        }
        beams(&mut stiff).into_iter().flatten().for_each(|beam| beam.young_pa = 1e15);
        for configuration in Configuration::ALL {
            let off = off(&frfs(&stiff, configuration, &BAND_HZ), &frfs(&rigid, configuration, &BAND_HZ));
            // 5000 times stiffer than steel, which changes them by some per cent
            assert!(off < 2e-4, "{clamps:?} {configuration}: {off:e}");
        }
        let (stiff, rigid) = (stiff.truth(), rigid.truth());
        assert!((stiff.between_arms_k_n_per_m / rigid.between_arms_k_n_per_m - 1.0).abs() < 1e-4);
    }
    let change = off(
        &frfs(&elastic(), Configuration::Ajb, &BAND_HZ),
        &frfs(&RigConfig::default(), Configuration::Ajb, &BAND_HZ),
    );
    assert!(change > 0.05, "steel bends: {change}");
}

#[test]
fn rigid_motion_has_the_stated_mass() {
    let (rigid, elastic) = (RigConfig::default(), elastic());
    for configuration in Configuration::ALL {
        let (rigid, elastic) =
            (Structure::new(&rigid, configuration), Structure::new(&elastic, configuration));
        // place of each body's six rigid coordinates in both; specimen A is the third, arm B the
        // last of the rigid rig
        let all = [(0, 0), (6, 6), (12, 6 + 18), (18, 24 + 18)];
        let blocks: &[(usize, usize)] = match configuration {
            Configuration::A => &all[..2],
            // specimen B is held by its arm, which moves it along
            Configuration::B => &[(0, 0)],
            Configuration::Ajb => &[all[0], all[1], all[3]],
        };
        for (at, elastic_at) in blocks {
            let expected = rigid.mass.view((*at, *at), (6, 6));
            let found = elastic.mass.view((*elastic_at, *elastic_at), (6, 6));
            let scale = |i: usize| expected[(i, i)].sqrt();
            for i in 0..6 {
                for j in 0..6 {
                    let off = (found[(i, j)] - expected[(i, j)]).abs() / (scale(i) * scale(j));
                    // arm B without its specimen, and the specimen again
                    assert!(off < 1e-12, "{configuration} {at} ({i}, {j}): {off:e}");
                }
            }
        }
    }
}

#[test]
fn a_rigid_clamp_holds_a_specimen_as_a_very_stiff_one() {
    let mut rigid = elastic();
    let mut stiff = elastic();
    (rigid.clamp.rigid, stiff.clamp_b.rigid) = (true, false);
    for clamp in [&mut stiff.clamp, &mut stiff.clamp_b] {
        for bushing in [&mut clamp.loaded, &mut clamp.free] {
            bushing.position_m[0] = 0.0;
            bushing.stiffness_n_per_m = [1e14; 3];
            bushing.rotation_nm_per_rad = [1e10; 3];
            bushing.damping_s = [0.0; 6];
        }
    }
    for configuration in Configuration::ALL {
        let off = off(&frfs(&rigid, configuration, &BAND_HZ), &frfs(&stiff, configuration, &BAND_HZ));
        assert!(off < 1e-4, "{configuration}: {off:e}");
    }
    assert!((rigid.truth().between_arms_k_n_per_m / stiff.truth().between_arms_k_n_per_m - 1.0).abs() < 1e-4);
}

#[test]
fn the_truth_contains_the_specimens_bending() {
    let (rigid, bends) = (RigConfig::default().truth(), elastic().truth());
    assert_eq!(rigid.contact_k_t_n_per_m, bends.contact_k_t_n_per_m);
    // each a cantilever of 10 mm from its clamp to the contact
    let (length, [a, b], young) = (0.01_f64, [0.018_f64, 0.014_f64], 2.1e11_f64);
    let shear = 10.0 * 1.29 / (12.0 + 11.0 * 0.29) * young / 2.58 * a * b;
    let each = length.powi(3) / (3.0 * young * a * b.powi(3) / 12.0) + length / shear;
    let between = |truth: &jointrig_hil_sim::rig::Truth| 1.0 / truth.between_arms_k_n_per_m;
    let more = between(&bends) - between(&rigid);
    assert!((more / (2.0 * each) - 1.0).abs() < 1e-6, "{more:e} for {:e}", 2.0 * each);
    let clamps = 1.0 / bends.clamps_k_n_per_m.unwrap() - 1.0 / rigid.clamps_k_n_per_m.unwrap();
    assert!((clamps / (2.0 * each) - 1.0).abs() < 1e-6, "{clamps:e}");
}

fn own(name: &str) -> BodyName {
    BodyName::Own(OwnName::new(name).unwrap())
}

/// A steel bar along z between two soft supports, as bodies and the springs between them.
fn bar(bodies: Vec<OwnBody>, mut springs: Vec<Spring>) -> RigConfig {
    let (first, last) = (bodies[0].name, bodies[bodies.len() - 1].name);
    let support = |body, z: f64| Spring {
        between: [own("ground"), body],
        present: Configuration::ALL.to_vec(),
        position_m: [0.004, 0.003, z],
        stiffness_n_per_m: [3e6, 5e6, 4e6],
        rotation_nm_per_rad: [200.0; 3],
        damping_s: [2e-6; 6],
        axes: None,
    };
    springs.extend([support(first, 0.0), support(last, 0.2)]);
    let mut config = RigConfig::default();
    let base = OwnBody { of: Side::B, name: own("base"), ..bodies[0].clone() };
    config.structure = Some(OwnStructure {
        joint: [first, base.name],
        arms: [first, base.name],
        load_cells_on: None,
        load_cells_between: None,
        bodies: bodies.into_iter().chain([base]).collect(),
        springs,
    });
    config
}

const BAR_M: f64 = 0.2;
const SECTION_M: [f64; 2] = [0.03, 0.02];

fn steel(elements: u32) -> Beam {
    Beam {
        from_m: [0.0; 3],
        to_m: [0.0, 0.0, BAR_M],
        section_m: SECTION_M,
        first_edge: None,
        young_pa: 2.1e11,
        poisson: 0.29,
        damping_s: 2e-6,
        elements,
    }
}

fn slice(name: BodyName, from: f64, to: f64, beam: Option<Beam>) -> OwnBody {
    let [a, b] = SECTION_M;
    OwnBody {
        name,
        of: Side::A,
        mass_kg: 7800.0 * a * b * (to - from),
        cg_m: [0.0, 0.0, 0.5 * (from + to)],
        box_m: Some([a, b, to - from]),
        inertia_kg_m2: None,
        beam,
    }
}

/// The rigid-element method: slices joined by springs of a slice's length of the bar.
fn lumps(count: u32) -> RigConfig {
    let beam = steel(1);
    let length = BAR_M / f64::from(count);
    let name = |index: u32| own(&format!("slice{index}"));
    let place = |index: u32| length * f64::from(index);
    let bodies = (0..count).map(|index| slice(name(index), place(index), place(index + 1), None));
    let [a, b] = SECTION_M;
    let modulus = beam.young_pa / (2.0 * (1.0 + beam.poisson));
    let cowper = 10.0 * (1.0 + beam.poisson) / (12.0 + 11.0 * beam.poisson);
    let (area, of_x, of_y) = (a * b, a * b.powi(3) / 12.0, b * a.powi(3) / 12.0);
    // torsion constant of a rectangle 3:2, Timoshenko and Goodier: 0.196 a b³
    let torsion = 0.1958 * a * b.powi(3);
    let spring = |index: u32| Spring {
        between: [name(index - 1), name(index)],
        present: Configuration::ALL.to_vec(),
        position_m: [0.0, 0.0, place(index)],
        stiffness_n_per_m: [cowper * modulus * area, cowper * modulus * area, beam.young_pa * area]
            .map(|k| k / length),
        rotation_nm_per_rad: [beam.young_pa * of_x, beam.young_pa * of_y, modulus * torsion]
            .map(|k| k / length),
        damping_s: [beam.damping_s; 6],
        axes: None,
    };
    bar(bodies.collect(), (1..count).map(spring).collect())
}

#[test]
fn a_chain_of_many_lumps_is_the_beam() {
    let one = bar(vec![slice(own("bar"), 0.0, BAR_M, Some(steel(20)))], Vec::new());
    let s: Vec<_> = [200.0, 700.0, 1500.0, 3300.0, 4800.0].map(|hz| Complex::new(2.3, TAU * hz)).to_vec();
    let frf = |config: &RigConfig, body: &dyn Fn(f64) -> BodyName| {
        let probe = |z: f64, direction| Probe { body: body(z), position_m: [0.015, 0.01, z], direction };
        let places = [0.001, 0.071, 0.199];
        let directions = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let probes: Vec<_> =
            places.into_iter().flat_map(|z| directions.map(|direction| probe(z, direction))).collect();
        exact_frf(config, Configuration::A, Quantity::Mobility, &s, &probes, &probes).unwrap()
    };
    let beam = frf(&one, &|_| own("bar"));
    let apart = |count: u32| {
        let body = |z: f64| own(&format!("slice{}", (z / BAR_M * f64::from(count)).floor()));
        off(&frf(&lumps(count), &body), &beam)
    };
    let (coarse, fine) = (apart(10), apart(40));
    // a slice does not bend within: its error falls until the beam's own elements matter
    assert!(fine < 0.01 && fine < coarse / 4.0, "{coarse} {fine}");
}

#[test]
fn a_record_is_the_exact_frf_of_the_bending_rig() {
    let mut config = elastic();
    config.errors.none = true;
    let mut rig = Rig::new(&config, 1).unwrap();
    assert_eq!(rig.fallback(), None, "steel is stepped by modes");
    rig.stage(Configuration::Ajb, "AZ1", "S3", 0).unwrap();
    rig.fire(3.5e-3);
    let contact = rig.last_hit().unwrap().contacts[0];
    let dt = 1.0 / f64::from(rig.scan_rate_hz());
    let (sigma, hz) = (40.0, [150.0, 400.0, 1200.0]);
    let mut sums = vec![[Complex::new(0.0, 0.0); 2]; hz.len()];
    let mut codes = [0; CHANNELS];
    for scan in 1..=30_000 {
        rig.scan(&mut codes);
        let t = f64::from(scan) * dt;
        for (sum, hz) in sums.iter_mut().zip(hz) {
            let kernel = (-Complex::new(sigma, TAU * hz) * t).exp() * dt;
            sum[0] += kernel * contact.value_n(t);
            sum[1] += kernel * rig.truth()[3];
        }
    }
    let outputs = [config.response(Configuration::Ajb, "S3").unwrap().probes()[2]];
    let inputs = [config.impact(Configuration::Ajb, "AZ1").unwrap().probe()];
    let s: Vec<_> = hz.map(|hz| Complex::new(sigma, TAU * hz)).to_vec();
    let exact = exact_frf(&config, Configuration::Ajb, Quantity::Mobility, &s, &outputs, &inputs).unwrap();
    for ((sum, exact), hz) in sums.iter().zip(&exact).zip(hz) {
        let off = (sum[1] / sum[0] / exact[(0, 0)] - 1.0).norm();
        // a Riemann sum of a half sine of 21 scans and of what it excites
        assert!(off < 0.01, "{hz} Hz: {off}");
    }
}

#[test]
fn the_rig_is_written_and_read_back() {
    let rig = elastic();
    assert_eq!(RigConfig::from_toml(&rig.to_toml()).unwrap(), rig);
    let own = bar(vec![slice(own("bar"), 0.0, BAR_M, Some(steel(3)))], Vec::new());
    let mut points = own.clone();
    points.responses.iter_mut().for_each(|point| point.body = self::own("bar"));
    points.impacts.iter_mut().for_each(|point| point.body = self::own("bar"));
    points.spots.ldv_a.body = self::own("bar");
    points.spots.ldv_b.body = self::own("base");
    points.shaker.body = self::own("bar");
    points.open_joint = None;
    assert_eq!(RigConfig::from_toml(&points.to_toml()).unwrap(), points);
}

#[test]
fn an_impossible_beam_is_refused_with_its_field_and_line() {
    for (old, new, field, said) in [
        ("young_pa = 2.1e11", "young_pa = 210.0", "young_pa", "2.1e11 for steel"),
        ("poisson = 0.29", "poisson = 0.5", "poisson", "less than 0.5"),
        ("section_m = [0.018, 0.014]", "section_m = [0.018, 0.0]", "section_m", "greater than zero"),
        ("section_m = [0.018, 0.014]", "section_m = [0.018, 1e-4]", "section_m", "a plate"),
        ("to_m = [0.0, 0.014, 0.0]", "to_m = [0.0, 0.001, 0.0]", "to_m", "times its largest edge"),
        ("damping_s = 1e-7", "damping_s = -1e-7", "damping_s", "must not be negative"),
        ("elements = 1", "elements = 0", "elements", "must be 1 to 20"),
        ("elements = 1", "first_edge = [0.0, 2.0, 0.0]", "first_edge", "along the beam's axis"),
    ] {
        assert!(ELASTIC.contains(old), "{old}");
        let error = RigConfig::from_toml(&ELASTIC.replacen(old, new, 1)).unwrap_err().to_string();
        let field = format!("bodies.specimen_a.beam.{field} (line");
        assert!(error.contains(&field) && error.contains(said), "{new}: {error}");
    }
    let heavy = format!("{ELASTIC}\n[bodies.specimen_b]\nmass_kg = 2.5\n");
    let error = RigConfig::from_toml(&heavy).unwrap_err().to_string();
    assert!(error.contains("bodies.specimen_b.mass_kg"), "{error}");
    // a rig that is made in code and not checked is not taken for a rigid one
    let mut unchecked = elastic();
    unchecked.bodies.arm_b.beam.as_mut().unwrap().section_m = [0.0, 0.01];
    let probes = unchecked.responses[4].probes();
    let s = [Complex::new(0.0, TAU * 100.0)];
    let frf = exact_frf(&unchecked, Configuration::B, Quantity::Mobility, &s, &probes, &probes);
    assert!(frf.unwrap_err().to_string().contains("a beam has no modes"));
}

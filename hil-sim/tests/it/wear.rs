//! A contact that wears: it follows its law, and its energy is counted through every step of it.
#![allow(clippy::unwrap_used)]

use jointrig_hil_sim::rig::{Configuration, Rig, RigConfig, RigError, Stepping};
use std::f64::consts::TAU;

/// A law that acts within a second of gross slip.
const FAST: &str = r#"
[contact]
law = "jenkins"
stiffness_n_per_m = [6e7, 2.6e8, 6e7]
friction_coefficient = 0.4
normal_load_n = 150.0

[contact.wear]
stiffness_change = 0.3
stiffness_energy_j = 0.08
friction_change = -0.4
friction_energy_j = 0.05

[clamp]
rigid = true
"#;

const HZ: f64 = 100.0;

/// What happened during a run.
struct Run {
    /// Δ and T of every scan.
    seen: Vec<(f64, f64)>,
    /// Whether the contact stuck.
    stuck: Vec<bool>,
    /// Energy that its friction had dissipated (J).
    worn_j: Vec<f64>,
    /// Work of the contact's force, ∫ T dΔ (J).
    work_j: f64,
}

/// Shakes with this drive (V) for a number of scans.
fn shake(rig: &mut Rig, drive_v: f64, scans: u32) -> Run {
    let mut codes = [0; 10];
    let mut run = Run { seen: Vec::new(), stuck: Vec::new(), worn_j: Vec::new(), work_j: 0.0 };
    let mut before = rig.joint().unwrap();
    for scan in 0..scans {
        rig.drive(drive_v * (TAU * HZ * f64::from(scan) / f64::from(rig.scan_rate_hz())).sin());
        rig.scan(&mut codes);
        let now = rig.joint().unwrap();
        run.work_j += 0.5 * (now.force_n + before.force_n) * (now.relative_m - before.relative_m);
        run.seen.push((now.relative_m, now.force_n));
        run.stuck.push(now.sliding == 0.0);
        run.worn_j.push(rig.worn_j());
        before = now;
    }
    run
}

#[test]
fn stiffness_and_friction_follow_the_law_of_the_dissipated_energy() {
    let config = RigConfig::from_toml(FAST).unwrap();
    let wear = config.contact.wear.unwrap();
    for stepping in [Stepping::Fastest, Stepping::Exponential] {
        let mut rig = Rig::with_stepping(&config, 1, stepping).unwrap();
        let parts = if stepping == Stepping::Fastest { 8 } else { 1 };
        for _ in 0..parts {
            let before_j = rig.worn_j();
            let run = shake(&mut rig, 3.0, 5_120);
            let worn_j = rig.worn_j();
            // the work is dissipated by friction or the stuck part's dashpot, or stored (0.03 mJ)
            let dissipated_j = worn_j - before_j;
            assert!((run.work_j / dissipated_j - 1.0).abs() < 0.01, "{} {dissipated_j}", run.work_j);
            let [_, friction] = wear.factors(worn_j);
            let limit_n = rig.joint().unwrap().limit_n;
            assert!((limit_n / (0.4 * 150.0 * friction) - 1.0).abs() < 1.1e-3, "{limit_n} at {worn_j} J");
            // the force never exceeds the limit that it had when the run began
            let most = run.seen.iter().map(|(_, force)| force.abs()).fold(0.0, f64::max);
            assert!(most <= 0.4 * 150.0 * wear.factors(before_j)[1] * 1.0025, "{most}");
            // the slope of T over y = Δ + β Δ' while the contact sticks, over the last two cycles
            let last = run.seen.len() - 1_024;
            let (mut found, mut expected) = (0.0, 0.0);
            for from in last..run.seen.len() - 4 {
                let seen = &run.seen[from..from + 4];
                let y = |i: usize| {
                    let velocity = 0.5 * f64::from(rig.scan_rate_hz()) * (seen[i + 1].0 - seen[i - 1].0);
                    seen[i].0 + config.contact.damping_s[2] * velocity
                };
                if run.stuck[from..from + 4].iter().all(|stuck| *stuck) {
                    let (dy, dt) = (y(2) - y(1), seen[2].1 - seen[1].1);
                    found += dt * dy;
                    expected += 6e7 * wear.factors(run.worn_j[from])[0] * dy * dy;
                }
            }
            assert!((found / expected - 1.0).abs() < 5e-3, "{} at {worn_j} J", found / expected);
        }
        if stepping == Stepping::Fastest {
            assert!(rig.worn_j() > 0.2, "most of the law has acted: {}", rig.worn_j());
        }
    }
}

#[test]
fn a_law_without_a_change_changes_nothing() {
    let config = RigConfig::from_toml(FAST).unwrap();
    let [mut plain, mut stepped] = [config.clone(), config];
    plain.contact.wear = None;
    let wear = stepped.contact.wear.as_mut().unwrap();
    // steps of the law every 10 cycles, in which stiffness and friction change by 1e-9 at most
    (wear.stiffness_change, wear.friction_change) = (1e-9, -1e-9);
    (wear.stiffness_energy_j, wear.friction_energy_j) = (1e-8, 1e-8);
    let [mut plain, mut stepped] = [plain, stepped].map(|config| Rig::new(&config, 1).unwrap());
    let [expected, found] = [&mut plain, &mut stepped].map(|rig| shake(rig, 3.0, 10_240).seen);
    let most = expected.iter().map(|(x, _)| x.abs()).fold(0.0, f64::max);
    for ((x, t), (x_found, t_found)) in expected.iter().zip(&found) {
        assert!(
            (x - x_found).abs() < 1e-6 * most && (t - t_found).abs() < 1e-4,
            "{x} {x_found} {t} {t_found}"
        );
    }
}

#[test]
fn wear_lasts_through_stagings_and_can_be_stated_at_the_start() {
    let config = RigConfig::from_toml(FAST).unwrap();
    let mut rig = Rig::new(&config, 1).unwrap();
    let (impact, response) = (config.impacts[0].name.clone(), config.responses[0].name.clone());
    shake(&mut rig, 3.0, 5_120);
    let worn_j = rig.worn_j();
    assert!(worn_j > 0.01);
    rig.stage(Configuration::Ajb, &impact, &response, 0).unwrap();
    assert_eq!(rig.worn_j(), worn_j);
    let mut resumed = Rig::new(&config, 1).unwrap().after_wear(worn_j).unwrap();
    assert_eq!(resumed.worn_j(), worn_j);
    assert_eq!(resumed.joint().unwrap().limit_n, rig.joint().unwrap().limit_n);
    let [one, other] = [&mut rig, &mut resumed].map(|rig| shake(rig, 3.0, 2_048).seen);
    assert_eq!(one, other);
    // without a law the energy changes nothing
    let unworn = RigConfig { contact: config.contact.worn(0.0), ..config.clone() };
    assert_eq!(unworn.contact, config.contact);
    let error = Rig::new(&config, 1).unwrap().after_wear(-1.0).err().unwrap();
    assert!(matches!(error, RigError::Field { .. }), "{error}");
}

#[test]
fn what_cannot_wear_is_refused_by_name() {
    let linear = FAST.replace("jenkins", "linear");
    let error = RigConfig::from_toml(&linear).unwrap_err().to_string();
    assert!(error.contains("contact.wear") && error.contains("can slip"), "{error}");
    for (from, to) in [("-0.4", "-1.0"), ("0.08", "0.0"), ("0.05", "nan")] {
        let wrong = FAST.replace(from, to);
        assert!(RigConfig::from_toml(&wrong).is_err(), "{to}");
    }
    let wearing = include_str!("../../rigs/wearing.toml");
    Rig::new(&RigConfig::from_toml(wearing).unwrap(), 1).unwrap();
}

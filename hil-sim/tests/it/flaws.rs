//! Errors of the instruments: drawn once per campaign, of the specified size, and effective in the
//! readings.

#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use std::f64::consts::TAU;

use jointrig_hil_sim::rig::config::{BodyName, ContactLaw, Errors};
use jointrig_hil_sim::rig::{CHANNELS, Channel, Configuration, Rig, RigConfig};

const RATE: f64 = 51_200.0;
/// Indices of the load cells.
const LOAD_CELLS: [usize; 3] = [6, 7, 8];

/// No errors, no noise, no mishaps.
fn perfect() -> RigConfig {
    let mut config = RigConfig::default();
    let zero = Errors { none: true, ..config.errors.clone() }.acting();
    config.errors = Errors { none: false, ..zero };
    let sensors = &mut config.sensors;
    sensors.force.noise_n = 0.0;
    sensors.vibrometer.floor = 0.0;
    sensors.ldv_a.floor = 0.0;
    sensors.ldv_b.floor = 0.0;
    sensors.load_cells.noise_n = 0.0;
    sensors.excitation.noise_n = 0.0;
    // Small converter steps, so that rounding does not hide a small error.
    sensors.range_v = 1.0;
    let mishaps = &mut config.hammer.mishaps;
    (mishaps.double_hit, mishaps.weak, mishaps.overload) = (0.0, 0.0, 0.0);
    config
}

/// Amplitude of every channel's reading and of its true signal at `hz`, over steady cycles of the
/// shaker.
fn shaken(
    rig: &mut Rig,
    hz: f64,
    volts: f64,
) -> [(num_complex::Complex<f64>, num_complex::Complex<f64>); CHANNELS] {
    let mut found = [(num_complex::Complex::ZERO, num_complex::Complex::ZERO); CHANNELS];
    let steps: Vec<f64> = rig.channels().iter().map(Channel::step).collect();
    let mut codes = [0; CHANNELS];
    let scans = 3 * 51_200;
    for scan in 0..scans {
        let angle = TAU * hz * f64::from(scan) / RATE;
        rig.drive(volts * angle.sin());
        rig.scan(&mut codes);
        if scan >= scans - 51_200 {
            let phasor = num_complex::Complex::cis(-angle);
            for at in 0..CHANNELS {
                found[at].0 += phasor * f64::from(codes[at]) * steps[at];
                found[at].1 += phasor * rig.truth()[at];
            }
        }
    }
    found
}

#[test]
fn they_are_the_same_all_campaign_long_and_others_in_the_next() {
    let mut rig = Rig::new(&RigConfig::default(), 5).unwrap();
    let before = rig.flaws().clone();
    for (configuration, impact, response) in
        [(Configuration::B, "BZ1", "B2"), (Configuration::A, "AX1", "S3"), (Configuration::Ajb, "I_MZ", "S6")]
    {
        rig.stage(configuration, impact, response, 1).unwrap();
        assert_eq!(rig.flaws(), &before);
    }
    assert_eq!(Rig::new(&RigConfig::default(), 5).unwrap().flaws(), &before);
    let other = Rig::new(&RigConfig::default(), 6).unwrap().flaws().clone();
    assert!(other.spots != before.spots && other.gains != before.gains && other.skews_s != before.skews_s);
}

#[test]
fn they_have_the_stated_sizes_and_belong_to_the_stated_channels() {
    let mut config = RigConfig::default();
    config.errors.hammer_gain = 0.02;
    let (mut spots, mut gains, mut hammer, mut skews, mut parts) = (vec![], vec![], vec![], vec![], vec![]);
    for seed in 0..200 {
        let rig = Rig::new(&config, seed).unwrap();
        let flaws = rig.flaws();
        for (seen, nominal) in
            [(&flaws.spots.ldv_a, &config.spots.ldv_a), (&flaws.spots.ldv_b, &config.spots.ldv_b)]
        {
            assert_eq!(seen.body, nominal.body);
            spots.extend((0..3).map(|axis| seen.position_m[axis] - nominal.position_m[axis]));
        }
        hammer.push(flaws.gains[0] - 1.0);
        gains.extend(flaws.gains[1..9].iter().map(|gain| gain - 1.0));
        assert_eq!((flaws.gains[9], flaws.skews_s[0]), (1.0, 0.0));
        skews.extend(&flaws.skews_s[1..]);
        for (reads, parts_of) in flaws.cross_talk.iter().enumerate() {
            assert_eq!(parts_of[reads], 0.0);
            parts.extend(parts_of.iter().enumerate().filter(|(of, _)| *of != reads).map(|(_, part)| *part));
        }
        // No channel precedes its cause.
        let earliest = flaws.skews_s.iter().copied().fold(0.0, f64::min);
        assert!(f64::from(flaws.latency_scans) + earliest * RATE >= 1.0);
    }
    for (name, drawn, sigma) in [
        ("spots", spots, 5e-5),
        ("gains", gains, 0.005),
        ("hammer", hammer, 0.02),
        ("skews", skews, 2e-6),
        ("cross-talk", parts, 0.002),
    ] {
        let n = drawn.len() as f64;
        let mean = drawn.iter().sum::<f64>() / n;
        let rms = (drawn.iter().map(|v| v * v).sum::<f64>() / n).sqrt();
        // Four standard deviations of the mean, and of the root mean square, of n draws.
        assert!(mean.abs() < 4.0 * sigma / n.sqrt(), "{name}: mean {mean}");
        assert!((rms / sigma - 1.0).abs() < 4.0 / (2.0 * n).sqrt(), "{name}: {rms} for {sigma}");
    }
}

#[test]
fn one_switch_turns_all_of_them_off() {
    let mut config = RigConfig::default();
    config.errors.normal_load_variation = 0.3;
    config.errors.hammer_gain = 0.1;
    config.errors.none = true;
    let mut rig = Rig::new(&config, 9).unwrap();
    let flaws = rig.flaws();
    assert_eq!(flaws.spots, config.spots);
    assert_eq!((flaws.gains, flaws.skews_s), ([1.0; CHANNELS], [0.0; CHANNELS]));
    assert_eq!((flaws.latency_scans, flaws.cross_talk), (0, [[0.0; 3]; 3]));
    assert_eq!(config.errors.normal_load_slope_per_m(), 0.0);
    for (impact, response) in [("AZ1", "A1"), ("I_MZ", "S4")] {
        rig.stage(Configuration::Ajb, impact, response, 0).unwrap();
        let hit = config.impact(Configuration::Ajb, impact).unwrap().probe();
        assert_eq!(rig.aim().impact, hit);
        assert_eq!(rig.aim().response, config.response(Configuration::Ajb, response).unwrap().probes());
    }
    // One line of a rig file has the same effect.
    let read = RigConfig::from_toml("[errors]\nnone = true\n").unwrap();
    assert_eq!(
        read.errors.acting(),
        Errors { hammer_gain: 0.0, normal_load_variation: 0.0, ..config.errors.acting() }
    );
}

#[test]
fn gains_and_cross_talk_are_in_what_is_read() {
    let mut config = perfect();
    config.errors.gain = 0.03;
    config.errors.load_cell_cross_talk = 0.02;
    config.sensors.range_v = 10.0;
    let mut rig = Rig::new(&config, 2).unwrap();
    let flaws = rig.flaws().clone();
    rig.stage(Configuration::Ajb, "AX1", "A1", 0).unwrap();
    rig.fire(3.5e-3);
    let steps: Vec<f64> = rig.channels().iter().map(Channel::step).collect();
    let mut codes = [0; CHANNELS];
    // Least-squares slopes of the reading on the expected reading, and on the true signal.
    let (mut on_expected, mut on_truth) = ([[0.0; 2]; CHANNELS], [[0.0; 2]; CHANNELS]);
    for _ in 0..5_000 {
        rig.scan(&mut codes);
        let truth = *rig.truth();
        for at in 1..9 {
            let others = LOAD_CELLS.iter().position(|cell| *cell == at).map_or(0.0, |reads| {
                (0..3).map(|of| flaws.cross_talk[reads][of] * truth[LOAD_CELLS[of]]).sum()
            });
            let (read, expected) = (f64::from(codes[at]) * steps[at], flaws.gains[at] * (truth[at] + others));
            for (sums, of) in [(&mut on_expected[at], expected), (&mut on_truth[at], truth[at])] {
                sums[0] += read * of;
                sums[1] += of * of;
            }
        }
    }
    for at in 1..9 {
        let [expected, truth] = [on_expected[at], on_truth[at]].map(|[read, square]| read / square);
        // Thousands of roundings of half a step, with signals of tens of steps and more.
        assert!((expected - 1.0).abs() < 1e-3, "{at}: {expected}");
        assert!((truth - 1.0).abs() > 2e-3, "{at}: {truth}, nothing to see");
    }
}

#[test]
fn skew_is_a_delay_beyond_the_declared_one_early_or_late() {
    let mut config = perfect();
    config.errors.skew_s = 30e-6;
    config.sensors.ldv_a.delay_s = 40e-6;
    let mut rig = Rig::new(&config, 3).unwrap();
    let flaws = rig.flaws().clone();
    assert!(flaws.skews_s.iter().any(|skew| *skew < -1e-5) && flaws.skews_s.iter().any(|skew| *skew > 1e-5));
    // The declared delay is unchanged.
    assert_eq!(rig.channels()[4].delay_s, 40e-6);
    let hz = 400.0;
    let found = shaken(&mut rig, hz, 0.5);
    let mut seen = 0;
    for (at, (read, truth)) in found.iter().enumerate().skip(1) {
        // Only channels with enough signal: a shaker along z moves little along x.
        if truth.norm() / 25_600.0 < 200.0 * rig.channels()[at].step() {
            continue;
        }
        seen += 1;
        let late_s = -(read / truth).arg() / (TAU * hz);
        let declared_s = rig.channels()[at].delay_s + f64::from(flaws.latency_scans) / RATE;
        let skew_s = late_s - declared_s;
        assert!((skew_s - flaws.skews_s[at]).abs() < 1e-7, "{at}: {skew_s} for {}", flaws.skews_s[at]);
    }
    assert!(seen >= 7, "{seen}");
}

#[test]
fn spots_are_looked_at_where_they_truly_are() {
    let mut config = perfect();
    config.errors.spot_m = 1e-3;
    let mut rig = Rig::new(&config, 8).unwrap();
    let truth = rig.flaws().spots.clone();
    assert!(truth.ldv_a.position_m != config.spots.ldv_a.position_m);
    rig.stage(Configuration::Ajb, "AZ1", "S1", 0).unwrap();
    rig.fire(3.5e-3);
    let mut codes = [0; CHANNELS];
    let (mut off, mut nominal, mut largest) = (0.0_f64, 0.0_f64, 0.0_f64);
    for _ in 0..3_000 {
        rig.scan(&mut codes);
        let speed = |spot| rig.motion(&jointrig_hil_sim::rig::Probe::along_z(spot)).unwrap().1;
        for (at, spots) in
            [(4, [&truth.ldv_a, &config.spots.ldv_a]), (5, [&truth.ldv_b, &config.spots.ldv_b])]
        {
            largest = largest.max(rig.truth()[at].abs());
            off = off.max((rig.truth()[at] - speed(spots[0])).abs());
            nominal = nominal.max((rig.truth()[at] - speed(spots[1])).abs());
        }
    }
    assert!(off < 1e-9 * largest && nominal > 1e-3 * largest, "{off} {nominal} {largest}");
}

#[test]
fn points_on_a_specimen_err_by_their_own_error_and_never_by_aim() {
    let config = RigConfig::default();
    let mut drawn = Vec::new();
    for seed in 0..100 {
        let mut rig = Rig::new(&config, seed).unwrap();
        for response in ["S1", "S2", "S3", "S4", "S5", "S6"] {
            let nominal = config.response(Configuration::Ajb, response).unwrap().position_m;
            rig.stage(Configuration::Ajb, "AZ1", response, 0).unwrap();
            let seen = rig.aim().response[2];
            assert_eq!(seen.body, BodyName::SpecimenA);
            rig.stage(Configuration::A, "AX2", response, 3).unwrap();
            assert_eq!(rig.aim().response[2], seen, "the same in every cell");
            drawn.extend((0..3).map(|axis| seen.position_m[axis] - nominal[axis]));
        }
    }
    let n = drawn.len() as f64;
    let rms = (drawn.iter().map(|v| v * v).sum::<f64>() / n).sqrt();
    assert!((rms / 3e-4 - 1.0).abs() < 4.0 / (2.0 * n).sqrt(), "{rms}");
    // A configuration without the specimen has none of its points.
    let mut rig = Rig::new(&config, 1).unwrap();
    let error = rig.stage(Configuration::B, "BZ1", "S1", 0).unwrap_err().to_string();
    assert!(error.contains("\"S1\"") && error.contains("B1, B2, B3, B4"), "{error}");
}

/// Shakes into gross slip: force and displacement in every scan in which the contact slips.
fn slipping(config: &RigConfig) -> Vec<(f64, f64)> {
    let mut rig = Rig::new(config, 1).unwrap();
    let mut codes = [0; CHANNELS];
    let mut seen = Vec::new();
    for scan in 0..2 * 51_200 {
        let angle = TAU * 30.0 * f64::from(scan) / RATE;
        rig.drive(6.0 * (f64::from(scan) / 10_000.0).min(1.0) * angle.sin());
        rig.scan(&mut codes);
        let joint = rig.joint().unwrap();
        assert!(joint.force_n.abs() <= joint.limit_n * (1.0 + 1e-9), "{joint:?}");
        if joint.sliding == 1.0 {
            seen.push((joint.force_n, joint.relative_m));
        }
    }
    seen
}

#[test]
fn the_normal_load_varies_with_the_displacement() {
    let mut config = RigConfig::from_toml(include_str!("../../rigs/jenkins.toml")).unwrap();
    let seen = slipping(&config);
    assert!(seen.len() > 1_000 && seen.iter().all(|(force_n, _)| (force_n.abs() - 180.0).abs() < 1e-6));
    config.errors.normal_load_variation = 0.3;
    config.errors.normal_load_reference_m = 20e-6;
    let seen = slipping(&config);
    for (force_n, relative_m) in &seen {
        // The law uses Δ + β Δ' for x: at 0.03 m/s that differs by 0.45 µm, 0.7 % of N.
        let expected = 180.0 * (1.0 + 0.3 * relative_m / 20e-6);
        assert!((force_n.abs() - expected).abs() < 0.007 * 180.0, "{force_n} at {relative_m} for {expected}");
    }
    let (low, high) = seen.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), (force_n, _)| {
        (low.min(force_n.abs()), high.max(force_n.abs()))
    });
    assert!(seen.len() > 500 && low < 170.0 && high > 190.0, "{} scans, {low} to {high} N", seen.len());
    // Too steep: a slipping element could never stick again.
    config.errors.normal_load_reference_m = 0.2e-6;
    let error = config.check().unwrap_err().to_string();
    assert!(error.contains("errors.normal_load_variation"), "{error}");
    config.contact.law = ContactLaw::Linear;
    config.check().unwrap();
}

#[test]
fn half_the_step_changes_the_force_of_a_varying_load_little() {
    let mut config = RigConfig::from_toml(include_str!("../../rigs/iwan.toml")).unwrap();
    config.errors.normal_load_variation = 0.3;
    config.errors.normal_load_reference_m = 5e-6;
    let taken = |config: &RigConfig| {
        let mut rig = Rig::new(config, 1).unwrap();
        let mut codes = [0; CHANNELS];
        for scan in 0..51_200 {
            rig.drive(4.6 * (TAU * 30.0 * f64::from(scan) / RATE).sin());
            rig.scan(&mut codes);
        }
        rig.joint().unwrap().friction_j
    };
    let whole = taken(&config);
    config.contact.slip_step_s /= 2.0;
    let half = taken(&config);
    assert!(whole > 0.0 && (whole / half - 1.0).abs() < 1e-4, "{whole} {half}");
}

/// Hits B alone; the true velocities of the 3-D vibrometer along z and of both spots' vibrometers.
fn at_the_mark(rig: &mut Rig, response: &str) -> Vec<[f64; 3]> {
    rig.stage(Configuration::B, "BZ1", response, 0).unwrap();
    rig.fire(3.5e-3);
    let mut codes = [0; CHANNELS];
    (0..2000)
        .map(|_| {
            rig.scan(&mut codes);
            [rig.truth()[3], rig.truth()[4], rig.truth()[5]]
        })
        .collect()
}

#[test]
fn at_the_mark_on_b_alone_all_lasers_see_one_motion() {
    let mut rig = Rig::new(&perfect(), 8).unwrap();
    let seen = at_the_mark(&mut rig, "BL");
    assert!(seen.iter().any(|[z, ..]| z.abs() > 1e-5));
    assert!(seen.iter().all(|[z, a, b]| z == a && z == b));
    // at other points of B alone they are on their spots, and specimen A is absent
    let seen = at_the_mark(&mut rig, "B2");
    assert!(seen.iter().all(|[_, a, _]| *a == 0.0) && seen.iter().any(|[z, _, b]| z != b));
    // in the assembly too
    rig.stage(Configuration::Ajb, "AZ1", "BL", 0).unwrap();
    rig.fire(3.5e-3);
    let mut codes = [0; CHANNELS];
    let apart = (0..2000).any(|_| {
        rig.scan(&mut codes);
        rig.truth()[4] != rig.truth()[3]
    });
    assert!(apart);
    // each laser is aimed once, within `aim_m` of the mark
    let mut config = perfect();
    config.errors.aim_m = 1e-3;
    let mut rig = Rig::new(&config, 8).unwrap();
    let seen = at_the_mark(&mut rig, "BL");
    let off = |of: usize| seen.iter().map(|v| (v[of] - v[0]).abs()).fold(0.0, f64::max);
    let most = seen.iter().map(|v| v[0].abs()).fold(0.0, f64::max);
    assert!(off(1) > 0.0 && off(2) > 0.0 && off(1) < 0.2 * most && off(2) < 0.2 * most);
}

#[test]
fn a_listed_response_with_the_marks_name_says_where_it_is() {
    let listed = "responses = [{ name = \"BL\", body = \"arm_b\", position_m = [0.01, -0.03, 0.03] }]";
    let config = RigConfig::from_toml(listed).unwrap();
    let own = config.response(Configuration::B, "BL").unwrap();
    assert_eq!(own.position_m, [0.01, -0.03, 0.03]);
    assert_eq!(config.response_points().count(), 1);
    assert_eq!(RigConfig::from_toml("").unwrap().response_points().filter(|p| p.name == "BL").count(), 1);
}

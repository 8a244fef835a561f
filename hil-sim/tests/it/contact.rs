//! The contact in the structure: stuck, sliding, and in between.

#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use std::f64::consts::TAU;

use jointrig_hil_sim::rig::config::ContactLaw;
use jointrig_hil_sim::rig::{CHANNELS, Configuration, Probe, Rig, RigConfig, Stepping};
use proptest::prelude::*;

const JENKINS: &str = include_str!("../../rigs/jenkins.toml");
const IWAN: &str = include_str!("../../rigs/iwan.toml");
const RATE: f64 = 51_200.0;

fn rig_of(text: &str) -> RigConfig {
    RigConfig::from_toml(text).unwrap()
}

/// The default rig, whose clamp is flexible, with this law.
fn flexible(law: ContactLaw) -> RigConfig {
    let mut config = RigConfig::default();
    config.contact.law = law;
    config
}

/// Drives `cycles` cycles of a sine whose amplitude rises in the first tenth of them.
fn shake(rig: &mut Rig, hz: f64, volts: f64, cycles: u32, mut seen: impl FnMut(&Rig, f64)) {
    let scans = (f64::from(cycles) * RATE / hz).round();
    let mut codes = [0; CHANNELS];
    for scan in 0..scans as u32 {
        let part = f64::from(scan) / scans;
        rig.drive(volts * (10.0 * part).min(1.0) * (TAU * hz * f64::from(scan) / RATE).sin());
        rig.scan(&mut codes);
        seen(rig, part);
    }
}

/// Amplitude (m) of the relative displacement, and energy dissipated by friction per cycle (J),
/// over the last half of a drive.
fn steady(config: &RigConfig, stepping: Stepping, hz: f64, volts: f64, cycles: u32) -> (f64, f64) {
    let mut rig = Rig::with_stepping(config, 1, stepping).unwrap();
    let (mut low, mut high, mut from) = (f64::INFINITY, f64::NEG_INFINITY, None);
    shake(&mut rig, hz, volts, cycles, |rig, part| {
        if part >= 0.5 {
            let joint = rig.joint().unwrap();
            from.get_or_insert(joint.friction_j);
            (low, high) = (low.min(joint.relative_m), high.max(joint.relative_m));
        }
    });
    let taken = rig.joint().unwrap().friction_j - from.unwrap();
    (0.5 * (high - low), taken / (0.5 * f64::from(cycles)))
}

#[test]
fn what_never_slips_is_the_linear_rig_bit_for_bit() {
    for law in [ContactLaw::Jenkins, ContactLaw::Iwan] {
        let mut linear = Rig::new(&RigConfig::default(), 5).unwrap();
        let mut rig = Rig::new(&flexible(law), 5).unwrap();
        let (mut codes, mut others) = ([0; CHANNELS], [0; CHANNELS]);
        for rig in [&mut linear, &mut rig] {
            rig.fire(2.6e-3);
        }
        for scan in 0..51_200 {
            if scan == 30_000 {
                linear.drive(0.01);
                rig.drive(0.01);
            }
            linear.scan(&mut codes);
            rig.scan(&mut others);
            assert_eq!((codes, linear.truth()), (others, rig.truth()), "{law:?} at {scan}");
        }
        let (stuck, joint) = (linear.joint().unwrap(), rig.joint().unwrap());
        assert_eq!((joint.slid_m, joint.friction_j, joint.sliding), (0.0, 0.0, 0.0));
        assert_eq!(joint.relative_m, stuck.relative_m);
        assert!((joint.force_n / stuck.force_n - 1.0).abs() < 1e-9, "{joint:?} {stuck:?}");
    }
}

#[test]
fn half_the_step_changes_energy_and_amplitude_by_less_than_1e4() {
    // Just above the limit, where a little more force means much more motion, and far above it.
    let cases = vec![
        ("jenkins", rig_of(JENKINS), 30.0, 4.7),
        ("jenkins", rig_of(JENKINS), 100.0, 9.0),
        ("iwan", rig_of(IWAN), 30.0, 4.7),
        ("iwan", rig_of(IWAN), 200.0, 3.0),
        ("jenkins, flexible clamp", flexible(ContactLaw::Jenkins), 60.0, 6.0),
        ("jenkins, flexible clamp", flexible(ContactLaw::Jenkins), 190.0, 2.0),
        ("iwan, flexible clamp", flexible(ContactLaw::Iwan), 60.0, 9.0),
    ];
    for (name, config, hz, volts) in cases {
        let mut halved = config.clone();
        halved.contact.slip_step_s /= 2.0;
        let whole = steady(&config, Stepping::Fastest, hz, volts, 100);
        let half = steady(&halved, Stepping::Fastest, hz, volts, 100);
        let change = ((whole.0 / half.0 - 1.0).abs(), (whole.1 / half.1 - 1.0).abs());
        let (um, mj) = (half.0 * 1e6, half.1 * 1e3);
        println!(
            "{name}, {hz} Hz, {volts} V: {um:.2} um, {mj:.3} mJ; changes by {:.1e}, {:.1e}",
            change.0, change.1
        );
        assert!(half.1 > 0.0, "{name} slips");
        assert!(change.0 < 1e-4 && change.1 < 1e-4, "{name} at {hz} Hz: {change:?}");
    }
}

#[test]
fn both_steppers_agree_in_slip() {
    for config in [rig_of(JENKINS), flexible(ContactLaw::Iwan)] {
        let fast = steady(&config, Stepping::Fastest, 40.0, 8.0, 6);
        let slow = steady(&config, Stepping::Exponential, 40.0, 8.0, 6);
        let off = [fast.0 / slow.0 - 1.0, fast.1 / slow.1 - 1.0];
        assert!(off.iter().all(|off| off.abs() < 1e-9), "{fast:?} {slow:?}");
    }
}

/// The frequency (Hz) among `lines` at which a sine of `volts` moves the moving mass most.
fn peak_hz(config: &RigConfig, volts: f64, lines: impl Iterator<Item = f64>) -> f64 {
    let shaker = &config.shaker;
    let pushed = Probe { body: shaker.body, position_m: shaker.position_m, direction: [0.0, 0.0, 1.0] };
    let seen = lines.map(|hz| {
        let mut rig = Rig::new(config, 1).unwrap();
        let (mut most, mut scan) = (0.0_f64, 0);
        shake(&mut rig, hz, volts, 60, |rig, part| {
            scan += 1;
            if part > 0.8 && scan % 16 == 0 {
                most = most.max(rig.motion(&pushed).unwrap().0.abs());
            }
        });
        (hz, most)
    });
    seen.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap().0
}

#[test]
fn gross_slip_takes_the_first_mode_from_208_towards_40_hz() {
    let config = flexible(ContactLaw::Jenkins);
    let mut before = f64::INFINITY;
    for (volts, from, to, step) in
        [(0.02, 200, 216, 2), (2.0, 100, 210, 5), (4.0, 30, 210, 10), (6.0, 30, 130, 5), (10.0, 32, 50, 1)]
    {
        let peak = peak_hz(&config, volts, (from..=to).step_by(step).map(f64::from));
        println!("{volts} V: {peak} Hz");
        assert!(peak <= before, "{volts} V: {peak} Hz");
        before = peak;
        match volts {
            0.02 => assert_eq!(peak, 208.0),
            10.0 => assert_eq!(peak, 40.0),
            _ => {}
        }
    }
}

#[test]
fn without_load_the_mode_rings_at_40_hz_and_nothing_is_carried() {
    let mut rig = Rig::new(&rig_of(JENKINS), 1).unwrap();
    rig.set_normal_load(0.0).unwrap();
    rig.stage(Configuration::Ajb, "I_MZ", "A1", 0).unwrap();
    rig.fire(3.5e-3);
    let mut codes = [0; CHANNELS];
    let (mut crossings, mut last) = (Vec::new(), 0.0);
    for scan in 0..51_200 {
        rig.scan(&mut codes);
        let joint = rig.joint().unwrap();
        assert_eq!(joint.limit_n, 0.0);
        assert!(joint.force_n.abs() < 1e-6, "{joint:?}");
        if scan > 10_000 && last < 0.0 && joint.relative_m >= 0.0 {
            crossings.push(f64::from(scan) / RATE);
        }
        last = joint.relative_m;
    }
    let cycles = crossings.len() as f64 - 1.0;
    let hz = cycles / (crossings[crossings.len() - 1] - crossings[0]);
    assert!((hz - 40.0).abs() < 0.5, "{hz}");
}

#[test]
fn the_load_can_be_changed_while_it_slips() {
    let mut rig = Rig::new(&rig_of(JENKINS), 1).unwrap();
    let (mut most, mut slid) = ([0.0_f64; 4], [0.0; 4]);
    let loads = [300.0, 200.0, 300.0, 150.0];
    let mut codes = [0; CHANNELS];
    for scan in 0..4 * 51_200_u32 {
        let quarter = (scan / 51_200) as usize;
        if scan % 51_200 == 0 {
            rig.set_normal_load(loads[quarter]).unwrap();
        }
        // 160 N.
        rig.drive(4.0 * (TAU * 30.0 * f64::from(scan) / RATE).sin());
        rig.scan(&mut codes);
        if scan % 51_200 > 40_000 {
            most[quarter] = most[quarter].max(rig.joint().unwrap().force_n.abs());
        }
        slid[quarter] = rig.joint().unwrap().slid_m;
    }
    // They are below the limit of 180 N.
    assert_eq!(slid[0], 0.0);
    assert!((most[1] - 120.0).abs() < 1e-6 && (most[3] - 90.0).abs() < 1e-6, "{most:?}");
    assert!(slid[1] > 1e-3 && slid[3] > slid[2] && most[2] > 120.0 && most[2] <= 180.0, "{most:?} {slid:?}");
    // The load is kept when the rig is staged again, and invalid loads are refused.
    rig.stage(Configuration::Ajb, "AZ1", "A1", 0).unwrap();
    assert!((rig.joint().unwrap().limit_n - 90.0).abs() < 1e-9);
    for load in [-1.0, f64::NAN, f64::INFINITY] {
        let error = rig.set_normal_load(load).unwrap_err().to_string();
        assert!(error.contains("contact.normal_load_n"), "{error}");
    }
    assert!((rig.joint().unwrap().limit_n - 90.0).abs() < 1e-9);
    rig.stage(Configuration::B, "BZ1", "B1", 0).unwrap();
    assert_eq!(rig.joint(), None);
}

/// Without any dashpot: the input energy is stored or dissipated by friction.
fn undamped(mut config: RigConfig) -> RigConfig {
    let without = |bushing: &mut jointrig_hil_sim::rig::config::Bushing| bushing.damping_s = [0.0; 6];
    config.leaf_springs.iter_mut().chain(&mut config.load_cells).for_each(without);
    [
        &mut config.knife_edge,
        &mut config.wire.bushing,
        &mut config.push_rod_a.bushing,
        &mut config.lower_push_rod,
    ]
    .into_iter()
    .for_each(without);
    [&mut config.clamp.loaded, &mut config.clamp.free].into_iter().for_each(without);
    config.contact.damping_s = [0.0; 6];
    config
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_the_shaker_puts_in_is_stored_or_rubbed_away(
        iwan in any::<bool>(), rigid in any::<bool>(), hz in 25.0..230.0f64, volts in 0.5..10.0f64, load in 0.0..400.0f64
    ) {
        let mut config = undamped(flexible(if iwan { ContactLaw::Iwan } else { ContactLaw::Jenkins }));
        config.clamp.rigid = rigid;
        config.contact.normal_load_n = load;
        let mut rig = Rig::new(&config, 1).unwrap();
        let shaker = config.shaker.clone();
        let pushed = Probe { body: shaker.body, position_m: shaker.position_m, direction: [0.0, 0.0, 1.0] };
        let (mut put_in, mut at, mut most) = (0.0, 0.0, 0.0_f64);
        let mut codes = [0; CHANNELS];
        for scan in 0..10_240 {
            let drive = volts * (TAU * hz * f64::from(scan) / RATE).sin();
            rig.drive(drive);
            rig.scan(&mut codes);
            // The force is held over the scan, so its work is exact.
            let now = rig.motion(&pushed).unwrap().0;
            put_in += drive * shaker.gain_n_per_v * (now - at);
            at = now;
            most = most.max(put_in);
            let joint = rig.joint().unwrap();
            prop_assert!(joint.force_n.abs() <= joint.limit_n * (1.0 + 1e-12) + 1e-6);
        }
        let there = rig.energy_j() + rig.joint().unwrap().friction_j;
        prop_assert!((there - put_in).abs() < 1e-4 * most, "{there} of {put_in}");
    }

    #[test]
    fn sliding_energy_only_decays(
        iwan in any::<bool>(), rigid in any::<bool>(), volts in 2.0..10.0f64, load in 0.0..400.0f64, beta in 0.0..6e-5f64
    ) {
        let mut config = flexible(if iwan { ContactLaw::Iwan } else { ContactLaw::Jenkins });
        config.clamp.rigid = rigid;
        config.contact.normal_load_n = load;
        config.contact.damping_s[2] = beta;
        let mut rig = Rig::new(&config, 1).unwrap();
        shake(&mut rig, 60.0, volts, 8, |_, _| ());
        rig.drive(0.0);
        let mut codes = [0; CHANNELS];
        rig.scan(&mut codes);
        let start = rig.energy_j();
        let mut before = start;
        for _ in 0..10_240 {
            rig.scan(&mut codes);
            let now = rig.energy_j();
            prop_assert!(now <= before + 1e-7 * start, "{before} -> {now}");
            before = now;
        }
    }
}

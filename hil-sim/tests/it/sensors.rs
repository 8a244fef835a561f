//! From true signals to codes: scale, sign, rounding, saturation, noise, delay.

#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use jointrig_hil_sim::rig::{CHANNELS, Configuration, Measured, Rig, RigConfig};

fn silent() -> RigConfig {
    let mut config = RigConfig::default();
    let sensors = &mut config.sensors;
    sensors.force.noise_n = 0.0;
    sensors.vibrometer.floor = 0.0;
    sensors.ldv_a.floor = 0.0;
    sensors.ldv_b.floor = 0.0;
    sensors.load_cells.noise_n = 0.0;
    sensors.excitation.noise_n = 0.0;
    // Here codes are compared with the true signals: the instrument errors are tested in flaws.rs.
    config.errors.gain = 0.0;
    config.errors.skew_s = 0.0;
    config.errors.load_cell_cross_talk = 0.0;
    config.hammer.mishaps.double_hit = 0.0;
    config.hammer.mishaps.weak = 0.0;
    config.hammer.mishaps.overload = 0.0;
    config
}

#[test]
fn a_rig_may_move_to_another_thread() {
    fn send<T: Send>(_: &T) {}
    send(&Rig::new(&RigConfig::default(), 1).unwrap());
}

#[test]
fn channels_are_what_the_wiring_says() {
    let rig = Rig::new(&RigConfig::default(), 1).unwrap();
    let names: Vec<&str> = rig.channels().iter().map(|channel| channel.name.as_str()).collect();
    assert_eq!(
        names,
        ["force", "vib_x", "vib_y", "vib_z", "ldv_a", "ldv_b", "lc_1", "lc_2", "lc_3", "excitation"]
    );
    let [force, vib, spot, cell] = [0, 1, 4, 6].map(|at| &rig.channels()[at]);
    assert!((1.0 / force.units_per_volt - 22.4e-3).abs() < 1e-15 && force.quantity == Measured::Force);
    assert!(vib.units_per_volt == 5e-3 && vib.unit == "m/s" && vib.axis == Some(0));
    assert!(spot.units_per_volt == 1e-3 && spot.axis == Some(2));
    assert!(cell.units_per_volt * cell.range_v == 200.0 && cell.unit == "N");
}

#[test]
fn without_noise_a_code_is_the_rounded_signal() {
    let mut rig = Rig::new(&silent(), 1).unwrap();
    rig.stage(Configuration::Ajb, "AZ3", "A3", 0).unwrap();
    let mut codes = [7; CHANNELS];
    for _ in 0..50 {
        rig.scan(&mut codes);
        assert_eq!(codes, [0; CHANNELS]);
    }
    rig.fire(3.5e-3);
    let mut seen = 0;
    for _ in 0..2000 {
        rig.scan(&mut codes);
        for (channel, (code, truth)) in rig.channels().iter().zip(codes.iter().zip(rig.truth())) {
            let exact = truth / channel.units_per_volt / 10.0 * 32768.0;
            assert_eq!(f64::from(*code), exact.round().clamp(-32768.0, 32767.0), "{}", channel.name);
            seen += i32::from(*code != 0);
        }
    }
    assert!(seen > 5000);
    // A shorter slice receives the first channels; the end of a longer one is unchanged.
    let mut tail = [5; CHANNELS + 2];
    rig.scan(&mut tail);
    assert_eq!(tail[CHANNELS..], [5, 5]);
    rig.scan(&mut tail[..3]);
}

#[test]
fn signals_have_the_sizes_of_the_real_rig() {
    let mut config = silent();
    config.errors.none = true;
    let mut rig = Rig::new(&config, 1).unwrap();
    rig.stage(Configuration::Ajb, "AZ3", "A3", 0).unwrap();
    rig.fire(3.5e-3);
    let mut codes = [0; CHANNELS];
    let mut largest = [0.0_f64; CHANNELS];
    let mut total_n = 0.0_f64;
    for _ in 0..10_000 {
        rig.scan(&mut codes);
        for (largest, value) in largest.iter_mut().zip(rig.truth()) {
            *largest = largest.max(value.abs());
        }
        total_n = total_n.max(rig.truth()[6..9].iter().sum::<f64>().abs());
    }
    println!("{largest:?} {total_n}");
    // Published for a 50 N hit: T of ±16–19 N over the hits on A; single-point spots below 4.2
    // mm/s, the scanner's points below 28 mm/s. The limits are wide because those figures are
    // approximate.
    assert!((12.0..24.0).contains(&total_n), "{total_n}");
    assert!(largest[4] > 2e-4 && largest[4] < 4.2e-3 && largest[5] < 4.2e-3, "{largest:?}");
    assert!(largest[3] > 1e-3 && largest[3] < 28e-3, "{largest:?}");
}

#[test]
fn noise_has_the_stated_size_and_an_absent_part_reads_only_noise() {
    let mut config = silent();
    config.sensors = RigConfig::default().sensors;
    let mut rig = Rig::new(&config, 3).unwrap();
    rig.stage(Configuration::A, "AZ3", "A3", 0).unwrap();
    rig.fire(3.5e-3);
    let scans = 40_000;
    let mut sums = [0.0; CHANNELS];
    let mut codes = [0; CHANNELS];
    for _ in 0..scans {
        rig.scan(&mut codes);
        for (sum, code) in sums.iter_mut().zip(codes) {
            *sum += f64::from(code).powi(2);
        }
    }
    let white = 25_600.0_f64.sqrt();
    for (at, sigma) in [(5, 5e-8 * white), (6, 0.01), (7, 0.01), (8, 0.01), (9, 0.01)] {
        let channel = &rig.channels()[at];
        let step = channel.units_per_volt * 10.0 / 32768.0;
        let rms = (sums[at] / f64::from(scans)).sqrt() * step;
        // Rounding adds step²/12 (accurate to a per cent even for the force channels, whose step is
        // near σ); 40000 draws give 0.35 %.
        let expected = (sigma * sigma + step * step / 12.0).sqrt();
        assert!((rms / expected - 1.0).abs() < 0.03, "{}: {rms} for {expected}", channel.name);
    }
}

#[test]
fn polarity_turns_a_channel_over() {
    let mut turned = silent();
    turned.sensors.vibrometer.polarity = [1, 1, -1];
    turned.sensors.force.polarity = -1;
    let (mut plain, mut turned) = (Rig::new(&silent(), 1).unwrap(), Rig::new(&turned, 1).unwrap());
    let (mut a, mut b) = ([0; CHANNELS], [0; CHANNELS]);
    plain.fire(3.5e-3);
    turned.fire(3.5e-3);
    for _ in 0..1000 {
        plain.scan(&mut a);
        turned.scan(&mut b);
        assert_eq!((a[0], a[3], a[4]), (-b[0], -b[3], b[4]));
    }
}

#[test]
fn a_delay_is_a_delay() {
    let mut late = silent();
    late.sensors.ldv_a.delay_s = 3.0 / 51_200.0;
    late.sensors.ldv_b.delay_s = 2.5 / 51_200.0;
    let (mut plain, mut late) = (Rig::new(&silent(), 1).unwrap(), Rig::new(&late, 1).unwrap());
    plain.fire(3.5e-3);
    late.fire(3.5e-3);
    let (mut a, mut b) = ([0; CHANNELS], [0; CHANNELS]);
    let (mut whole, mut between) = (Vec::new(), Vec::new());
    for scan in 0..3000 {
        plain.scan(&mut a);
        late.scan(&mut b);
        whole.push(a[4]);
        between.push(f64::from(a[5]));
        if scan >= 10 {
            assert_eq!(b[4], whole[scan - 3]);
            let n = scan - 2;
            let cubic = (9.0 * (between[n] + between[n - 1]) - between[n + 1] - between[n - 2]) / 16.0;
            // Rounding of four codes and of one.
            assert!((f64::from(b[5]) - cubic).abs() <= 1.2, "{} for {cubic}", b[5]);
        }
    }
}

#[test]
fn a_speckled_point_is_noisier_and_drops_out() {
    let mut config = RigConfig::default();
    // often enough that one second certainly contains some
    config.sensors.vibrometer.speckle.dropouts_per_s = 20.0;
    let mut rig = Rig::new(&config, 1).unwrap();
    let mut rms = |response: &str| {
        rig.stage(Configuration::A, "AZ3", response, 0).unwrap();
        let mut codes = [0; CHANNELS];
        let mut values: Vec<f64> = (0..51_200)
            .map(|_| {
                rig.scan(&mut codes);
                f64::from(codes[1]).abs()
            })
            .collect();
        values.sort_by(f64::total_cmp);
        (values[25_600], values[51_199])
    };
    let (quiet, quiet_most) = rms("A3");
    let (speckled, speckled_most) = rms("A4");
    // Median: twenty times the floor; in a dropout ten times that.
    assert!((speckled / quiet - 20.0).abs() < 5.0, "{speckled} {quiet}");
    assert!(speckled_most > 5.0 * 20.0 * quiet_most / 2.0, "{speckled_most} {quiet_most}");
}

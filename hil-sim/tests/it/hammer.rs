//! The hammer: calibration, monotonicity, the effect of a pulse that is too short or too long, and
//! the frequency of mishaps.

#![allow(clippy::unwrap_used, reason = "a test that unwraps what is not there should fail")]

use jointrig_hil_sim::rig::{CHANNELS, Configuration, Hit, Mishap, Rig, RigConfig};

fn strict() -> RigConfig {
    let mut config = RigConfig::default();
    config.hammer.speed_scatter = 0.0;
    config.hammer.width_scatter = 0.0;
    config.hammer.mishaps.double_hit = 0.0;
    config.hammer.mishaps.weak = 0.0;
    config.hammer.mishaps.overload = 0.0;
    config
}

fn fire(rig: &mut Rig, pulse_s: f64, attempt: u32) -> Hit {
    rig.stage(Configuration::Ajb, "AZ3", "A3", attempt).unwrap();
    rig.fire(pulse_s);
    rig.last_hit().unwrap().clone()
}

#[test]
fn the_nominal_pulse_gives_the_nominal_hit() {
    let mut rig = Rig::new(&strict(), 1).unwrap();
    let hit = fire(&mut rig, 3.5e-3, 0);
    assert_eq!(hit.contacts.len(), 1);
    // The coil's force is specified to all its digits.
    assert!((hit.peak_n() - 50.0).abs() < 1e-6, "{}", hit.peak_n());
    assert!((hit.contacts[0].width_s() - 4.1e-4).abs() < 1e-9);
    // It flies on after the current ends, for some milliseconds.
    let flight_s = hit.contacts[0].start_s - 3.5e-3;
    assert!(flight_s > 5e-4 && flight_s < 1e-2, "{flight_s}");
    // −6 dB at 2 kHz: |cos(π f w) / (1 − (2 f w)²)|.
    let fw = 2000.0 * hit.contacts[0].width_s();
    let level = (std::f64::consts::PI * fw).cos() / (1.0 - 4.0 * fw * fw);
    assert!((20.0 * level.abs().log10() + 6.0).abs() < 0.1, "{level}");
}

#[test]
fn longer_pulses_hit_harder_until_they_press_on_and_strike_twice() {
    let mut rig = Rig::new(&strict(), 1).unwrap();
    let pulses: Vec<f64> = (0..200).map(|k| f64::from(k) * 1e-4).collect();
    let hits: Vec<Hit> = pulses[1..].iter().map(|pulse| fire(&mut rig, *pulse, 0)).collect();
    let arrives = hits.iter().position(|hit| !hit.contacts.is_empty()).unwrap();
    let twice = hits.iter().position(|hit| hit.contacts.len() > 1).unwrap();
    println!("arrives from {} ms, twice from {} ms", hits[arrives].pulse_s * 1e3, hits[twice].pulse_s * 1e3);
    assert!(hits[arrives].pulse_s > 1e-3 && hits[arrives].pulse_s < 3e-3);
    assert!(hits[twice].pulse_s > 5e-3 && hits[twice].pulse_s < 12e-3);
    assert!(hits[..arrives].iter().all(|hit| hit.peak_n() == 0.0));
    for pair in hits[arrives..].windows(2) {
        assert!(pair[1].peak_n() >= pair[0].peak_n() * (1.0 - 1e-12), "{pair:?}");
    }
    // Strictly monotonic while it flies freely at contact.
    for pair in hits[arrives..].windows(2).take_while(|pair| pair[1].pulse_s < 4.9e-3) {
        assert!(pair[1].peak_n() > pair[0].peak_n());
    }
    // Pushed on by the coil, it strikes again, weaker, and continues to do so or rests.
    assert!(hits[twice..].iter().all(|hit| hit.contacts.len() > 1));
    assert!(hits[twice].contacts[1].amplitude_n < hits[twice].contacts[0].amplitude_n);
    // A very long pulse ends with the bolt resting on the surface until the current stops.
    let long = fire(&mut rig, 0.1, 0);
    let last = long.contacts.last().unwrap();
    assert!(last.omega == 0.0 && last.end_s == 0.1 && last.amplitude_n > 0.0, "{long:?}");
    // In every case contacts follow one another without overlap.
    for hit in hits.iter().chain([&long]) {
        assert!(hit.contacts.windows(2).all(|pair| pair[0].end_s <= pair[1].start_s));
    }
}

#[test]
fn a_warm_coil_hits_less_hard() {
    let mut rig = Rig::new(&strict(), 1).unwrap();
    let peaks: Vec<f64> = (0..30).map(|attempt| fire(&mut rig, 3.5e-3, attempt).peak_n()).collect();
    assert!(peaks.windows(2).all(|pair| pair[1] < pair[0]));
    // 2 % of the force over stroke and time: about 4 % of the speed.
    assert!(peaks[29] / peaks[0] > 0.9 && peaks[29] / peaks[0] < 0.99, "{}", peaks[29] / peaks[0]);
}

#[test]
fn nonsense_pulses_do_nothing() {
    let mut rig = Rig::new(&strict(), 1).unwrap();
    for pulse in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        rig.fire(pulse);
    }
    assert!(rig.coil_pulses_s().is_empty() && rig.attempt() == 0);
}

#[test]
fn peaks_scatter_and_mishaps_come_at_their_rates() {
    let mut rig = Rig::new(&RigConfig::default(), 2).unwrap();
    let attempts = 2000;
    let hits: Vec<Hit> = (0..attempts)
        .map(|k| {
            rig.stage(Configuration::Ajb, "AZ3", "A3", 1000 + k).unwrap();
            rig.fire(3.5e-3);
            rig.last_hit().unwrap().clone()
        })
        .collect();
    let odds = RigConfig::default().hammer.mishaps;
    for (mishap, chance) in
        [(Mishap::DoubleHit, odds.double_hit), (Mishap::Weak, odds.weak), (Mishap::Overload, odds.overload)]
    {
        let count = hits.iter().filter(|hit| hit.mishap == mishap).count() as f64;
        let expected = chance * f64::from(attempts);
        println!("{mishap:?}: {count} for {expected}");
        // Four standard deviations of a count.
        assert!((count - expected).abs() < 4.0 * expected.sqrt(), "{mishap:?}: {count} for {expected}");
    }
    let good: Vec<f64> = hits.iter().filter(|hit| hit.mishap == Mishap::None).map(Hit::peak_n).collect();
    let mean = good.iter().sum::<f64>() / good.len() as f64;
    let spread =
        (good.iter().map(|peak| (peak - mean).powi(2)).sum::<f64>() / good.len() as f64).sqrt() / mean;
    // 2000 draws give a standard deviation to 1.6 %; four times that.
    assert!((spread / 0.02 - 1.0).abs() < 0.065, "{spread}");
    for hit in &hits {
        match hit.mishap {
            Mishap::DoubleHit => {
                let ratio = hit.contacts[1].amplitude_n / hit.contacts[0].amplitude_n;
                let delay_s = hit.contacts[1].start_s - hit.contacts[0].start_s;
                assert!((0.05..=0.30).contains(&ratio) && (0.002..=0.012).contains(&delay_s));
            }
            Mishap::Weak => assert!(hit.peak_n() < 0.25 * mean && hit.peak_n() > 0.04 * mean),
            // 10 V at 22.4 mV/N are 446 N: certainly clipped.
            Mishap::Overload => assert!(hit.peak_n() > 10.0 / 22.4e-3),
            Mishap::None => assert_eq!(hit.contacts.len(), 1),
        }
    }
}

#[test]
fn an_overload_clips_the_force_channel() {
    let mut config = RigConfig::default();
    config.hammer.mishaps.double_hit = 0.0;
    config.hammer.mishaps.weak = 0.0;
    config.hammer.mishaps.overload = 1.0;
    let mut rig = Rig::new(&config, 1).unwrap();
    let hit = fire(&mut rig, 3.5e-3, 0);
    let mut codes = [0; CHANNELS];
    let mut clipped = 0;
    for _ in 0..1000 {
        rig.scan(&mut codes);
        clipped += i32::from(codes[0] == i16::MAX);
    }
    assert!(clipped >= 2, "{clipped} at {} N", hit.peak_n());
}

//! Tests of the shaker's state machine, block by block.

extern crate std;
use jointrig_protocol::channel::{Axis, Name, Quantity, Role};
use std::vec::Vec as List;

use super::*;

const RATE: u32 = 51_200;
const FULL_V: f32 = 10.0;

/// A block with one channel and a constant code.
struct Block {
    first: u64,
    scans: usize,
    code: i16,
}

impl Scanned for Block {
    fn first_scan(&self) -> u64 {
        self.first
    }

    fn scans(&self) -> usize {
        self.scans
    }

    fn code(&self, _scan: usize, _channel: usize) -> i16 {
        self.code
    }
}

fn shaker(full_scale_v: f32) -> Shaker<'static> {
    let channel = Channel {
        name: Name::new(),
        role: Role::Response(Axis::Z),
        quantity: Quantity::Velocity,
        units_per_volt: 0.005,
        range_v: 10.0,
        delay_ns: 0,
        bits: 16,
    };
    Shaker::new(std::vec![channel].leak(), RATE, full_scale_v)
}

fn order(frequency_hz: f64, amplitude_v: f32) -> Shake {
    Shake {
        step: Shake::step_of(frequency_hz, RATE),
        control: Control::Drive,
        amplitude_v,
        slew_v_per_s: 100.0,
        valid_ms: 1000,
        limits: Vec::new(),
    }
}

/// Processes `blocks` blocks of 24 scans; returns the codes and the events.
fn run(shaker: &mut Shaker, now: &mut u64, blocks: u32, code: i16) -> (List<i16>, List<Event>) {
    let (mut all, mut told) = (List::new(), List::new());
    for _ in 0..blocks {
        let mut codes = [0; 24];
        if shaker.moves() {
            let block = Block { first: *now, scans: 24, code };
            told.extend(shaker.block(&block, &mut codes).into_iter().flatten());
        }
        all.extend(codes);
        *now += 24;
    }
    (all, told)
}

#[test]
fn the_sine_has_the_frequency_and_amplitude_that_were_ordered() {
    let (mut shaker, mut now) = (shaker(FULL_V), 0);
    assert_eq!(shaker.shake(now, &order(200.0, 5.0)), Ok(Some(Event::ShakerRuns)));
    // 0.05 s of rise at 100 V/s, then whole cycles of 256 scans
    run(&mut shaker, &mut now, 2560 / 24 + 1, 0);
    assert_eq!(shaker.state(), answer::Shaker::Steady);
    let (codes, told) = run(&mut shaker, &mut now, 32 * 4, 0);
    assert!(told.is_empty());
    let whole = 256 * 12;
    let (mut re, mut im, mut square) = (0.0_f64, 0.0_f64, 0.0_f64);
    for (i, code) in codes[..whole].iter().enumerate() {
        let (angle, value) = (i as f64 / 256.0 * core::f64::consts::TAU, f64::from(*code));
        re += value * angle.cos() / (whole as f64 / 2.0);
        im += value * angle.sin() / (whole as f64 / 2.0);
        square += value * value / whole as f64;
    }
    let amplitude = re.hypot(im);
    // rounding of a code averages out over the sum
    assert!((amplitude - 0.5 * 32767.0).abs() < 0.1, "{amplitude}");
    // everything but the sine: rounding to codes is 0.29 rms
    let rest = (square - amplitude * amplitude / 2.0).max(0.0).sqrt();
    assert!(rest < 0.4, "{rest}");
}

#[test]
fn the_amplitude_never_jumps_whatever_is_ordered() {
    let (mut shaker, mut now) = (shaker(FULL_V), 0);
    let mut all = List::new();
    // the fastest slew, and frequencies so low that the codes show the amplitude's own change
    let fast = |frequency, amplitude| Shake { slew_v_per_s: 200.0, ..order(frequency, amplitude) };
    for (frequency, amplitude) in [(100.0, 10.0), (130.0, 0.1), (90.0, 10.0), (90.0, 0.0)] {
        shaker.shake(now, &fast(frequency, amplitude)).expect("an order within bounds");
        all.extend(run(&mut shaker, &mut now, 140, 0).0);
    }
    shaker.shake(now, &fast(100.0, 10.0)).expect("an order within bounds");
    all.extend(run(&mut shaker, &mut now, 150, 0).0);
    assert_eq!(shaker.stop(Reason::Asked), Some(Event::ShakerStops(Reason::Asked)));
    let (codes, told) = run(&mut shaker, &mut now, 120, 0);
    all.extend(codes);
    assert_eq!(told, [Event::ShakerRests]);
    // slope of the fastest sine, 2 pi 130 Hz, plus the slew of full scale in 50 ms, plus rounding
    let steepest = 32767.0 * (core::f64::consts::TAU * 130.0 + 1.0 / 0.05) / f64::from(RATE) + 1.0;
    for pair in all.windows(2) {
        assert!(f64::from(pair[1] - pair[0]).abs() <= steepest, "{pair:?}");
    }
    assert_eq!(all.last(), Some(&0));
}

#[test]
fn an_order_expires_into_a_ramp() {
    let (mut shaker, mut now) = (shaker(FULL_V), 1_000_000);
    shaker.shake(now, &order(200.0, 5.0)).expect("an order within bounds");
    let (_, told) = run(&mut shaker, &mut now, 51_200 / 24, 0);
    assert!(told.is_empty());
    let (_, told) = run(&mut shaker, &mut now, 200, 0);
    assert_eq!(told, [Event::ShakerStops(Reason::Expired), Event::ShakerRests]);
    assert_eq!((shaker.state(), shaker.amplitude_v()), (answer::Shaker::Resting, 0.0));
    // renewed in time, it continues
    shaker.shake(now, &order(200.0, 5.0)).expect("an order within bounds");
    for _ in 0..5 {
        assert!(run(&mut shaker, &mut now, 1500, 0).1.is_empty());
        assert_eq!(shaker.shake(now, &order(200.0, 5.0)), Ok(None));
    }
}

#[test]
fn a_channel_beyond_its_limit_stops_it() {
    let (mut shaker, mut now) = (shaker(FULL_V), 0);
    // 0.01 m/s of 0.05 m/s full scale
    let mut limited = order(200.0, 5.0);
    limited.limits.push(0.01).expect("room for a limit");
    shaker.shake(now, &limited).expect("an order within bounds");
    assert!(run(&mut shaker, &mut now, 100, -6_553).1.is_empty());
    let (_, told) = run(&mut shaker, &mut now, 1, -6_555);
    assert_eq!(told, [Event::ShakerStops(Reason::Limit { channel: 0 })]);
    assert_eq!(shaker.state(), answer::Shaker::Stopping);
}

#[test]
fn orders_out_of_bounds_change_nothing() {
    let mut shaker = shaker(FULL_V);
    let good = order(200.0, 5.0);
    let mut many = good.clone();
    many.limits.extend([0.0; 2]);
    let bad = [
        Shake { step: 0, ..good.clone() },
        Shake { step: Shake::step_of(5121.0, RATE), ..good.clone() },
        Shake { amplitude_v: 10.01, ..good.clone() },
        Shake { amplitude_v: -1.0, ..good.clone() },
        Shake { amplitude_v: f32::NAN, ..good.clone() },
        Shake { slew_v_per_s: 201.0, ..good.clone() },
        Shake { slew_v_per_s: 0.0, ..good.clone() },
        Shake { slew_v_per_s: f32::NAN, ..good.clone() },
        Shake { valid_ms: 0, ..good.clone() },
        Shake { valid_ms: SHAKE_VALID_CAP_MS + 1, ..good.clone() },
        many,
    ];
    for order in bad {
        assert!(matches!(shaker.shake(0, &order), Err(Refusal::OutOfBounds(_))), "{order:?}");
        assert!(!shaker.moves());
    }
    assert_eq!(self::shaker(0.0).shake(0, &good), Err(Refusal::Unsupported));
    assert_eq!(shaker.shake(0, &good), Ok(Some(Event::ShakerRuns)));
}

#[test]
fn an_emergency_leaves_nothing_to_ramp() {
    let (mut shaker, mut now) = (shaker(FULL_V), 0);
    shaker.shake(now, &order(200.0, 5.0)).expect("an order within bounds");
    run(&mut shaker, &mut now, 200, 0);
    assert_eq!(shaker.halt(Reason::EmergencyStop), Some(Event::ShakerStops(Reason::EmergencyStop)));
    assert!(!shaker.moves());
    assert_eq!(shaker.halt(Reason::EmergencyStop), None);
    // when already stopping, it only reports that it is at rest
    shaker.shake(now, &order(200.0, 5.0)).expect("an order within bounds");
    run(&mut shaker, &mut now, 20, 0);
    assert_eq!(shaker.stop(Reason::FrontEnd), Some(Event::ShakerStops(Reason::FrontEnd)));
    assert_eq!(shaker.halt(Reason::RanDry), Some(Event::ShakerRests));
    // the next request starts from zero amplitude
    shaker.shake(now, &order(200.0, 5.0)).expect("an order within bounds");
    let (codes, _) = run(&mut shaker, &mut now, 1, 0);
    // 24 scans at 100 V/s are 0.047 V
    assert!(codes.iter().all(|code| code.abs() <= 154), "{codes:?}");
}

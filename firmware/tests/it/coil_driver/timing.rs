//! The longest pulse and the shortest pause that the hardware permits, for any input.

use crate::coil_driver::driver::{A_S, B_S, Driver, Outside, Wire};
use crate::coil_driver::one_shot::TOLERANCE;

/// Time step, s.
pub const STEP_S: f64 = 10e-6;

/// Tolerance extremes of both one-shots.
pub const CORNERS: [[f64; 2]; 4] = [
    [1.0 - TOLERANCE, 1.0 - TOLERANCE],
    [1.0 - TOLERANCE, 1.0 + TOLERANCE],
    [1.0 + TOLERANCE, 1.0 - TOLERANCE],
    [1.0 + TOLERANCE, 1.0 + TOLERANCE],
];

/// Longest and shortest pulse of one-shot A, shortest and longest pause of one-shot B, s.
pub const LONGEST_PULSE_S: f64 = A_S * (1.0 + TOLERANCE);
pub const SHORTEST_A_S: f64 = A_S * (1.0 - TOLERANCE);
pub const SHORTEST_PAUSE_S: f64 = B_S * (1.0 - TOLERANCE);
pub const LONGEST_PAUSE_S: f64 = B_S * (1.0 + TOLERANCE);

/// When the gate was on: start and end of each pulse, s.
pub fn pulses(driver: &mut Driver, seconds: f64, outside: impl Fn(f64) -> Outside) -> Vec<[f64; 2]> {
    let mut all: Vec<[f64; 2]> = Vec::new();
    let mut was_on = false;
    for n in 0..(seconds / STEP_S).round() as u64 {
        let at = n as f64 * STEP_S;
        let on = driver.step(outside(at), STEP_S);
        match (was_on, on) {
            (false, true) => all.push([at, at + STEP_S]),
            (true, true) => all.last_mut().unwrap()[1] = at + STEP_S,
            _ => {}
        }
        was_on = on;
    }
    all
}

/// PULSE is high from `from` for `width`, s.
fn high(at: f64, from: f64, width: f64) -> Wire {
    // half a step away from the edges, so that rounding has no effect
    let at = at + 0.5 * STEP_S;
    if at > from && at < from + width { Wire::High } else { Wire::Low }
}

#[test]
fn a_shot_lasts_as_long_as_it_was_ordered() {
    for corner in CORNERS {
        for width in [0.1e-3, 3.2e-3, 8e-3] {
            let found =
                pulses(&mut Driver::new(corner), 1.0, |at| Outside::new(high(at, 0.01, width), Wire::High));
            assert_eq!(found.len(), 1, "{found:?}");
            let [from, to] = found[0];
            assert!((to - from - width).abs() < 1.5 * STEP_S, "{width} s gave {} s", to - from);
        }
    }
}

#[test]
fn the_firmwares_longest_pulse_fits_and_its_pause_is_longer_than_the_drivers() {
    // 8 ms requested; at most 8.2 ms by the 16-bit timer at 8 MHz
    const TIMER_S: f64 = 65_535.0 / 8e6;
    const { assert!(TIMER_S < SHORTEST_A_S) };
    let pause_s = f64::from(jointrig_firmware::hammer::PAUSE_MS) * 1e-3;
    assert!(pause_s > LONGEST_PAUSE_S, "{pause_s} s against {LONGEST_PAUSE_S} s");
}

#[test]
fn a_pin_that_hangs_high_gives_one_pulse_and_closing_the_guard_gives_none() {
    for corner in CORNERS {
        let found =
            pulses(&mut Driver::new(corner), 3.0, |at| Outside::new(high(at, 0.01, 10.0), Wire::High));
        assert_eq!(found.len(), 1);
        assert!(found[0][1] - found[0][0] <= LONGEST_PULSE_S + 2.0 * STEP_S);

        // the guard closes while the pin is stuck high: A is reset until then, and needs an edge
        let found = pulses(&mut Driver::new(corner), 3.0, |at| {
            Outside::new(high(at, 0.01, 10.0), if at < 1.0 { Wire::Low } else { Wire::High })
        });
        assert!(found.is_empty(), "{found:?}");
    }
}

#[test]
fn an_order_within_the_pause_gives_no_pulse_not_even_a_late_one() {
    let second = |at: f64, from: f64| {
        let first = high(at, 0.01, 3e-3);
        if first == Wire::High { first } else { high(at, from, 8e-3) }
    };
    for corner in CORNERS {
        let end = 0.013 + B_S * corner[1];
        // the pin rises 4 ms before the pause ends, and is high when it ends
        let found =
            pulses(&mut Driver::new(corner), 1.0, |at| Outside::new(second(at, end - 4e-3), Wire::High));
        assert_eq!(found.len(), 1, "{found:?}");
        let found =
            pulses(&mut Driver::new(corner), 2.0, |at| Outside::new(second(at, end + 4e-3), Wire::High));
        assert_eq!(found.len(), 2, "{found:?}");
    }
}

#[test]
fn opening_the_guard_ends_a_pulse_and_closing_it_does_not_resume_it() {
    let mut driver = Driver::new([1.0; 2]);
    let found = pulses(&mut driver, 0.1, |at| {
        let permit = if (0.012..0.014).contains(&at) { Wire::Low } else { Wire::High };
        Outside::new(high(at, 0.01, 8e-3), permit)
    });
    assert_eq!(found.len(), 1);
    assert!((found[0][1] - 0.012).abs() < 1.5 * STEP_S);
}

/// A pin with random behaviour from many seeds: random telegraph signals of all rates at PULSE and
/// PERMIT, and wires that disconnect and reconnect.
#[test]
fn no_program_makes_a_pulse_longer_or_a_pause_shorter() {
    let mut pulses_seen = 0;
    for seed in 0..120_u64 {
        let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        let mut random = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mean_s = 1e-5 * 10_f64.powf(4.5 * random());
        let permit_s = 1e-3 * 10_f64.powf(3.0 * random());
        let mut wires = |mean: f64, often: [Wire; 4]| {
            let (mut at, mut all) = (0.0, Vec::new());
            while at < 4.0 {
                all.push((at, often[(4.0 * random()) as usize]));
                at -= mean * (1.0 - random()).ln();
            }
            all
        };
        let pulse = wires(mean_s, [Wire::Low, Wire::Low, Wire::High, Wire::Open]);
        let permit = wires(permit_s, [Wire::Low, Wire::High, Wire::High, Wire::High]);
        let now = |all: &[(f64, Wire)], at: f64| all[all.partition_point(|(from, _)| *from <= at) - 1].1;
        let corner = CORNERS[(seed % 4) as usize];
        let found = pulses(&mut Driver::new(corner), 4.0, |at| Outside {
            noise: true,
            ..Outside::new(now(&pulse, at), now(&permit, at))
        });
        pulses_seen += found.len();
        for [from, to] in &found {
            assert!(to - from <= LONGEST_PULSE_S + 2.0 * STEP_S, "seed {seed}: {from} to {to}");
        }
        for pair in found.windows(2) {
            let pause = pair[1][0] - pair[0][1];
            assert!(pause >= SHORTEST_PAUSE_S - 2.0 * STEP_S, "seed {seed}: a pause of {pause} s");
        }
    }
    assert!(pulses_seen > 60, "the drawn programs must strike at all: {pulses_seen}");
}

//! Behaviour of the coil in each state that the controller can be in. docs/safety.md contains this
//! table.

use crate::coil_driver::driver::{Driver, Outside, Wire};
use crate::coil_driver::page_holds;
use crate::coil_driver::timing::{CORNERS, LONGEST_PULSE_S, STEP_S, pulses};

/// The worst case in a state: the longest pulse over all tolerance corners and noise, s; 0 for
/// none. No state gives two pulses within the pause.
fn worst_s(begin: impl Fn(Driver) -> Driver, outside: impl Fn(f64, bool) -> Outside) -> f64 {
    let mut longest = 0.0_f64;
    for corner in CORNERS {
        for noise in [0.0, 173.0, 4_100.0] {
            let mut driver = begin(Driver::new(corner));
            let found = pulses(&mut driver, 2.0, |at| outside(at, (noise * at).sin() > 0.0));
            for [from, to] in found {
                longest = longest.max(to - from);
            }
        }
    }
    longest
}

fn said(longest_s: f64) -> String {
    if longest_s == 0.0 {
        "none".to_owned()
    } else {
        assert!(longest_s <= LONGEST_PULSE_S + 2.0 * STEP_S);
        format!("one pulse of {:.1} ms at most", 1e3 * LONGEST_PULSE_S)
    }
}

#[test]
fn every_state_of_the_controller_is_in_the_table() {
    let same = |driver: Driver| driver;
    let held = |pulse: Wire, permit: Wire| {
        move |_: f64, noise: bool| Outside { noise, ..Outside::new(pulse, permit) }
    };
    let stuck_from = |from: f64| {
        move |at: f64, noise: bool| {
            let pulse = if at < from { Wire::Low } else { Wire::High };
            Outside { noise, ..Outside::new(pulse, Wire::High) }
        }
    };
    let rows = [
        (
            "in reset, unpowered, being flashed, in the ROM's loader",
            worst_s(same, held(Wire::Open, Wire::High)),
        ),
        ("its cable to the driver is off", worst_s(same, held(Wire::Open, Wire::Open))),
        ("the guard is open or the stop is pressed, whatever the pin does", {
            worst_s(same, |at, noise| {
                let pulse = if (1e3 * at).sin() > 0.0 { Wire::High } else { Wire::Low };
                Outside { noise, ..Outside::new(pulse, Wire::Low) }
            })
        }),
        ("the guard closes while the pin hangs high", {
            worst_s(same, |at, noise| {
                let permit = if at < 1.0 { Wire::Low } else { Wire::High };
                Outside { noise, ..Outside::new(Wire::High, permit) }
            })
        }),
        ("the program hangs with the pin high", worst_s(same, stuck_from(0.1))),
        ("the driver has no 5 V", {
            worst_s(same, |_, noise| Outside {
                noise,
                logic_supply: false,
                ..Outside::new(Wire::High, Wire::High)
            })
        }),
        ("the driver's 5 V come while the pin is low or open", {
            let wake = |driver: Driver| Driver { a: driver.a.woken(true, false), ..driver };
            worst_s(wake, held(Wire::Open, Wire::High))
        }),
        ("the driver's 5 V come while the pin hangs high", {
            let wake = |driver: Driver| Driver { a: driver.a.woken(true, true), ..driver };
            worst_s(wake, held(Wire::High, Wire::High))
        }),
    ];
    let mut lines = vec!["| when | at the coil |".to_owned(), "|---|---|".to_owned()];
    lines.extend(rows.map(|(state, longest)| format!("| {state} | {} |", said(longest))));
    assert_eq!(lines.iter().filter(|line| line.contains("one pulse")).count(), 2);
    page_holds("safety.md", &lines);
}

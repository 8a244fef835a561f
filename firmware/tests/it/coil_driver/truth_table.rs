//! The gate for every input at 0, at 1 and open, with each one-shot at rest and running.

use crate::coil_driver::driver::{A_S, B_S, Driver, Outside, WIRES, Wire};
use crate::coil_driver::one_shot::{Edge, OneShot};
use crate::coil_driver::page_holds;

/// A driver with both one-shots in these states.
fn in_state(a: bool, b: bool) -> Driver {
    let driver = Driver::new([1.0; 2]);
    Driver {
        a: OneShot::new(Edge::Rising, false, A_S).woken(a, false),
        b: OneShot::new(Edge::Falling, true, B_S).woken(b, false),
        ..driver
    }
}

const STATES: [(bool, bool); 4] = [(false, false), (false, true), (true, false), (true, true)];

#[test]
fn the_gate_is_on_for_one_row_of_thirty_six_and_the_page_says_which() {
    let mut lines = vec![
        "| PULSE | PERMIT | neither runs | B runs | A runs | A and B run |".to_owned(),
        "|---|---|---|---|---|---|".to_owned(),
    ];
    let mut on = Vec::new();
    for pulse in WIRES {
        for permit in WIRES {
            let gates = STATES.map(|(a, b)| {
                // a level not held by a resistor would depend on the noise
                let [quiet, loud] = [false, true].map(|noise| {
                    let outside = Outside { noise, ..Outside::new(pulse, permit) };
                    in_state(a, b).gate(outside)
                });
                assert_eq!(quiet, loud, "{pulse:?}, {permit:?}: an input floats");
                if quiet {
                    on.push((pulse, permit, a, b));
                }
                if quiet { "**on**" } else { "off" }
            });
            lines.push(format!("| {} | {} | {} |", pulse.name(), permit.name(), gates.join(" | ")));
        }
    }
    assert_eq!(on, [(Wire::High, Wire::High, true, false)]);
    page_holds("WIRING.md", &lines);
}

#[test]
fn without_its_supply_the_gate_is_off() {
    for pulse in WIRES {
        for permit in WIRES {
            for (a, b) in STATES {
                let outside = Outside { logic_supply: false, noise: true, ..Outside::new(pulse, permit) };
                assert!(!in_state(a, b).gate(outside));
            }
        }
    }
}

/// An earlier circuit with one of the pull-downs missing: shows that the table check fails without
/// it.
#[test]
fn each_pull_down_is_needed() {
    for (pulse, permit) in [(false, true), (true, false)] {
        let mut driver = in_state(true, false);
        driver.pulse.pulled_down = pulse;
        driver.permit.pulled_down = permit;
        let [at_pulse, at_permit] = if pulse { [Wire::High, Wire::Open] } else { [Wire::Open, Wire::High] };
        let outside = Outside { noise: true, ..Outside::new(at_pulse, at_permit) };
        assert!(driver.gate(outside), "a floating input can give a shot");
    }
}

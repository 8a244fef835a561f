//! The guard chain: currents and times of its optocouplers, the effect of its relays on them when
//! the chain opens, and the heating of the coil by pulses.

use crate::coil_driver::timing::{LONGEST_PULSE_S, SHORTEST_PAUSE_S};

/// Supply voltage of the chain, V.
const CHAIN_V: f64 = 24.0;
/// Series resistor of each optocoupler, Ω, and its LED's forward voltage, V.
const SERIES_OHM: f64 = 4.7e3;
const LED_V: f64 = 1.25;
/// Minimum current transfer ratio of rank GB at 5 mA (Toshiba TLP291/TLP293, "Current transfer
/// ratio").
const TRANSFER: f64 = 1.0;
/// Fraction of the transfer ratio left after ageing and over temperature.
const LEFT: f64 = 0.5;
/// Load of each phototransistor to ground, Ω.
const LOAD_OHM: f64 = 2.2e3;
/// Its supply voltage, and its saturation voltage when it is on, V.
const OPTO_SUPPLY_V: f64 = 3.3;
const SATURATED_V: f64 = 0.4;
/// Largest reverse voltage of the LED, V (the same sheet, "Absolute maximum ratings").
const LED_REVERSE_V: f64 = 5.0;
/// A controller's pin needs 0.7 of its supply for a 1.
const PIN_HIGH: f64 = 0.7;

#[test]
fn the_optocouplers_reach_their_levels_with_old_leds() {
    let led_a = (CHAIN_V * 0.9 - LED_V) / SERIES_OHM;
    let can_a = led_a * TRANSFER * LEFT;
    let needed_a = PIN_HIGH * OPTO_SUPPLY_V / LOAD_OHM;
    assert!(can_a > 1.5 * needed_a, "{can_a} A against {needed_a} A");
    const { assert!(OPTO_SUPPLY_V - SATURATED_V > PIN_HIGH * OPTO_SUPPLY_V) };
}

#[test]
fn permit_falls_within_the_time_that_first_light_asks_for() {
    // Saturated, into 1.9 kΩ: this type is specified with 25 µs of storage time and 40 µs turn-off
    // time, typical (Broadcom ACPL-214, page 4; Toshiba's data sheet states the same test). Twice
    // that for a hot part, then an RC discharge of load, pin and 10 nF down to 0.3 of the supply.
    const ASKED_S: f64 = 200e-6;
    let storage_s = 2.0 * (25e-6 + 40e-6);
    let capacitor_f = 10e-9;
    let decay_s = LOAD_OHM * capacitor_f * (1.0_f64 / 0.3).ln();
    assert!(storage_s + decay_s < ASKED_S, "{} s", storage_s + decay_s);
}

#[test]
fn an_opening_chain_does_not_put_its_relays_voltage_on_the_leds() {
    // each relay's coil drives the chain to −(Zener + diode) when the contacts upstream of it open
    let kick_v = 24.0 * 1.05 + 1.0;
    assert!(kick_v > LED_REVERSE_V, "without the diodes the LEDs break down");
    // 1N4148 antiparallel to each LED
    let across_led_v = 1.0;
    assert!(across_led_v < LED_REVERSE_V);
    let through_diode_a = (kick_v - across_led_v) / SERIES_OHM;
    assert!(through_diode_a < 0.2 * 0.2, "a fifth of what a 1N4148 carries");
}

#[test]
fn the_worst_program_does_not_overheat_the_coil() {
    // 10 Ω at 24 V, as long and as often as the hardware permits
    let duty = LONGEST_PULSE_S / (LONGEST_PULSE_S + SHORTEST_PAUSE_S);
    let mean_w = CHAIN_V * CHAIN_V / 10.0 * duty;
    assert!(mean_w < 2.5, "{mean_w} W");
}

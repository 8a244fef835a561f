//! Checks that the signal levels between the parts are compatible.

/// Lowest output voltage of a 3.3 V pin for a 1, V: VDD − 0.4 V (STM32U5A5 data sheet, "Output
/// voltage characteristics").
const PIN_HIGH_V: f64 = 3.3 * 0.97 - 0.4;
/// Highest output voltage for a 0, V.
const PIN_LOW_V: f64 = 0.4;

/// Input thresholds for 0 and 1, V.
struct Thresholds {
    low_v: f64,
    high_v: f64,
}

/// 74HCT at 4.5 to 5.5 V (Nexperia 74HCT4538 and 74HCT21, "Static characteristics").
const HCT: Thresholds = Thresholds { low_v: 0.8, high_v: 2.0 };
/// 74HC at 5 V: 0.3 and 0.7 of the supply.
const HC: Thresholds = Thresholds { low_v: 0.3 * 5.0, high_v: 0.7 * 5.0 };
/// TC4427 (Microchip DS20001422, "Electrical characteristics").
const TC4427: Thresholds = Thresholds { low_v: 0.8, high_v: 2.4 };
/// Output of an HCT gate at 4.5 V and 4 mA: 0 and 1, V (the same data sheets).
const HCT_OUT_V: [f64; 2] = [0.33, 3.84];

fn fits(low_v: f64, high_v: f64, input: &Thresholds) -> bool {
    low_v < input.low_v && high_v > input.high_v
}

#[test]
fn a_pin_of_3_3_volts_drives_hct_and_would_not_drive_hc() {
    assert!(fits(PIN_LOW_V, PIN_HIGH_V, &HCT));
    assert!(!fits(PIN_LOW_V, PIN_HIGH_V, &HC), "this is why the driver's logic is HCT");
    assert!(fits(HCT_OUT_V[0], HCT_OUT_V[1], &TC4427));
}

#[test]
fn pull_downs_hold_against_every_leakage_and_load_no_pin() {
    const PULL_DOWN_OHM: f64 = 10e3;
    // an HCT input, a floating pin of the controller, 100 mm of trace: at most 1 µA each
    const { assert!(3e-6 * PULL_DOWN_OHM < 0.1 * HCT.low_v) };
    // a pin supplies 8 mA at the levels above
    const { assert!(PIN_HIGH_V / PULL_DOWN_OHM < 0.1 * 8e-3) };
    // the MOSFET's gate: IRLZ44N, threshold at least 1 V, leakage 100 nA, its driver without supply
    // 10 µA
    const { assert!(10.1e-6 * PULL_DOWN_OHM < 0.2) };
}

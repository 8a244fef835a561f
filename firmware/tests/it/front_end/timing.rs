//! Timing of a bit from the converter to the port, and its margin: docs/WIRING.md contains the same
//! table.

/// SCLK period, ns: 160 MHz / 4.
const PERIOD: f64 = 25.0;
/// From SCLK's rising edge at the converter to valid data, ns (AD7606B Rev. 0, "Timing
/// Specifications", serial interface, VDRIVE above 2.7 V).
const CONVERTER: f64 = 15.0;
/// Along 100 mm of trace or ribbon and back, ns: 6.7 ps/mm each way in FR4.
const TRACE: f64 = 2.0 * 100.0 * 6.7e-3;
/// Data setup time before the sampling edge, ns: the upper limit for this table, to be compared
/// with the controller's data sheet ("SPI characteristics", data input setup time in master mode)
/// before the board is ordered.
const SETUP: f64 = 4.0;
/// An isolator in both directions, ns: a fast digital isolator has about 10 ns in each.
const ISOLATOR: f64 = 2.0 * 10.0;

/// Timing margin, ns, when data are sampled `after` ns after the edge that outputs them.
fn left(after: f64, isolator: f64) -> f64 {
    after - CONVERTER - TRACE - SETUP - isolator
}

#[test]
fn half_a_clock_is_too_short_and_a_whole_one_is_enough() {
    assert!(left(PERIOD / 2.0, 0.0) < 0.0, "why the half clock was given up");
    assert!(left(PERIOD, 0.0) > 4.0, "without an isolator");
    assert!(left(PERIOD, ISOLATOR) < 0.0, "an isolator needs a slower clock");
    assert!(left(2.0 * PERIOD, ISOLATOR) > 4.0, "at 20 MHz it fits");
}

#[test]
fn the_wiring_shows_this_table() {
    let wiring =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/WIRING.md")).expect("the page");
    for (what, isolator) in [("no isolator", 0.0), ("an isolator", ISOLATOR)] {
        for (clock, after) in [
            ("half a clock of 40 MHz", PERIOD / 2.0),
            ("a clock of 40 MHz", PERIOD),
            ("a clock of 20 MHz", 2.0 * PERIOD),
        ] {
            let row = format!("| {clock} | {what} | {after:.1} | {:.1} |", left(after, isolator));
            assert!(wiring.contains(&row), "docs/WIRING.md lacks the row\n{row}");
        }
    }
}

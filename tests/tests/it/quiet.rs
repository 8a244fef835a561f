//! The hammer waits until the structure is quiet, so that the FRF of a second hit is as accurate as
//! the first.
#![allow(clippy::unwrap_used)]

use jointrig_hil_sim::rig::{Configuration, Quantity, RigConfig, exact_frf};
use jointrig_tests::campaign::second_hit_on_a;
use num_complex::Complex;

/// Window's decay, 1/s, as in the plan.
const SIGMA: f64 = 2.3;

/// Substructure A hangs on a wire and rings at 27 Hz for tens of seconds: two seconds after a hit a
/// third of that motion remains. The FRF of the second hit, computed from that record alone, must
/// agree with the exact one.
#[test]
fn the_second_hit_on_a_is_not_spoilt_by_the_first() {
    // errors of position, angle and sensors could not be distinguished from ringing here
    let rig = "[errors]\nnone = true\n\
               [hammer.mishaps]\ndouble_hit = 0.0\nweak = 0.0\noverload = 0.0\n";
    let config = RigConfig::from_toml(rig).unwrap();
    let hit = second_hit_on_a(rig);

    // on s = σ + iω
    let lines: Vec<f64> = (20..=400).map(|i| 0.5 * f64::from(i)).collect();
    let s: Vec<Complex<f64>> = lines.iter().map(|f| Complex::new(SIGMA, std::f64::consts::TAU * f)).collect();
    let impact = config.impact(Configuration::A, "AZ3").unwrap().probe();
    let response = config.response(Configuration::A, "A3").unwrap().probes()[2];
    let exact = exact_frf(&config, Configuration::A, Quantity::Mobility, &s, &[response], &[impact]).unwrap();
    let peak = exact.iter().map(|line| line[(0, 0)].norm()).fold(0.0, f64::max);
    for ((f, s), exact) in lines.iter().zip(&s).zip(&exact) {
        let error = (hit.mobility(*s) - exact[(0, 0)]).norm();
        assert!(error < 0.01 * peak, "{f} Hz: {error:.3e} of a peak of {peak:.3e}");
    }
}

//! The hammer waits until the structure is quiet, so that the FRF of a second hit is as accurate as
//! the first.
#![allow(clippy::unwrap_used)]

use jointrig::campaign::store::Store;
use jointrig::device::address::Address;
use jointrig_hil_sim::rig::{Configuration, Quantity, RigConfig, exact_frf};
use jointrig_tests::campaign::{plan, rows, run};
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
    let folder = tempfile::tempdir().unwrap();
    let description = folder.path().join("exact.toml");
    std::fs::write(&description, rig).unwrap();
    let config = RigConfig::from_toml(rig).unwrap();

    let file = folder.path().join("c.jrig");
    let address: Address = format!("sim:{}", description.display()).parse().unwrap();
    let (summary, _) = run(&file, &plan(2, &[("A", &["AZ3"], &["A3"])]), address.open(5).unwrap());
    assert_eq!(summary.kept, 2);

    let store = Store::open_read_only(&file).unwrap();
    let rows = rows(&store);
    let channels = store.channels(rows[1].session).unwrap();
    let samples = store.samples(&rows[1]).unwrap();
    let si = |name: &str| -> Vec<f64> {
        let place = channels.channels.iter().position(|channel| channel.name == name).unwrap();
        channels.to_si(place, samples.channel(place))
    };
    let (force, velocity) = (si("force"), si("vib_z"));

    // on s = σ + iω the transforms of both converge; the rectangular force window is 8 ms
    let lines: Vec<f64> = (20..=400).map(|i| 0.5 * f64::from(i)).collect();
    let period = 1.0 / 51_200.0;
    let transform = |signal: &[f64], s: Complex<f64>| -> Complex<f64> {
        signal.iter().enumerate().map(|(i, x)| *x * (-s * (i as f64 * period)).exp()).sum()
    };
    let s: Vec<Complex<f64>> = lines.iter().map(|f| Complex::new(SIGMA, std::f64::consts::TAU * f)).collect();
    let impact = config.impact(Configuration::A, "AZ3").unwrap().probe();
    let response = config.response(Configuration::A, "A3").unwrap().probes()[2];
    let exact = exact_frf(&config, Configuration::A, Quantity::Mobility, &s, &[response], &[impact]).unwrap();
    let peak = exact.iter().map(|line| line[(0, 0)].norm()).fold(0.0, f64::max);
    for ((f, s), exact) in lines.iter().zip(&s).zip(&exact) {
        let measured = transform(&velocity, *s) / transform(&force[..410], *s);
        let error = (measured - exact[(0, 0)]).norm();
        assert!(error < 0.01 * peak, "{f} Hz: {error:.3e} of a peak of {peak:.3e}");
    }
}

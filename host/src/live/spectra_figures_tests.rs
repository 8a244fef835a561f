use super::{of_average, of_force};
use crate::live::figures::Average;
use crate::report::figure::{Figure, Shape};
use crate::spectra::{CrossSpectra, FrfSettings, ImpactRecords, MotionQuantity, estimate};
use std::f64::consts::PI;

/// One hit with 1 Hz lines: the force is a half sine of 1 ms and 50 N, the response 2 nm/N times
/// `gain` along z and zero along x and y.
fn hit(gain: f64) -> CrossSpectra {
    const RATE_HZ: usize = 51_200;
    let pulse = |i: usize| {
        let part = (i as f64 - 256.0) / (1e-3 * RATE_HZ as f64);
        if (0.0..1.0).contains(&part) { 50.0 * (PI * part).sin() } else { 0.0 }
    };
    let force: Vec<f64> = (0..RATE_HZ).map(pulse).collect();
    let along = |h: f64| force.iter().map(|f| h * f).collect();
    let records = ImpactRecords {
        fs_hz: RATE_HZ as f64,
        force_n: vec![force.clone()],
        response: vec![vec![along(0.0), along(0.0), along(2e-9 * gain)]],
        quantity: MotionQuantity::Displacement,
    };
    estimate(&records, &[true], &FrfSettings::default()).expect("a pulse")
}

fn line(figure: &Figure, panel: usize) -> &[f32] {
    figure.panels[panel]
        .marks
        .iter()
        .find_map(|mark| match &mark.shape {
            Shape::Line { y, .. } => Some(y.0.as_slice()),
            _ => None,
        })
        .expect("a line")
}

fn average(gains: &[f64]) -> Average {
    let mut all = gains.iter().map(|gain| hit(*gain).band(10.0, 1000.0));
    let mut spectra = all.next();
    for one in all {
        spectra.as_mut().expect("the first").add(&one).expect("alike");
    }
    Average { cell: 1, records: Vec::new(), spectra, left_out: vec!["record 9: it is damaged".into()] }
}

#[test]
fn a_half_sine_of_1_ms_excites_820_hz() {
    let figure = of_force(7, &hit(1.0)).expect("a figure");
    let Shape::Shade { between } = figure.panels[0].marks[0].shape else { panic!("no band") };
    // the −6 dB point of a half sine is at 0.82 / T; one value covers 16 lines
    assert!(between[0] < 16.0 && (between[1] - 820.0).abs() < 16.0, "{between:?}");
    let force = line(&figure, 0);
    // at low frequencies the spectrum equals the pulse's area: 50 N · 1 ms · 2/π = 31.8 mN s
    assert!(force.iter().all(|v| v.is_finite()) && (force[0] - 31.8).abs() < 0.3, "{}", force[0]);
    assert!(figure.panels[0].x.range[1] < 2100.0, "what follows the band is not shown at length");
}

#[test]
fn one_hit_has_a_magnitude_and_two_have_errors_and_coherence() {
    let one = of_average("one", &average(&[1.0]), 2).expect("a figure");
    assert_eq!((one.panels.len(), one.panels[0].marks.len()), (1, 1));
    assert!(one.say.contains("of 1 hit.") && one.say.contains("record 9"), "{}", one.say);

    // two hits that differ by a tenth: H1 is their mean, and γ² = (Σh)²/(2Σh²)
    let two = of_average("two", &average(&[1.0, 1.1]), 2).expect("a figure");
    let (mean, coherence) = (2e-9 * 1.05, 2.1_f64.powi(2) / (2.0 * (1.0 + 1.21)));
    assert!(line(&two, 0).iter().all(|v| (f64::from(*v) / mean - 1.0).abs() < 1e-5));
    assert!(line(&two, 1).iter().all(|v| (f64::from(*v) - coherence).abs() < 1e-5));
    let Shape::Ribbon { low, high, .. } = &two.panels[0].marks[0].shape else { panic!("no ribbon") };
    // σ² = |H1|²(1 − γ²)/(2nγ²)
    let sigma = mean * ((1.0 - coherence) / (4.0 * coherence)).sqrt();
    for (low, high) in low.0.iter().zip(&high.0) {
        let (below, above) = (mean - f64::from(*low), f64::from(*high) - mean);
        assert!((below / sigma - 1.0).abs() < 1e-3 && (above / sigma - 1.0).abs() < 1e-3, "{below} {above}");
    }
    assert!(of_average("across", &average(&[1.0]), 0).is_none(), "nothing moved along x");
}

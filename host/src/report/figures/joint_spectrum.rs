//! k_z over frequency, one panel per method, one curve per IDM set, with the band of the means (the
//! paper's Fig. 10, A.11 to A.13).

use super::MICRO;
use crate::report::figure::{Along, Axis, Figure, Height, How, Mark, Packed, Panel, Role, Shape, Spread};
use crate::report::scale::middle_range;
use crate::report::words;
use crate::report::words::number::{decimals, micro};
use crate::results::{Joint, JointSpectrum, MAIN_BAND, Results, SpectrumCurve};
use crate::substructuring::Band;

/// Path of the frequencies.
const LINES: &str = "/joint_spectrum/frequency_hz/*";

/// Stiffness along z line by line.
pub fn joint_spectrum(results: &Results) -> Option<Figure> {
    let spectrum = results.joint_spectrum.as_ref()?;
    let curves: Vec<(usize, &SpectrumCurve)> =
        spectrum.curves.iter().enumerate().filter(|(_, c)| c.dof == "z").collect();
    let mut methods: Vec<&str> = Vec::new();
    for (_, curve) in &curves {
        if !methods.contains(&curve.method.as_str()) {
            methods.push(&curve.method);
        }
    }
    let frequencies = shown_range(spectrum, &bands(results))?;
    let stiffness = shown_stiffness(results, spectrum, &curves)?;
    let mut figure = Figure::new(
        "joint-spectrum",
        "10, A.11–A.13",
        "Joint stiffness over frequency",
        "Real part of the joint's dynamic stiffness along the sliding direction, by method and set of interface deformation modes (IDMs). The ribbon is ± σ of the FRFs' noise for the largest set; the main band is shaded, with the means over it. Values beyond the frame are cut.",
    )
    .across(2);
    for method in methods {
        let own = || curves.iter().filter(|(_, c)| c.method == method);
        let mut panel = Panel::new(
            Axis::frequency(Spread::Linear, frequencies),
            Axis::linear("k_z", "N/µm", stiffness).linked("k-z"),
        )
        .titled(format!("{method} ({})", words::method(method)))
        .high(Height::Usual)
        .with(Mark::shade(Role::Band, MAIN_BAND))
        .with(Mark::level(Role::Guide, 0.0));
        let along = Along::of(&spectrum.frequency_hz);
        let most = own().max_by_key(|(_, c)| c.idms);
        panel.marks.extend(most.and_then(|(i, curve)| ribbon(*i, curve, &along)));
        for (i, curve) in own() {
            let values = curve.stiffness_n_per_m.iter().map(|k| k.map_or(f64::NAN, micro));
            panel.marks.push(
                Mark::line(Role::modes(curve.idms), along.clone(), values)
                    .named(named(results, method, curve.idms))
                    .from("y", format!("/joint_spectrum/curves/{i}/stiffness_n_per_m/*"), 1.0 / MICRO)
                    .from("x", LINES, 1.0),
            );
        }
        let of_method = |j: &Joint| j.method == method && j.band_hz == MAIN_BAND;
        for (i, joint) in results.joint.iter().enumerate().filter(|(_, j)| of_method(j)) {
            let Some(k) = joint.sliding_stiffness() else { continue };
            let between = Some([MAIN_BAND.low_hz, MAIN_BAND.high_hz]);
            let level = Shape::Level { at: micro(k.mean), between };
            panel.marks.push(Mark::new(Role::modes(joint.idms), level).from(
                "at",
                format!("/joint/{i}/stiffness_n_per_m/z/mean"),
                1.0 / MICRO,
            ));
        }
        figure = figure.with(panel);
    }
    Some(figure)
}

/// `6 IDMs, mean 26.8`.
fn named(results: &Results, method: &str, idms: usize) -> String {
    let mean = results
        .joint
        .iter()
        .find(|j| j.method == method && j.idms == idms && j.band_hz == MAIN_BAND)
        .and_then(|j| j.sliding_stiffness())
        .map(|k| micro(k.mean));
    mean.map_or(format!("{idms} IDMs"), |k| {
        format!("{idms} IDMs: {}", decimals(k, usize::from(k.abs() < 100.0)))
    })
}

fn ribbon(index: usize, curve: &SpectrumCurve, along: &Along) -> Option<Mark> {
    if curve.stiffness_noise_n_per_m.len() != curve.stiffness_n_per_m.len() {
        return None;
    }
    let edge = |side: f64| {
        let both = curve.stiffness_n_per_m.iter().zip(&curve.stiffness_noise_n_per_m);
        Packed::of(
            both.map(|(k, noise)| k.zip(*noise).map_or(f64::NAN, |(k, noise)| micro(k + side * noise))),
        )
    };
    let at = |field: &str| format!("/joint_spectrum/curves/{index}/{field}/*");
    let two = |mark: Mark, of, how| {
        mark.from_two(of, at("stiffness_n_per_m"), how, at("stiffness_noise_n_per_m"), 1.0 / MICRO)
    };
    let shape = Shape::Ribbon { x: along.clone(), low: edge(-1.0), high: edge(1.0) };
    let mark = Mark::new(Role::modes(curve.idms), shape).from("x", LINES, 1.0);
    Some(two(two(mark, "low", How::Minus), "high", How::Plus))
}

/// The bands of the results.
fn bands(results: &Results) -> Vec<Band> {
    let mut bands: Vec<Band> = Vec::new();
    for joint in &results.joint {
        if !bands.contains(&joint.band_hz) {
            bands.push(joint.band_hz);
        }
    }
    bands
}

fn shown_range(spectrum: &JointSpectrum, bands: &[Band]) -> Option<[f64; 2]> {
    let (first, last) = (*spectrum.frequency_hz.first()?, *spectrum.frequency_hz.last()?);
    if bands.is_empty() {
        return Some([first, last]);
    }
    let low = bands.iter().map(|b| b.low_hz).fold(f64::INFINITY, f64::min);
    let high = bands.iter().map(|b| b.high_hz).fold(0.0, f64::max);
    let room = 0.05 * (high - low);
    Some([(low - room).max(first), (high + room).min(last)])
}

/// Range of the stiffness axis, N/µm: zero, and the middle range of the largest set of modes in the
/// main band, from the methods that identified a stiffness there. (Methods that failed may be off
/// by hundreds; they must not flatten the curve from which the headline is quoted.)
fn shown_stiffness(
    results: &Results,
    spectrum: &JointSpectrum,
    curves: &[(usize, &SpectrumCurve)],
) -> Option<[f64; 2]> {
    let most = curves.iter().map(|(_, c)| c.idms).max()?;
    let identified = |c: &SpectrumCurve| {
        let row = |j: &&Joint| j.method == c.method && j.idms == c.idms && j.band_hz == MAIN_BAND;
        results.joint.iter().find(row).is_some_and(Joint::identified)
    };
    let any = curves.iter().any(|(_, c)| c.idms == most && identified(c));
    let inside = |main_only: bool| {
        let lines = spectrum.frequency_hz.iter().cycle();
        let setting = curves.iter().filter(move |(_, c)| c.idms == most && (!any || identified(c)));
        let values = setting.flat_map(|(_, c)| &c.stiffness_n_per_m);
        values.zip(lines).filter_map(move |(k, f)| {
            let main = MAIN_BAND.contains(*f);
            k.filter(|_| main || !main_only).map(micro)
        })
    };
    let [low, high] =
        middle_range(inside(true), 0.95, 0.5).or_else(|| middle_range(inside(false), 0.9, 0.2))?;
    Some([low.min(-0.08 * high.abs()), high.max(0.08 * low.abs())])
}

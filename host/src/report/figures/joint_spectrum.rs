//! k_z over frequency, one panel per method, one curve per IDM set, with the bands that means are taken over.

use super::super::drawing::{Anchor, Area, Drawing, Stroke};
use super::super::panel::{INK, Panel, SHADE, legend};
use super::super::scale::{Scale, middle_range};
use super::{WIDTH, idm_stroke};
use crate::report::words;
use crate::report::words::number::{band, decimals, micro};
use crate::results::{JointSpectrum, MAIN_BAND, Results, SpectrumCurve};
use crate::substructuring::Band;

const LEFT: f64 = 70.0;
const RIGHT: f64 = 130.0;
const HEIGHT: f64 = 230.0;
const ABOVE: f64 = 74.0;

/// Stiffness along z line by line.
pub fn joint_spectrum(results: &Results) -> Option<String> {
    let spectrum = results.joint_spectrum.as_ref()?;
    let curves: Vec<&SpectrumCurve> = spectrum.curves.iter().filter(|c| c.dof == "z").collect();
    let mut methods: Vec<&str> = Vec::new();
    for curve in &curves {
        if !methods.contains(&curve.method.as_str()) {
            methods.push(&curve.method);
        }
    }
    let bands = bands(results);
    let frequencies = shown_range(spectrum, &bands)?;
    let stiffness = shown_stiffness(spectrum, &curves)?;
    let pitch = ABOVE + HEIGHT + 22.0;
    let mut drawing = Drawing::new("joint-spectrum", WIDTH, pitch * methods.len() as f64 + 26.0);
    for (i, method) in methods.iter().enumerate() {
        let area =
            Area { left: LEFT, top: i as f64 * pitch + ABOVE, width: WIDTH - LEFT - RIGHT, height: HEIGHT };
        let x = Scale::linear(frequencies, [area.left, area.right()]);
        let y = Scale::linear(stiffness, [area.bottom(), area.top]);
        let panel = Panel { area, x, y };
        let (x_ticks, y_ticks) = (x.ticks(9), y.ticks(5));
        let of_method = || curves.iter().copied().filter(|c| c.method == *method);
        panel.grid(&mut drawing, &x_ticks, &y_ticks);
        panel.shade(&mut drawing, MAIN_BAND.into(), SHADE, 0.14);
        panel.level(&mut drawing, frequencies, 0.0, Stroke::new(INK, 0.8));
        for curve in of_method() {
            let points = spectrum
                .frequency_hz
                .iter()
                .zip(&curve.stiffness_n_per_m)
                .map(|(f, k)| (*f, k.map_or(f64::NAN, micro)));
            panel.curve(&mut drawing, points, idm_stroke(curve.idms));
        }
        means(results, method, &panel, &mut drawing);
        brackets(&bands, &panel, &mut drawing);
        let last = i + 1 == methods.len();
        panel.axes(
            &mut drawing,
            (&x_ticks, last.then_some("frequency in Hz")),
            (&y_ticks, Some("k_z in N/µm")),
        );
        let title = format!("{method} ({})", words::method(method));
        drawing.text([area.left, area.top - ABOVE + 18.0], Anchor::Start, "title", &title);
        let entries: Vec<_> = of_method().map(|c| (idm_stroke(c.idms), format!("{} IDMs", c.idms))).collect();
        legend(&mut drawing, [area.left + 420.0, area.top - ABOVE + 18.0], &entries);
    }
    Some(drawing.finish("Joint stiffness along z over frequency for each method and set of interface modes"))
}

/// The bands of the results, widest first.
fn bands(results: &Results) -> Vec<Band> {
    let mut bands: Vec<Band> = Vec::new();
    for joint in &results.joint {
        if !bands.contains(&joint.band_hz) {
            bands.push(joint.band_hz);
        }
    }
    bands.sort_by(|a, b| (b.high_hz - b.low_hz).total_cmp(&(a.high_hz - a.low_hz)));
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

/// N/µm: the middle of what the richest set of modes shows in the main band, and zero. (Two modes may run off by
/// hundreds; they must not flatten the curve that the headline quotes.)
fn shown_stiffness(spectrum: &JointSpectrum, curves: &[&SpectrumCurve]) -> Option<[f64; 2]> {
    let most = curves.iter().map(|c| c.idms).max()?;
    let inside = |main_only: bool| {
        let lines = spectrum.frequency_hz.iter().cycle();
        let values = curves.iter().filter(move |c| c.idms == most).flat_map(|c| &c.stiffness_n_per_m);
        values.zip(lines).filter_map(move |(k, f)| {
            let main = MAIN_BAND.contains(*f);
            k.filter(|_| main || !main_only).map(micro)
        })
    };
    let [low, high] =
        middle_range(inside(true), 0.95, 0.5).or_else(|| middle_range(inside(false), 0.9, 0.2))?;
    Some([low.min(-0.08 * high.abs()), high.max(0.08 * low.abs())])
}

/// The means over the main band, as lines with their values at the right, apart from each other.
fn means(results: &Results, method: &str, panel: &Panel, drawing: &mut Drawing) {
    let mut labels: Vec<(f64, usize, f64)> = Vec::new();
    for joint in results.joint.iter().filter(|j| j.method == method && j.band_hz == MAIN_BAND) {
        let Some(k) = joint.sliding_stiffness() else { continue };
        let stroke = Stroke::new(idm_stroke(joint.idms).colour, 2.2);
        panel.level(drawing, MAIN_BAND.into(), micro(k.mean), Stroke::new("#fff", 4.0));
        panel.level(drawing, MAIN_BAND.into(), micro(k.mean), stroke);
        labels.push((panel.y.place_within(micro(k.mean)), joint.idms, micro(k.mean)));
    }
    labels.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut free = panel.area.top + 10.0;
    let count = labels.len();
    for (i, (at, idms, mean)) in labels.into_iter().enumerate() {
        let below = (count - 1 - i) as f64 * 17.0;
        let y = at.max(free).min((panel.area.bottom() - below).max(free));
        let stroke = Stroke::new(idm_stroke(idms).colour, 2.2);
        drawing.line([panel.area.right() + 8.0, y], [panel.area.right() + 22.0, y], stroke);
        let text = format!("{idms} IDMs: {}", decimals(mean, usize::from(mean.abs() < 100.0)));
        drawing.text([panel.area.right() + 27.0, y + 4.0], Anchor::Start, "legend", &text);
        free = y + 17.0;
    }
}

/// A bracket above the frame for every band.
fn brackets(bands: &[Band], panel: &Panel, drawing: &mut Drawing) {
    let mut rows: Vec<Vec<Band>> = Vec::new();
    for range in bands {
        // bands that only touch share a row
        let apart = |one: &Band, other: &Band| one.high_hz <= other.low_hz || other.high_hz <= one.low_hz;
        let free = |row: &Vec<Band>| row.iter().all(|other| apart(other, range));
        let row = rows.iter().position(free).unwrap_or(rows.len());
        if row == rows.len() {
            rows.push(Vec::new());
        }
        rows[row].push(*range);
        let (from, to) = (panel.x.place_within(range.low_hz), panel.x.place_within(range.high_hz));
        let at = panel.area.top - 8.0 - 17.0 * row as f64;
        let stroke = Stroke::new("#777", 1.2);
        drawing.line([from + 2.0, at], [to - 2.0, at], stroke);
        for end in [from + 2.0, to - 2.0] {
            drawing.line([end, at], [end, at + 4.0], stroke);
        }
        drawing.text([f64::midpoint(from, to), at - 3.0], Anchor::Middle, "tick", &band(*range));
    }
}

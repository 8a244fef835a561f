//! A matrix of FRFs from a file or from memory.

use crate::frf::{Frf, MotionQuantity};
use crate::report::figure::{Along, Axis, Figure, Mark, Panel, Role, Spread};
use crate::report::scale::middle_range;

/// More curves than this cannot be distinguished.
const MOST: usize = 6;

/// Magnitude over frequency of the first pairs, inputs varying fastest; `None` with fewer than two
/// lines above 0 Hz.
pub fn frf_matrix(frf: &Frf) -> Option<Figure> {
    let pairs: Vec<(usize, usize)> =
        (0..frf.outputs().len()).flat_map(|o| (0..frf.inputs().len()).map(move |i| (o, i))).collect();
    let shown = &pairs[..pairs.len().min(MOST)];
    let lines: Vec<usize> = (0..frf.lines().len()).filter(|line| frf.frequency_hz()[*line] > 0.0).collect();
    let hz: Vec<f64> = lines.iter().map(|line| frf.frequency_hz()[*line]).collect();
    let frequencies = [*hz.first()?, *hz.last()?];
    if frequencies[0] >= frequencies[1] {
        return None;
    }
    let curve = |(o, i): (usize, usize)| -> Vec<f64> {
        let magnitude = |line: &usize| frf.lines()[*line][(o, i)].norm();
        // zero cannot be shown on a logarithmic axis
        lines.iter().map(magnitude).map(|m| if m > 0.0 { m } else { f64::NAN }).collect()
    };
    let curves: Vec<Vec<f64>> = shown.iter().map(|pair| curve(*pair)).collect();
    let seen = curves.iter().flatten().filter(|m| m.is_finite()).map(|m| m.log10());
    let [low, high] = middle_range(seen, 0.998, 0.04)?;
    // a flat curve needs a minimum height of the axis
    let [low, high] = if high - low < 0.1 { [low - 0.05, high + 0.05] } else { [low, high] };
    let unit = match frf.quantity() {
        MotionQuantity::Displacement => "m/N",
        MotionQuantity::Velocity => "m/(s N)",
        MotionQuantity::Acceleration => "m/(s² N)",
    };
    let name = frf.quantity().frf_name();
    let y = Axis::log(name, unit, [10f64.powf(low), 10f64.powf(high)]);
    let mut panel = Panel::new(Axis::frequency(Spread::Log, frequencies), y);
    for (group, ((o, i), values)) in shown.iter().zip(curves).enumerate() {
        let of = format!("{} from {}", frf.outputs()[*o], frf.inputs()[*i]);
        panel = panel.with(Mark::line(Role::group(group), Along::of(&hz), values).named(of));
    }
    let (outputs, inputs) = (frf.outputs().len(), frf.inputs().len());
    let say = format!("{} of {} FRFs.", shown.len(), pairs.len());
    let title = format!("{name}: {outputs} outputs, {inputs} inputs, {} lines", frf.lines().len());
    Some(Figure::new("frf-matrix", "", title, say).with(panel))
}

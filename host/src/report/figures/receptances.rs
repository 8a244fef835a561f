//! FRFs of A, B and the assembly: magnitude, phase and coherence, side by side, from a matrix of
//! FRFs of a file or from memory.

use crate::frf::{Frf, MotionQuantity};
use crate::report::figure::{Along, Axis, Figure, Height, Mark, Panel, Role, Spread};
use crate::report::scale::middle_range;
use crate::results::{FrfCurve, MAIN_BAND, Results, Role as Shows};
use crate::structure::Structure;

/// Below this frequency neither hammer nor vibrometer gives useful data, Hz.
const LOWEST_HZ: f64 = 5.0;

/// Driving point and transfer FRF of every configuration that has them.
pub fn receptances(results: &Results) -> Option<Figure> {
    let shown = |c: &&FrfCurve| matches!(c.role, Shows::DrivingPoint | Shows::Transfer);
    let indexed = || results.frfs.iter().enumerate().filter(|(_, c)| shown(c));
    let configurations: Vec<&str> = Structure::ALL
        .into_iter()
        .map(Structure::name)
        .filter(|name| indexed().any(|(_, c)| c.configuration == *name))
        .collect();
    if configurations.is_empty() {
        return None;
    }
    let all = || indexed().flat_map(|(_, c)| &c.magnitude_m_per_n).copied().filter(|m| *m > 0.0);
    let [low, high] = middle_range(all().map(f64::log10), 0.998, 0.04)?;
    let magnitudes = [10f64.powf(low), 10f64.powf(high)];
    let frequencies = [
        indexed().map(|(_, c)| c.first_hz.max(LOWEST_HZ)).fold(f64::INFINITY, f64::min),
        indexed().map(|(_, c)| last_hz(c)).fold(0.0, f64::max),
    ];
    let mut figure = Figure::new(
        "receptances",
        "",
        "Receptances of A, B and the assembly",
        "With phase, and with coherence where it is known, at a driving point and across the interface. The main band is shaded yellow; grey marks \
         lines at which the hammer's force is more than 6 dB down.",
    )
    .across(configurations.len());
    let has_coherence = indexed().any(|(_, c)| !c.coherence.is_empty());
    for kind in [CurveKind::Magnitude, CurveKind::Phase, CurveKind::Coherence] {
        if kind == CurveKind::Coherence && !has_coherence {
            continue;
        }
        for name in &configurations {
            let x = Axis::frequency(Spread::Log, frequencies);
            let mut panel = Panel::new(x, kind.axis(magnitudes)).high(kind.height());
            if kind == CurveKind::Magnitude {
                panel.title = title(name).into();
            } else {
                panel = panel.named_above();
            }
            panel.marks.push(Mark::shade(Role::Band, MAIN_BAND));
            for band in results.usable_bands.iter().filter(|b| b.configuration == *name) {
                panel.marks.push(Mark::shade(Role::Unusable, [frequencies[0], band.band_hz.low_hz]));
                panel.marks.push(Mark::shade(Role::Unusable, [band.band_hz.high_hz, frequencies[1]]));
            }
            for (i, curve) in indexed().filter(|(_, c)| c.configuration == *name) {
                panel.marks.extend(line(curve, i, kind));
            }
            figure = figure.with(panel);
        }
    }
    Some(figure)
}

fn title(configuration: &str) -> &str {
    match configuration {
        "A" => "A alone",
        "B" => "B alone",
        "AJB" => "Assembly AJB",
        other => other,
    }
}

fn last_hz(curve: &FrfCurve) -> f64 {
    curve.frequency_hz(curve.magnitude_m_per_n.len().saturating_sub(1))
}

#[derive(Clone, Copy, PartialEq)]
enum CurveKind {
    Magnitude,
    Phase,
    Coherence,
}

impl CurveKind {
    fn height(self) -> Height {
        if self == CurveKind::Magnitude { Height::Usual } else { Height::Low }
    }

    fn axis(self, magnitudes: [f64; 2]) -> Axis {
        match self {
            CurveKind::Magnitude => Axis::log("receptance", "m/N", magnitudes),
            CurveKind::Phase => Axis::linear("phase", "°", [-190.0, 190.0]).every(90.0),
            CurveKind::Coherence => Axis::linear("coherence", "", [0.0, 1.05]),
        }
    }
}

fn line(curve: &FrfCurve, index: usize, kind: CurveKind) -> Option<Mark> {
    let role = if curve.role == Shows::DrivingPoint { Role::Group1 } else { Role::Group2 };
    let (values, field) = match kind {
        CurveKind::Magnitude => (curve.magnitude_m_per_n.clone(), "magnitude_m_per_n"),
        CurveKind::Phase => (unbroken(&curve.phase_deg), "phase_deg"),
        CurveKind::Coherence => (curve.coherence.clone(), "coherence"),
    };
    let mark = Mark::line(role, along(curve, values.len()), values).from(
        "y",
        format!("/frfs/{index}/{field}/*"),
        1.0,
    );
    let mark = placed(mark, index);
    (curve.magnitude_m_per_n.len() > 1).then(|| mark.named(format!("{} from {}", curve.output, curve.input)))
}

/// Positions of the lines of an FRF.
pub(super) fn along(curve: &FrfCurve, count: usize) -> Along {
    Along::Regular { first: curve.first_hz, step: curve.step_hz, count }
}

/// Adds the origin of its frequencies to a curve.
pub(super) fn placed(mark: Mark, index: usize) -> Mark {
    mark.from("first", format!("/frfs/{index}/first_hz"), 1.0).from(
        "step",
        format!("/frfs/{index}/step_hz"),
        1.0,
    )
}

/// Inserts a gap where the phase wraps, instead of a line across the whole frame.
pub(super) fn unbroken(degrees: &[f64]) -> Vec<f64> {
    let jumps = |i: usize| degrees.get(i + 1).is_some_and(|next| (next - degrees[i]).abs() > 180.0);
    (0..degrees.len()).map(|i| if jumps(i) { f64::NAN } else { degrees[i] }).collect()
}

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

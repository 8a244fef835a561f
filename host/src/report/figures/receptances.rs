//! FRFs of A, B and the assembly: magnitude, phase and coherence, side by side.

use super::super::drawing::{Anchor, Area, Drawing, Stroke};
use super::super::panel::{BLUE, Panel, SHADE, VERMILION, legend};
use super::super::scale::{Scale, middle_range};
use super::WIDTH;
use crate::results::{FrfCurve, MAIN_BAND, Results, Role};

const GAP: f64 = 40.0;
const LEFT: f64 = 70.0;
const TOP: f64 = 48.0;

/// Driving point and transfer of every configuration that has them.
pub fn receptances(results: &Results) -> Option<String> {
    let shown = |c: &&FrfCurve| matches!(c.role, Role::DrivingPoint | Role::Transfer);
    let configurations: Vec<&str> = ["A", "B", "AJB"]
        .into_iter()
        .filter(|name| results.frfs.iter().filter(shown).any(|c| c.configuration == *name))
        .collect();
    if configurations.is_empty() {
        return None;
    }
    let all =
        || results.frfs.iter().filter(shown).flat_map(|c| &c.magnitude_m_per_n).copied().filter(|m| *m > 0.0);
    let [low, high] = middle_range(all().map(f64::log10), 0.998, 0.04)?;
    let magnitudes = [10f64.powf(low), 10f64.powf(high)];
    let frequencies = [
        results.frfs.iter().map(|c| c.first_hz.max(5.0)).fold(f64::INFINITY, f64::min),
        results.frfs.iter().map(last_hz).fold(0.0, f64::max),
    ];
    let column = (WIDTH - LEFT - GAP * 2.0 - 20.0) / 3.0;
    let mut drawing = Drawing::new("receptances", WIDTH, TOP + 240.0 + 14.0 + 120.0 + 14.0 + 90.0 + 48.0);
    for (i, name) in configurations.iter().enumerate() {
        let curves: Vec<&FrfCurve> =
            results.frfs.iter().filter(shown).filter(|c| c.configuration == *name).collect();
        let left = LEFT + i as f64 * (column + GAP);
        let mut top = TOP;
        drawing.text([left, 16.0], Anchor::Start, "title", title(name));
        let entries: Vec<_> =
            curves.iter().map(|c| (stroke(c), format!("{} from {}", c.output, c.input))).collect();
        legend(&mut drawing, [left, 38.0], &entries);
        for kind in [Kind::Magnitude, Kind::Phase, Kind::Coherence] {
            let area = Area { left, top, width: column, height: kind.height() };
            let x = Scale::logarithmic(frequencies, [area.left, area.right()]);
            let y = kind.scale(magnitudes, [area.bottom(), area.top]);
            let panel = Panel { area, x, y };
            let x_ticks = x.ticks(6);
            let y_ticks = if kind == Kind::Phase { y.ticks_every(90.0) } else { y.ticks(3) };
            panel.grid(&mut drawing, &x_ticks, &y_ticks);
            panel.shade(&mut drawing, MAIN_BAND.into(), SHADE, 0.10);
            for band in results.usable_bands.iter().filter(|b| b.configuration == *name) {
                panel.shade(&mut drawing, [frequencies[0], band.band_hz.low_hz], "#777", 0.18);
                panel.shade(&mut drawing, [band.band_hz.high_hz, frequencies[1]], "#777", 0.18);
            }
            for curve in &curves {
                draw(&panel, &mut drawing, curve, kind);
            }
            let x_label = (kind == Kind::Coherence).then_some("frequency in Hz");
            panel.axes(&mut drawing, (&x_ticks, x_label), (&y_ticks, (i == 0).then_some(kind.label())));
            top += kind.height() + 14.0;
        }
    }
    Some(drawing.finish("Receptances of A, B and the assembly with phase and coherence"))
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

fn stroke(curve: &FrfCurve) -> Stroke {
    match curve.role {
        Role::DrivingPoint | Role::SpecimenB | Role::ArmB => Stroke::new(BLUE, 1.0),
        Role::Transfer | Role::SpecimenA | Role::ArmA => Stroke::new(VERMILION, 1.0),
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Magnitude,
    Phase,
    Coherence,
}

impl Kind {
    fn height(self) -> f64 {
        match self {
            Kind::Magnitude => 240.0,
            Kind::Phase => 120.0,
            Kind::Coherence => 90.0,
        }
    }

    fn label(self) -> &'static str {
        match self {
            Kind::Magnitude => "receptance in m/N",
            Kind::Phase => "phase in °",
            Kind::Coherence => "coherence",
        }
    }

    fn scale(self, magnitudes: [f64; 2], pixels: [f64; 2]) -> Scale {
        match self {
            Kind::Magnitude => Scale::logarithmic(magnitudes, pixels),
            Kind::Phase => Scale::linear([-190.0, 190.0], pixels),
            Kind::Coherence => Scale::linear([0.0, 1.05], pixels),
        }
    }
}

fn draw(panel: &Panel, drawing: &mut Drawing, curve: &FrfCurve, kind: Kind) {
    let along = |values: &[f64]| -> Vec<(f64, f64)> {
        values.iter().enumerate().map(|(l, v)| (curve.frequency_hz(l), *v)).collect()
    };
    let points = match kind {
        Kind::Magnitude => along(&curve.magnitude_m_per_n),
        Kind::Phase => unbroken(&along(&curve.phase_deg)),
        Kind::Coherence => along(&curve.coherence),
    };
    panel.curve(drawing, points.into_iter(), stroke(curve));
}

/// A gap wherever the phase jumps from one edge to the other, instead of a line across the whole frame.
pub(super) fn unbroken(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut cut = Vec::with_capacity(points.len());
    for (i, p) in points.iter().enumerate() {
        if i > 0 && (p.1 - points[i - 1].1).abs() > 180.0 {
            cut.push((p.0, f64::NAN));
        }
        cut.push(*p);
    }
    cut
}

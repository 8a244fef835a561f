//! Figures of the modes: the stabilisation chart of each structure, and the shapes at the points
//! where they were measured.

use crate::report::figure::{Axis, Figure, Height, Mark, Marker, Panel, Role, Scene, Shape, Spot, Spread};
use crate::report::scale::middle_range;
use crate::report::words::mode_sentences::values;
use crate::report::words::number::decimals;
use crate::results::{HitFrequency, ModalFit, ModeRow, Results};
use num_complex::Complex;

/// Modes whose shapes are drawn, at most: the lowest of the structure.
const SHAPES: usize = 6;

/// Length of the largest arrow of a shape, as a fraction of the structure's extent.
const LARGEST: f64 = 0.25;

/// How the poles of each class of stability are drawn, from new to stable in everything.
const CLASSES: [(Role, Marker, &str); 4] = [
    (Role::Noise, Marker::Ring, "new"),
    (Role::Clamp, Marker::Ring, "stable in frequency"),
    (Role::BetweenArms, Marker::Frame, "also in damping or shape"),
    (Role::Answer, Marker::Dot, "also in both"),
];

/// The poles of rising model orders, one panel for each structure.
pub fn stabilisation(results: &Results) -> Option<Figure> {
    let charts = results.modal.iter().enumerate().filter(|(_, fit)| !fit.chart.is_empty());
    let mut figure = Figure::new(
        "stabilisation",
        "",
        "Stabilisation chart",
        "Poles of rising model orders. Vertical lines are the modes listed in the table; they are fitted to the FRFs by maximum likelihood and not picked from this chart, whose damping is biased by noise.",
    );
    for (at, fit) in charts {
        let panel = chart(at, fit, &results.modes);
        // the names are the same in all panels
        let panel = if figure.panels.is_empty() { panel } else { panel.named_above() };
        figure = figure.with(panel);
    }
    (!figure.panels.is_empty()).then_some(figure)
}

fn chart(at: usize, fit: &ModalFit, modes: &[ModeRow]) -> Panel {
    let orders = fit.chart.iter().flat_map(|class| &class.order).copied().max().unwrap_or(1);
    let x = Axis::frequency(Spread::Log, [fit.band_hz.low_hz.max(0.1), fit.band_hz.high_hz]);
    let y = Axis::linear("order of the model", "", [0.0, 1.05 * orders as f64]);
    let mut panel = Panel::new(x, y).titled(fit.structure.clone().unwrap_or_default());
    for mode in modes.iter().filter(|mode| mode.structure == fit.structure) {
        panel = panel.with(Mark::new(Role::Guide, Shape::Upright { at: mode.frequency_hz.mean }));
    }
    for (k, class) in fit.chart.iter().enumerate() {
        let (role, marker, name) = CLASSES[usize::from(class.stable).min(CLASSES.len() - 1)];
        let poles = class.frequency_hz.iter().zip(&class.order).map(|(f, order)| [*f, *order as f64]);
        panel = panel.with(
            Mark::points(role, marker, poles)
                .named(name)
                .from("x", format!("/modal/{at}/chart/{k}/frequency_hz/*"), 1.0)
                .from("y", format!("/modal/{at}/chart/{k}/order/*"), 1.0),
        );
    }
    panel
}

/// The lowest modes of the assembly, or of the last structure that has modes: where each point
/// moves, at the instant at which the point that moves most is farthest out.
pub fn shapes(results: &Results) -> Option<Figure> {
    let placed = |fit: &ModalFit| fit.sensors.len() > 1;
    let own = |fit: &ModalFit| results.modes.iter().filter(|m| m.structure == fit.structure).count();
    let (at, fit) = results.modal.iter().enumerate().rfind(|(_, fit)| placed(fit) && own(fit) > 0)?;
    let structure = fit.structure.clone().unwrap_or_default();
    let mut figure = Figure::new(
        "mode-shapes",
        "",
        "Shapes of the modes",
        format!(
            "{structure}: squares are the measured points at rest, lines show where they move: orange on A, blue on B. Drag or use the arrow keys to turn it."
        ),
    )
    .across(2);
    for mode in results.modes.iter().filter(|mode| mode.structure == fit.structure).take(SHAPES) {
        let [frequency, damping] = values(mode);
        let spots = spots(results, fit, mode);
        let mark = Mark::new(Role::Measured, Shape::Scene(Scene { bodies: Vec::new(), spots }));
        figure = figure.with(
            Panel::new(Axis::linear("", "", [0.0, 1.0]), Axis::linear("", "", [0.0, 1.0]))
                .titled(format!("{frequency} Hz, damping {damping} %"))
                .high(Height::Square)
                .with(mark.from("at", format!("/modal/{at}/sensors/*/position_m/*"), 1.0)),
        );
    }
    Some(figure)
}

/// The points at rest and their displacements in this mode.
fn spots(results: &Results, fit: &ModalFit, mode: &ModeRow) -> Vec<Spot> {
    let value =
        |output: usize| mode.shape.get(output).map_or(Complex::default(), |v| Complex::new(v.re, v.im));
    let largest = (0..mode.shape.len()).map(value).max_by(|a, b| a.norm().total_cmp(&b.norm()));
    let largest = largest.filter(|v| v.norm() > 0.0).unwrap_or(Complex::from(1.0));
    let moved = |sensor: &str| {
        let mut sum = [0.0; 3];
        for (output, point) in fit.outputs.iter().enumerate().filter(|(_, point)| point.name == sensor) {
            let along = (value(output) / largest).re;
            for (sum, part) in sum.iter_mut().zip(point.direction.unwrap_or_default()) {
                *sum += along * part;
            }
        }
        sum
    };
    let length = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let between = |a: [f64; 3], b: [f64; 3]| length(std::array::from_fn(|i| a[i] - b[i]));
    let places = || fit.sensors.iter().map(|sensor| sensor.position_m);
    let extent = places().flat_map(|a| places().map(move |b| between(a, b))).fold(0.0, f64::max);
    let most = fit.sensors.iter().map(|sensor| length(moved(&sensor.name))).fold(0.0, f64::max);
    let scale = if most > 0.0 { LARGEST * extent / most } else { 0.0 };
    let role = |name: &str| {
        let place = results.geometry.iter().find(|p| p.name == name && p.kind == "response");
        match place.map(|p| p.grouping) {
            Some(1 | 3 | 5) => Role::SpecimenA,
            Some(2 | 4 | 6) => Role::SpecimenB,
            _ => Role::Measured,
        }
    };
    let spot = |sensor: &crate::results::SensorPlace| Spot {
        name: sensor.name.clone(),
        role: role(&sensor.name),
        at: sensor.position_m,
        toward: None,
        moves: Some(moved(&sensor.name).map(|v| scale * v)),
    };
    fit.sensors.iter().map(spot).collect()
}

/// The lowest mode of the assembly in every hit, over the campaign.
pub fn first_mode(results: &Results) -> Option<Figure> {
    let found = results.first_mode.as_ref().filter(|found| found.hits.len() > 1)?;
    let range = middle_range(found.hits.iter().map(|hit| hit.frequency_hz), 1.0, 0.25)?;
    let records = found.hits.iter().map(|hit| hit.record as f64);
    let first = records.clone().fold(f64::INFINITY, f64::min);
    let last = records.fold(f64::NEG_INFINITY, f64::max);
    let margin = 0.02 * (last - first).max(1.0);
    let x = Axis::linear("record, in the order of the hits", "", [first - margin, last + margin]);
    let y = Axis::linear("natural frequency", "Hz", range);
    let points = found.hits.iter().map(|hit| [hit.record as f64, hit.frequency_hz]);
    let says = |hit: &HitFrequency| {
        format!("record {}, impact {}: {} Hz", hit.record, hit.impact, decimals(hit.frequency_hz, 3))
    };
    let mark = Mark::points(Role::Measured, Marker::Dot, points)
        .barred("y", found.hits.iter().map(|hit| hit.ci95))
        .saying(found.hits.iter().map(says).collect())
        .from("x", "/first_mode/hits/*/record", 1.0)
        .from("y", "/first_mode/hits/*/frequency_hz", 1.0)
        .from("low", "/first_mode/hits/*/ci95/0", 1.0)
        .from("high", "/first_mode/hits/*/ci95/1", 1.0);
    let figure = Figure::new(
        "first-mode",
        "",
        "The first mode over the campaign",
        format!("{} Bars are each hit's own 95 % interval.", found.meaning),
    );
    Some(figure.with(Panel::new(x, y).with(mark)))
}

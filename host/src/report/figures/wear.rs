//! A wear run along its cycles: stiffness, friction, and the energy dissipated so far.

use super::MICRO;
use crate::report::figure::{Along, Axis, Figure, Mark, Panel, Role};
use crate::report::words::number::micro;
use crate::results::{Results, WearMeans};

/// Fewest points of a curve.
const FEWEST: usize = 2;

/// The curve of the results.
pub fn of_results(results: &Results) -> Option<Figure> {
    wear(&results.wear.as_ref()?.curve)
}

/// Means over blocks of cycles against the number of the last one. `None` before two blocks.
pub fn wear(curve: &[WearMeans]) -> Option<Figure> {
    let (first, last) = (curve.first()?.last as f64, curve.last()?.last as f64);
    if curve.len() < FEWEST {
        return None;
    }
    let cycles = || Axis::log("cycles", "", [first, last]).linked("wear-cycles");
    let known = curve.iter().any(|one| one.friction_coefficient.is_some());
    let stiffness = panel(
        Panel::new(cycles(), Axis::linear("stiffness", "N/µm", [0.0, 1.0])).titled("stiffness"),
        curve,
        [
            ("k_T", "k_t_n_per_m", 1.0 / MICRO, |one| one.k_t_n_per_m.map(micro)),
            ("tangent without slip", "tangent_n_per_m", 1.0 / MICRO, |one| one.tangent_n_per_m.map(micro)),
        ],
    );
    let friction: [Curve; 1] = if known {
        [("", "friction_coefficient", 1.0, |one| one.friction_coefficient)]
    } else {
        [("", "friction_n", 1.0, |one| one.friction_n)]
    };
    let axis = if known { ("µ", "") } else { ("µN", "N") };
    let friction = panel(
        Panel::new(cycles(), Axis::linear(axis.0, axis.1, [0.0, 1.0])).titled("friction"),
        curve,
        friction,
    );
    let energy = panel(
        Panel::new(cycles(), Axis::linear("energy dissipated so far", "J", [0.0, 1.0])).titled("energy"),
        curve,
        [("", "energy_to_j", 1.0, |one| Some(one.energy_to_j))],
    );
    let panels = [stiffness, friction, energy].into_iter().flatten();
    let figure = Figure::new(
        "wear",
        "",
        "The wear run along its cycles",
        "Means over the cycles of a second, uncorrected. k_T where the contact slips, otherwise the tangent after the reversals.",
    );
    Some(panels.fold(figure.across(3), Figure::with))
}

/// Name, field of the curve's points, factor, and the value times the factor.
type Curve = (&'static str, &'static str, f64, fn(&WearMeans) -> Option<f64>);

/// The panel with these curves, its vertical axis from zero; none without values.
fn panel<const N: usize>(mut panel: Panel, all: &[WearMeans], curves: [Curve; N]) -> Option<Panel> {
    let mut highest = 0.0_f64;
    for (i, (name, field, factor, of)) in curves.into_iter().enumerate() {
        let points: Vec<(f64, f64)> =
            all.iter().filter_map(|one| Some((one.last as f64, of(one)?))).collect();
        if points.len() < FEWEST {
            continue;
        }
        highest = points.iter().map(|(_, y)| *y).fold(highest, f64::max);
        let along = Along::of(&points.iter().map(|(x, _)| *x).collect::<Vec<_>>());
        panel = panel.with(
            Mark::line(Role::group(i), along, points.iter().map(|(_, y)| *y))
                .named(name)
                .from("x", "/wear/curve/*/last", 1.0)
                .from("y", format!("/wear/curve/*/{field}"), factor),
        );
    }
    panel.y.range = [0.0, 1.08 * highest];
    (!panel.marks.is_empty()).then_some(panel)
}

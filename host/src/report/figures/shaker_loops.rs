//! Loops of the shaker, T over Δx, and both specimens over the same cycle (the paper's Fig. 6),
//! with the same axes.

use super::MICRO;
use crate::report::figure::{Along, Axis, Figure, Height, Mark, Panel, Role};
use crate::report::scale::middle_range;
use crate::report::words;
use crate::report::words::number::{decimals, micro, short};
use crate::results::{Results, ShakerLoop, Shape};

/// The frequencies of the paper, Hz; the nearest ones are shown.
const SHOWN_HZ: [f64; 3] = [100.0, 200.0, 250.0];

/// Three loops with their time signals.
pub fn shaker_loops(results: &Results) -> Option<Figure> {
    let all = &results.shaker_loops;
    let mut picked: Vec<usize> = SHOWN_HZ
        .iter()
        .filter_map(|f| {
            let off = |i: &usize| (all[*i].frequency_hz / f).ln().abs();
            (0..all.len()).min_by(|a, b| off(a).total_cmp(&off(b)))
        })
        .collect();
    picked.dedup();
    let shown: Vec<&ShakerLoop> = picked.iter().map(|i| &all[*i]).collect();
    let x = middle_range(shown.iter().flat_map(|s| &s.displacement_m).map(|v| v * MICRO), 1.0, 0.08)?;
    let t = middle_range(shown.iter().flat_map(|s| &s.force_n).copied(), 1.0, 0.08)?;
    let motions =
        |s: &&ShakerLoop| [s.displacement_a_m.clone(), s.displacement_b_m.clone(), s.displacement_m.clone()];
    let motion = middle_range(shown.iter().flat_map(motions).flatten().map(|v| v * MICRO), 1.0, 0.08)?;
    let mut figure = Figure::new(
        "shaker-loops",
        "6",
        "Loops of the shaker",
        "Averaged over the record's cycles, on the same scales, and both specimens over one cycle. Near a resonance of one specimen, Δx goes out of \
         phase with T, and the line opens into an ellipse.",
    )
    .across(picked.len());
    for (i, one) in picked.iter().zip(&shown) {
        figure = figure.with(closed_loop(*i, one, x, t));
    }
    for (i, one) in picked.iter().zip(&shown) {
        let panel = over_the_cycle(*i, one, motion);
        figure = figure.with(if Some(i) == picked.first() { panel } else { panel.named_above() });
    }
    for (i, one) in picked.iter().zip(&shown) {
        let y = Axis::linear("force T", "N", t);
        let line = Mark::line(Role::Force, share(one.force_n.len()), one.force_n.iter().copied()).from(
            "y",
            format!("/shaker_loops/{i}/force_n/*"),
            1.0,
        );
        figure = figure.with(Panel::new(cycle(), y).high(Height::Low).with(line));
    }
    Some(figure)
}

fn cycle() -> Axis {
    Axis::linear("part of the cycle", "", [0.0, 1.0]).linked("cycle")
}

fn share(count: usize) -> Along {
    Along::Regular { first: 0.0, step: 1.0 / count.max(1) as f64, count }
}

fn closed_loop(index: usize, shown: &ShakerLoop, x: [f64; 2], t: [f64; 2]) -> Panel {
    let closed = |values: &[f64], scale: f64| -> Vec<f64> {
        values.iter().chain(values.first()).map(|v| v * scale).collect()
    };
    let slope = micro(shown.slope_n_per_m);
    let name = if shown.shape == Shape::Stuck { "slope" } else { "k_eq" };
    Panel::new(Axis::linear("Δx", "µm", x), Axis::linear("force T", "N", t))
        .titled(format!("{} Hz: {}", short(shown.frequency_hz), words::shape_name(shown.shape)))
        .high(Height::Square)
        .with(
            Mark::looped(Role::Force, closed(&shown.displacement_m, MICRO), closed(&shown.force_n, 1.0))
                .from("x", format!("/shaker_loops/{index}/displacement_m/*"), MICRO)
                .from("y", format!("/shaker_loops/{index}/force_n/*"), 1.0),
        )
        .with(
            Mark::line(Role::Fitted, Along::of(&x), x.map(|at| slope * at))
                .named(format!("{name} {} N/µm", decimals(slope, 0))),
        )
}

fn over_the_cycle(index: usize, shown: &ShakerLoop, range: [f64; 2]) -> Panel {
    let lines = [
        (&shown.displacement_a_m, Role::SpecimenA, "x_A", "displacement_a_m"),
        (&shown.displacement_b_m, Role::SpecimenB, "x_B", "displacement_b_m"),
        (&shown.displacement_m, Role::Relative, "Δx", "displacement_m"),
    ]
    .map(|(values, role, name, field)| {
        Mark::line(role, share(values.len()), values.iter().map(|v| v * MICRO)).named(name).from(
            "y",
            format!("/shaker_loops/{index}/{field}/*"),
            MICRO,
        )
    });
    Panel::new(cycle(), Axis::linear("displacement", "µm", range)).high(Height::Low).with_all(lines)
}

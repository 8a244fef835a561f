//! One loop with its parts marked, and its time signals (the paper's Fig. 3).

use super::MICRO;
use crate::report::figure::{Along, Axis, Figure, Height, Mark, Panel, Role, Shape as Drawn};
use crate::report::scale::middle_range;
use crate::report::words;
use crate::report::words::number::{micro, short};
use crate::results::{Results, ShakerLoop, Shape};

/// The most informative loop: one that slips if there is any, otherwise the widest.
pub fn loop_parts(results: &Results) -> Option<Figure> {
    let (index, shown) = results.shaker_loops.iter().enumerate().max_by(|(_, a), (_, b)| {
        let swing = |l: &ShakerLoop| l.displacement_m.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        (slips(a), swing(a)).partial_cmp(&(slips(b), swing(b))).unwrap_or(std::cmp::Ordering::Equal)
    })?;
    let micrometres = |values: &[f64]| values.iter().map(|v| v * MICRO).collect::<Vec<f64>>();
    let (x, t) = (micrometres(&shown.displacement_m), &shown.force_n);
    let horizontal = middle_range(x.iter().copied(), 1.0, 0.12)?;
    let vertical = middle_range(t.iter().copied(), 1.0, 0.12)?;
    let at = |pick: &dyn Fn(f64, f64) -> bool| {
        (0..x.len().min(t.len())).reduce(|a, b| if pick(x[b], x[a]) { b } else { a })
    };
    let (right, left) = (at(&|b, a| b > a)?, at(&|b, a| b < a)?);
    let slope = micro(shown.slope_n_per_m);
    let closed = |values: &[f64]| -> Vec<f64> { values.iter().chain(values.first()).copied().collect() };
    let ring =
        |i: usize, text: &str| Mark::new(Role::Guide, Drawn::Ring { at: [x[i], t[i]], text: text.into() });
    let parts = Panel::new(Axis::linear("Δx", "µm", horizontal), Axis::linear("force T", "N", vertical))
        .high(Height::Square)
        .with(
            Mark::looped(Role::Force, closed(&x), closed(t))
                .named("the loop: its area is the energy of a cycle")
                .from("x", format!("/shaker_loops/{index}/displacement_m/*"), MICRO)
                .from("y", format!("/shaker_loops/{index}/force_n/*"), 1.0),
        )
        .with(
            Mark::line(Role::Fitted, Along::of(&horizontal), horizontal.map(|v| slope * v))
                .named(format!("slope over the whole loop, {} N/µm", short(slope))),
        )
        .with(ring(right, "tip"))
        .with(ring(left, "tip"));
    let share = || Along::Regular { first: 0.0, step: 1.0 / x.len().max(1) as f64, count: x.len() };
    let cycle = || Axis::linear("part of the cycle", "", [0.0, 1.0]).linked("cycle");
    Some(
        Figure::new(
            "loop-parts",
            "3",
            "A loop and its parts",
            format!("{} Hz, {}: after each tip the contact sticks first, along its own slope; where it slips, the force stays behind.", short(shown.frequency_hz), words::shape_name(shown.shape)),
        )
        .across(3)
        .with(parts)
        .with(
            Panel::new(cycle(), Axis::linear("Δx", "µm", horizontal))
                .with(Mark::line(Role::Relative, share(), x.iter().copied()).named("Δx").from("y", format!("/shaker_loops/{index}/displacement_m/*"), MICRO)),
        )
        .with(
            Panel::new(cycle(), Axis::linear("force T", "N", vertical))
                .with(Mark::line(Role::Force, share(), t.iter().copied()).named("T").from("y", format!("/shaker_loops/{index}/force_n/*"), 1.0)),
        ),
    )
}

fn slips(one: &ShakerLoop) -> bool {
    matches!(one.shape, Shape::Microslip | Shape::GrossSlip)
}

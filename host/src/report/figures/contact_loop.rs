//! One impact at the contact: the time signals and the loop of the first cycle with its slope (the
//! paper's Fig. 7).

use super::MICRO;
use crate::report::figure::{Along, Axis, Figure, Height, Mark, Panel, Role};
use crate::report::scale::middle_range;
use crate::report::words::number::{decimals, micro};
use crate::results::{LoopCurve, Results};

/// Path of the time between samples.
const STEP: &str = "/example_loop/step_s";

/// Δx, x_A, x_B and T over time; T against Δx.
pub fn contact_loop(results: &Results) -> Option<Figure> {
    let curve = results.example_loop.as_ref()?;
    let figure = Figure::new(
        "contact-loop",
        "7",
        format!("One impact at the contact: record {}, hit at {}", curve.record, curve.impact),
        "Displacements of the specimens (integrated velocity) and the sum of the load cells. The slope of the first cycle holds every mode that the hit excites.",
    );
    Some(
        figure
            .across(3)
            .of_records(vec![[curve.record; 2]])
            .with(displacements(curve)?)
            .with(force(curve)?)
            .with(first_cycle(curve)?),
    )
}

fn cycle(curve: &LoopCurve) -> std::ops::Range<usize> {
    let end = curve.cycle[1].min(curve.force_n.len()).min(curve.displacement_m.len());
    curve.cycle[0].min(end)..end
}

fn time(curve: &LoopCurve) -> (Axis, Along) {
    let count = curve.force_n.len();
    let step = 1e3 * curve.step_s;
    (
        Axis::linear("time", "ms", [0.0, step * count as f64]).linked("impact-time"),
        Along::Regular { first: 0.0, step, count },
    )
}

fn shade(curve: &LoopCurve) -> Mark {
    let range = cycle(curve);
    let at = |i: usize| 1e3 * curve.step_s * i as f64;
    Mark::shade(Role::Band, [at(range.start), at(range.end)]).named("first cycle")
}

fn displacements(curve: &LoopCurve) -> Option<Panel> {
    let shown = [
        (&curve.displacement_a_m, Role::SpecimenA, "x_A", "displacement_a_m"),
        (&curve.displacement_b_m, Role::SpecimenB, "x_B", "displacement_b_m"),
        (&curve.displacement_m, Role::Relative, "Δx = x_A − x_B", "displacement_m"),
    ];
    let range = middle_range(shown.iter().flat_map(|(v, ..)| v.iter().map(|v| v * MICRO)), 1.0, 0.06)?;
    let (x, along) = time(curve);
    let lines = shown.into_iter().filter(|(v, ..)| !v.is_empty()).map(|(values, role, name, field)| {
        Mark::line(role, along.clone(), values.iter().map(|v| v * MICRO))
            .named(name)
            .from("y", format!("/example_loop/{field}/*"), MICRO)
            .from("step", STEP, 1e3)
    });
    Some(Panel::new(x, Axis::linear("displacement", "µm", range)).with(shade(curve)).with_all(lines))
}

fn force(curve: &LoopCurve) -> Option<Panel> {
    let range = middle_range(curve.force_n.iter().copied(), 1.0, 0.06)?;
    let (x, along) = time(curve);
    let line = Mark::line(Role::Force, along, curve.force_n.iter().copied())
        .named("T")
        .from("y", "/example_loop/force_n/*", 1.0)
        .from("step", STEP, 1e3);
    Some(Panel::new(x, Axis::linear("force T", "N", range)).with(shade(curve)).with(line))
}

fn first_cycle(curve: &LoopCurve) -> Option<Panel> {
    let range = cycle(curve);
    let x: Vec<f64> = curve.displacement_m[range.clone()].iter().map(|v| v * MICRO).collect();
    let t = &curve.force_n[range];
    let horizontal = middle_range(x.iter().copied(), 1.0, 0.08)?;
    let vertical = middle_range(t.iter().copied(), 1.0, 0.08)?;
    let centre = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let (x0, t0) = (centre(&x), centre(t));
    let slope = micro(curve.slope_n_per_m);
    let line = horizontal.map(|at| t0 + slope * (at - x0));
    Some(
        Panel::new(Axis::linear("Δx", "µm", horizontal), Axis::linear("force T", "N", vertical))
            .titled("Loop of the first cycle")
            .with(
                Mark::looped(Role::Force, x, t.iter().copied())
                    .named("T against Δx")
                    .from("x", "/example_loop/displacement_m/*", MICRO)
                    .from("y", "/example_loop/force_n/*", 1.0),
            )
            .with(
                Mark::line(Role::Fitted, Along::of(&horizontal), line)
                    .named(format!("fitted slope {} N/µm", decimals(slope, 0))),
            )
            .high(Height::Usual),
    )
}

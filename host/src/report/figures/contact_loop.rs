//! Figures of the contact's motion after one hit:
//!
//! - one impact at the contact: the time signals and the loop of the first cycle with its slope
//!   (the paper's Fig. 7)
//! - loops of the first, third and fourth cycle, on the same scales (the paper's Fig. 7)
//! - one loop with its parts marked, and its time signals (the paper's Fig. 3)
//! - the specimens' decay, and its reconstruction from two sinusoids (the paper's Fig. 9)

use super::MICRO;
use crate::report::figure::{Along, Axis, Figure, Height, Mark, Panel, Role, Shape as Drawn};
use crate::report::scale::middle_range;
use crate::report::words;
use crate::report::words::TURNED_DEG;
use crate::report::words::number::{decimals, micro, short};
use crate::results::{LoopCurve, Results, ShakerLoop, Shape};

/// Path of the time between samples.
const STEP: &str = "/example_loop/step_s";

/// Δx, x_A, x_B and T over time; T against Δx.
pub fn contact_loop(results: &Results) -> Option<Figure> {
    let curve = results.example_loop.as_ref()?;
    let figure = Figure::new(
        "contact-loop",
        "7",
        format!("One impact at the contact: record {}, hit at {}", curve.record, curve.impact),
        "Displacements of the specimens (integrated velocity) and the sum of the load cells. The slope of the first cycle contains every mode that the hit excites.",
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

/// The cycles that the paper shows.
const SHOWN: [usize; 3] = [1, 3, 4];

/// One panel for each cycle that the record has.
pub fn decay_loops(results: &Results) -> Option<Figure> {
    let curve = results.example_loop.as_ref()?;
    let whole = curve.displacement_m.len().min(curve.force_n.len());
    let cycles: Vec<(usize, [usize; 2])> = SHOWN
        .into_iter()
        .filter_map(|n| Some((n, *curve.cycles.get(n - 1)?)))
        .filter(|(_, [from, to])| from < to && *to <= whole)
        .collect();
    let most = |values: &[f64]| {
        let all = cycles.iter().flat_map(|(_, [from, to])| &values[*from..*to]);
        middle_range(all.copied(), 1.0, 0.06)
    };
    if cycles.len() < 2 {
        return None;
    }
    let (x, y) = (most(&curve.displacement_m)?.map(|v| v * MICRO), most(&curve.force_n)?);
    let steps = results.impact_loops().map_or(&[][..], |loops| &loops.decay);
    let turns =
        steps.is_empty() || steps.iter().any(|s| SHOWN.contains(&s.cycle) && s.phase_deg.abs() > TURNED_DEG);
    let mut figure = Figure::new(
        "decay-loops",
        "7",
        "The first, third and fourth cycle after one hit",
        if turns {
            "The loop rotates and opens from cycle to cycle, because the modes that the hit excites decay at different rates: only the first cycle is \
             close to the contact's own line."
        } else {
            "The first cycle contains every mode that the hit excites. After the fast-decaying modes are gone, the loops are straight lines: no \
             resonance of one specimen shifts their phase."
        },
    )
    .across(3)
    .of_records(vec![[curve.record; 2]]);
    for (n, [from, to]) in cycles {
        let line = Mark::looped(
            Role::Force,
            curve.displacement_m[from..to].iter().map(|v| v * MICRO),
            curve.force_n[from..to].iter().copied(),
        )
        .from("x", "/example_loop/displacement_m/*", MICRO)
        .from("y", "/example_loop/force_n/*", 1.0);
        let panel =
            Panel::new(Axis::linear("Δx", "µm", x).linked("decay-x"), Axis::linear("force T", "N", y));
        figure = figure.with(panel.titled(format!("Cycle {n}")).high(Height::Square).with(line));
    }
    Some(figure)
}

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
            format!("{} Hz, {}: after each tip the contact sticks first, along its own slope; where it slips, the force falls below that line.", short(shown.frequency_hz), words::shape_name(shown.shape)),
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

/// Specimen A at the top, specimen B below.
pub fn rebuilt(results: &Results) -> Option<Figure> {
    let shown = results.reconstruction.as_ref()?;
    let (hidden, common) = (decimals(shown.hidden_hz, 0), decimals(shown.common_hz, 0));
    let rows = [
        (
            (&shown.displacement_a_m, "displacement_a_m"),
            (&shown.rebuilt_a_m, "rebuilt_a_m"),
            Role::SpecimenA,
            format!(
                "Specimen A: {hidden} and {common} Hz explain {} %, {common} Hz alone {} %",
                short(100.0 * shown.explained_a[0]),
                short(100.0 * shown.explained_a[1])
            ),
        ),
        (
            (&shown.displacement_b_m, "displacement_b_m"),
            (&shown.rebuilt_b_m, "rebuilt_b_m"),
            Role::SpecimenB,
            format!("Specimen B: {common} Hz alone explains {} %", short(100.0 * shown.explained_b)),
        ),
    ];
    let step = shown.step_s * 1e3;
    let mut figure = Figure::new(
        "rebuilt",
        "9",
        "The decay put together from two sinusoids",
        "Both specimens after one hit, and the sum of decaying sinusoids: the mode that all share and, for A, the hidden resonance as well.",
    )
    .of_records(vec![[shown.record; 2]]);
    for ((found, field), (again, again_field), role, title) in rows {
        let range = middle_range(found.iter().chain(again).map(|v| v * MICRO), 1.0, 0.08)?;
        let along = Along::Regular { first: 0.0, step, count: found.len() };
        let x = Axis::linear("time after the second cycle begins", "ms", [0.0, step * found.len() as f64]);
        let line = |role, values: &[f64], field: &str| {
            Mark::line(role, along.clone(), values.iter().map(|v| v * MICRO))
                .from("y", format!("/reconstruction/{field}/*"), MICRO)
                .from("step", "/reconstruction/step_s", 1e3)
        };
        figure = figure.with(
            Panel::new(x.linked("decay-time"), Axis::linear("displacement", "µm", range))
                .titled(title)
                .with(line(role, found, field).named("measured"))
                .with(line(Role::Guide, again, again_field).named("from sinusoids")),
        );
    }
    Some(figure)
}

//! Loops of the first, third and fourth cycle after one hit, on the same scales (the paper's Fig.
//! 7).

use super::MICRO;
use crate::report::figure::{Axis, Figure, Height, Mark, Panel, Role};
use crate::report::scale::middle_range;
use crate::report::words::TURNED_DEG;
use crate::results::Results;

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
            "The loop turns and opens from cycle to cycle, because the modes that the hit excites decay at different rates: only the first cycle lies near the contact's own line."
        } else {
            "The first cycle holds every mode that the hit excites. Those that die away fast leave straight lines behind: no resonance of one specimen turns them."
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

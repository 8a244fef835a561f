//! The hammer over the campaign: peak force of every hit, and the coil's pulse that produced it.

use crate::report::figure::{Axis, Figure, Height, Mark, Marker, Panel, Role};
use crate::report::scale::middle_range;
use crate::results::{HitRow, Results};

/// Force at the top, pulse below.
pub fn pulses(results: &Results) -> Option<Figure> {
    let hits = &results.hits;
    // overloads and hits that missed would stretch the axis: its range is that of the kept hits
    let kept = hits.iter().filter(|h| h.kept || hits.iter().all(|h| !h.kept)).map(|h| h.peak_n);
    let force = middle_range(kept, 1.0, 0.06)?;
    let pulse = middle_range(hits.iter().map(|h| f64::from(h.pulse_us)), 1.0, 0.1)?;
    let x = || {
        let (first, last) = (hits.first().map_or(0, |h| h.record), hits.last().map_or(1, |h| h.record));
        Axis::linear("record", "", [first as f64 - 1.0, last as f64 + 1.0]).linked("record")
    };
    let points = |kept: bool, of: fn(&HitRow) -> f64| {
        let own = hits.iter().filter(move |h| h.kept == kept && of(h) > 0.0);
        let (role, marker, name) = if kept {
            (Role::Group1, Marker::Dot, "kept")
        } else {
            (Role::Refused, Marker::Cross, "refused")
        };
        Mark::points(role, marker, own.clone().map(|h| [h.record as f64, of(h)])).named(name).from(
            "x",
            "/hits/*/record",
            1.0,
        )
    };
    let mut peak = Panel::new(x(), Axis::linear("peak force", "N", [0.0, 1.5 * force[1]]));
    let mut coil = Panel::new(x(), Axis::linear("coil's pulse", "µs", pulse)).high(Height::Low);
    for kept in [true, false] {
        if hits.iter().any(|h| h.kept == kept) {
            peak.marks.push(points(kept, |h| h.peak_n).from("y", "/hits/*/peak_n", 1.0));
            coil.marks.push(points(kept, |h| f64::from(h.pulse_us)).from("y", "/hits/*/pulse_us", 1.0));
        }
    }
    Some(
        Figure::new(
            "pulses",
            "",
            "The hammer over the campaign",
            "Peak force of every hit, and the duration of the coil's pulse by which the runner held it. Overloads lie beyond the frame.",
        )
        .with(peak)
        .with(coil),
    )
}

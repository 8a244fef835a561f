//! Means over two bands, with scatter and extremes (the paper's Fig. A.14).

use super::MICRO;
use crate::report::figure::{Axis, Figure, Height, Mark, Marker, Panel, Role};
use crate::report::words::number::{band, micro};
use crate::results::{MAIN_BAND, Results};
use crate::substructuring::Band;

/// One panel for each of two bands: the main one, and the next of the results.
pub fn band_means(results: &Results) -> Option<Figure> {
    let spectrum = results.joint_spectrum.as_ref()?;
    let other = results.joint.iter().map(|j| j.band_hz).find(|b| *b != MAIN_BAND);
    let mut figure = Figure::new(
        "band-means",
        "A.14",
        "Means over two bands",
        "Mean of k_z by method: thick bars are ± σ over the lines, thin ones go from the smallest to the largest line. Arrows mark values beyond the frame.",
    )
    .across(2);
    for range in std::iter::once(MAIN_BAND).chain(other) {
        figure.panels.extend(panel(results, &spectrum.frequency_hz, range));
    }
    (!figure.panels.is_empty()).then_some(figure)
}

struct BandRow {
    name: String,
    idms: usize,
    mean: f64,
    std: f64,
    ends: [f64; 2],
    identified: bool,
    /// Its index among the joints, and that of its lines among the curves.
    places: [usize; 2],
}

fn panel(results: &Results, frequency_hz: &[f64], range: Band) -> Option<Panel> {
    let curves = &results.joint_spectrum.as_ref()?.curves;
    let rows: Vec<BandRow> = (results.joint.iter().enumerate().filter(|(_, j)| j.band_hz == range))
        .filter_map(|(index, joint)| {
            let k = joint.sliding_stiffness()?;
            let (line, curve) = (curves.iter().enumerate())
                .find(|(_, c)| c.method == joint.method && c.idms == joint.idms && c.dof == "z")?;
            let inside = || {
                let lines = frequency_hz.iter().zip(&curve.stiffness_n_per_m);
                lines.filter(|(f, _)| range.contains(**f)).filter_map(|(_, k)| k.map(micro))
            };
            Some(BandRow {
                name: format!("{} {}", joint.method, joint.idms),
                idms: joint.idms,
                mean: micro(k.mean),
                std: micro(k.std),
                ends: [inside().reduce(f64::min)?, inside().reduce(f64::max)?],
                identified: joint.identified(),
                places: [index, line],
            })
        })
        .collect();
    let setting = || rows.iter().filter(|r| r.identified || rows.iter().all(|r| !r.identified));
    let high = setting().map(|r| r.mean + r.std).reduce(f64::max)?;
    let low = setting().map(|r| r.mean - r.std).fold(0.0, f64::min);
    let names = rows.iter().map(|r| r.name.clone()).collect();
    let x = Axis::linear("k_z", "N/µm", [1.15 * low - 0.1 * high, 1.4 * high]);
    let mut panel =
        Panel::new(x, Axis::named("method and IDMs", names)).titled(band(range)).high(Height::Tall);
    for (i, row) in rows.iter().enumerate() {
        let role = if row.identified { Role::modes(row.idms) } else { Role::Refused };
        let at = |marker| Mark::points(role, marker, [[row.mean, i as f64]]);
        let marker = if row.identified { Marker::Dot } else { Marker::Cross };
        let mean = format!("/joint/{}/stiffness_n_per_m/z/mean", row.places[0]);
        let lines = format!("/joint_spectrum/curves/{}/stiffness_n_per_m/*", row.places[1]);
        panel.marks.push(
            Mark::points(Role::Noise, Marker::Stroke, [[row.mean, i as f64]])
                .barred("x", [row.ends])
                .from("x", mean.clone(), 1.0 / MICRO)
                .from("low", lines.clone(), 1.0 / MICRO)
                .from("high", lines, 1.0 / MICRO),
        );
        panel.marks.push(
            at(marker)
                .barred("x", [[row.mean - row.std, row.mean + row.std]])
                .saying(vec![format!(
                    "{}: {:.1} ± {:.1} N/µm, {:.1} to {:.1}",
                    row.name, row.mean, row.std, row.ends[0], row.ends[1]
                )])
                .scatter("x", &mean, 1.0 / MICRO),
        );
    }
    Some(panel)
}

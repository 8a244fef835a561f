//! All stiffness values in the sliding direction on one axis, by method.

use super::{MICRO, below_name};
use crate::report::figure::{Axis, Figure, Height, Mark, Marker, Panel, Role};
use crate::report::words::number::{micro, stiffness};
use crate::results::{DIRECT, Joint, MAIN_BAND, Results};
use crate::substructuring::Dof;

struct ComparedRow {
    label: String,
    mean: f64,
    std: f64,
    median: Option<f64>,
    role: Role,
    believed: bool,
    path: String,
    median_path: String,
}

/// Mean and scatter of k_z over the main band, by method: of the methods that identified it, or of
/// all if none did.
pub fn comparison(results: &Results) -> Option<Figure> {
    let mut rows: Vec<ComparedRow> = quoted(results).into_iter().collect();
    let of_band = |j: &Joint| j.band_hz == MAIN_BAND || j.method == DIRECT;
    rows.extend(results.joint.iter().enumerate().filter(|(_, j)| of_band(j)).filter_map(|(i, j)| row(i, j)));
    let all = rows.len();
    // methods that failed would only stretch the axis; they are listed in the table
    if rows.iter().any(|row| row.believed) {
        rows.retain(|row| row.believed);
    }
    if rows.is_empty() {
        return None;
    }
    let failed = all - rows.len();
    let high = rows.iter().map(|r| r.mean + r.std).fold(0.0, f64::max);
    let low = rows.iter().map(|r| r.mean).fold(0.0, f64::min);
    let range = [1.1 * low, 1.1 * high.max(-0.1 * low)];
    // many rows are split into two columns with the same axis
    let per_panel = if rows.len() > TALLEST { rows.len().div_ceil(2) } else { rows.len() };
    let panels = rows.chunks(per_panel).map(|rows| panel(rows, range));
    let say = format!(
        "Mean (point), scatter (bar) and median (stroke) of k_z over the lines of the main band, 300–600 Hz, of the methods that identified a stiffness. {}",
        if failed > 0 {
            format!("{failed} others did not; the table of methods gives the reasons.")
        } else {
            String::new()
        }
    );
    let mut figure = Figure::new("comparison", "", "Every method side by side", say).across(2);
    figure.panels.extend(panels);
    Some(figure)
}

/// With more rows than this, a single column is too long.
const TALLEST: usize = 10;

fn panel(rows: &[ComparedRow], range: [f64; 2]) -> Panel {
    let names = rows.iter().map(|r| r.label.clone()).collect();
    let x = Axis::linear("k_z", "N/µm", range).linked("every-method");
    let mut panel = Panel::new(x, Axis::named("", names)).high(Height::Rows);
    for (i, row) in rows.iter().enumerate() {
        let y = below_name(i);
        let marker = if row.believed { Marker::Dot } else { Marker::Cross };
        let role = if row.believed { row.role } else { Role::Refused };
        let within = row.mean.clamp(range[0], range[1]);
        if within == row.mean {
            panel.marks.push(
                Mark::points(role, marker, [[row.mean, y]])
                    .barred("x", [[row.mean - row.std, row.mean + row.std]])
                    .saying(vec![row.label.clone()])
                    .scatter("x", &row.path, 1.0 / MICRO),
            );
        }
        if let Some(median) = row.median.filter(|m| range[0] < *m && *m < range[1]) {
            panel.marks.push(Mark::points(role, Marker::Stroke, [[median, y]]).from(
                "x",
                row.median_path.clone(),
                1.0 / MICRO,
            ));
        }
    }
    panel
}

fn row(index: usize, joint: &Joint) -> Option<ComparedRow> {
    let k = joint.sliding_stiffness()?;
    let modes = if joint.idms == 0 { String::new() } else { format!(", {} IDMs", joint.idms) };
    Some(ComparedRow {
        label: format!("{}{modes}: {}", joint.method, stiffness(k.mean, k.std)),
        mean: micro(k.mean),
        std: micro(k.std),
        median: Some(micro(k.median)),
        role: if joint.method == DIRECT { Role::Loops } else { Role::modes(joint.idms) },
        believed: joint.identified(),
        path: format!("/joint/{index}/stiffness_n_per_m/z/mean"),
        median_path: format!("/joint/{index}/stiffness_n_per_m/z/median"),
    })
}

/// The estimate to quote, which is not a row of any method.
fn quoted(results: &Results) -> Option<ComparedRow> {
    let estimate = results.quoted()?;
    let z = estimate.joint.get(&Dof::Z).filter(|z| z.identified)?;
    Some(ComparedRow {
        label: format!("recommended, {} IDMs: {}", estimate.idms, stiffness(z.stiffness, z.std)),
        mean: micro(z.stiffness),
        std: micro(z.std),
        median: None,
        role: Role::BetweenArms,
        believed: true,
        path: "/recommended/*/joint/z/stiffness".into(),
        median_path: String::new(),
    })
}

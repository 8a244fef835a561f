//! All stiffness values of one sliding direction on one axis: what each measurement sees.

use super::super::drawing::{Anchor, Area, Drawing, Stroke};
use super::super::panel::{BLUE, FAINT, INK, Panel, VERMILION};
use super::super::scale::Scale;
use super::WIDTH;
use crate::report::words::number::{micro, stiffness};
use crate::report::words::side_by_side;
use crate::results::{MAIN_BAND, Results};
use crate::substructuring::Dof;

struct Row {
    label: String,
    mean: f64,
    std: f64,
    median: Option<f64>,
    colour: &'static str,
}

const ROW_HEIGHT: f64 = 25.0;

/// Mean and scatter of k_z over the main band, by method, beside the loops' slopes.
pub fn comparison(results: &Results) -> Option<String> {
    let rows = rows(results);
    if rows.is_empty() {
        return None;
    }
    // the scatter of a bad method may leave the frame; its mean may not
    let low = rows.iter().map(|r| r.mean).fold(0.0, f64::min);
    let high = rows.iter().map(|r| r.mean).fold(0.0, f64::max);
    let height = ROW_HEIGHT * rows.len() as f64 + 12.0;
    let area = Area { left: 300.0, top: 12.0, width: WIDTH - 300.0 - 150.0, height };
    let room = 0.12 * (high - low);
    let range = [if low < 0.0 { low - room } else { 0.0 }, high + room];
    let x = Scale::linear(range, [area.left, area.right()]);
    let y = Scale::linear([0.0, 1.0], [area.bottom(), area.top]);
    let panel = Panel { area, x, y };
    let mut drawing = Drawing::new("comparison", WIDTH, area.bottom() + 48.0);
    let ticks = x.ticks(8);
    panel.grid(&mut drawing, &ticks, &[]);
    for (i, row) in rows.iter().enumerate() {
        let at = area.top + 6.0 + ROW_HEIGHT * (i as f64 + 0.5);
        drawing.line([area.left, at], [area.right(), at], Stroke::new(FAINT, 1.0).dashed("2 3"));
        drawing.text([area.left - 12.0, at + 4.0], Anchor::End, "row", &row.label);
        let (from, to) = (x.place_within(row.mean - row.std), x.place_within(row.mean + row.std));
        drawing.line([from, at], [to, at], Stroke::new(row.colour, 2.0));
        for end in [from, to] {
            drawing.line([end, at - 4.0], [end, at + 4.0], Stroke::new(row.colour, 1.5));
        }
        drawing.dot([x.place_within(row.mean), at], 4.5, row.colour, false);
        if let Some(median) = row.median {
            let m = x.place_within(median);
            drawing.line([m, at - 7.0], [m, at + 7.0], Stroke::new(INK, 1.2));
        }
        let text = stiffness(row.mean * 1e6, row.std * 1e6);
        drawing.text([area.right() + 10.0, at + 4.0], Anchor::Start, "row", &text);
    }
    panel.axes(
        &mut drawing,
        (&ticks, Some("stiffness along z in N/µm (dot: mean, bar: ± σ, tick: median)")),
        (&[], None),
    );
    Some(drawing.finish("Stiffness along the sliding direction by every method, with scatter"))
}

fn rows(results: &Results) -> Vec<Row> {
    let joint = results.joint.iter().filter(|j| j.band_hz == MAIN_BAND).filter_map(|j| {
        let k = j.sliding_stiffness()?;
        Some(Row {
            label: format!("FBS {}, {} IDMs", j.method, j.idms),
            mean: micro(k.mean),
            std: micro(k.std),
            median: Some(micro(k.median)),
            colour: BLUE,
        })
    });
    // the kinds that are measured at the specimens; FBS stands above by every method
    let loops = side_by_side::kinds(results).into_iter().filter(|k| k.found.starts_with("k_")).map(|k| Row {
        label: k.found,
        mean: micro(k.mean_n_per_m),
        std: micro(k.std_n_per_m),
        median: None,
        colour: VERMILION,
    });
    quoted(results).into_iter().chain(joint).chain(loops).collect()
}

/// The estimate to quote, which is no method's row.
fn quoted(results: &Results) -> Option<Row> {
    let estimate = results.quoted()?;
    let z = estimate.joint.get(&Dof::Z).filter(|z| z.identified)?;
    Some(Row {
        label: format!("FBS recommended, {} IDMs", estimate.idms),
        mean: micro(z.stiffness),
        std: micro(z.std),
        median: None,
        colour: BLUE,
    })
}

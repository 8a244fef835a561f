//! Participation of rigid motions in the change caused by coupling (accompanies the paper's Fig.
//! B.15).

use crate::report::figure::{Axis, Figure, Mark, Packed, Panel, Role, Shape};
use crate::results::Results;

const MOTIONS: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// One row for each singular value, one column for each rigid motion.
pub fn participation(results: &Results) -> Option<Figure> {
    let modes = results.interface_modes.as_ref()?;
    let rows = &modes.participation[..modes.participation.len().min(6)];
    if rows.is_empty() {
        return None;
    }
    let says = rows.iter().enumerate().flat_map(|(i, parts)| {
        MOTIONS.iter().zip(parts).map(move |(motion, part)| {
            format!("singular value {}: {motion} takes {:.0} %", i + 1, 100.0 * part)
        })
    });
    let shape = Shape::Cells { values: Packed::of(rows.iter().flatten().copied()), says: says.collect() };
    let mark = Mark::new(Role::BetweenArms, shape).from("values", "/interface_modes/participation/*/*", 1.0);
    let names = (1..=rows.len()).map(|n| format!("value {n}")).collect();
    let motions = MOTIONS.map(str::to_owned).to_vec();
    Some(
        Figure::new(
            "participation",
            "B.15",
            "Which motions couple",
            "How much each rigid motion of the virtual points takes part in each singular value, mean over the main band: dark is all of it.",
        )
        .across(2)
        .with(Panel::new(Axis::named("motion", motions), Axis::named("", names)).with(mark)),
    )
}

//! Figures of how well rigid motions describe the measurement:
//!
//! - the fraction of the measurement that rigid motions of the virtual points reproduce, channel by
//!   channel and impact by impact
//! - the CMIF: singular values of the change caused by coupling, over frequency (the paper's Fig.
//!   B.15)
//! - the participation of rigid motions in that change (accompanies the paper's Fig. B.15)

use crate::report::figure::{Along, Axis, Figure, Height, Mark, Marker, Packed, Panel, Role, Shape, Spread};
use crate::results::{MAIN_BAND, Results, VirtualPoint};
use std::collections::BTreeMap;

/// Sensors on the left, impacts on the right, for the largest set of modes.
pub fn consistency(results: &Results) -> Option<Figure> {
    let most = results.virtual_points.iter().map(|p| p.idms).max()?;
    let shown: Vec<(usize, &VirtualPoint)> =
        results.virtual_points.iter().enumerate().filter(|(_, p)| p.idms == most).collect();
    let reciprocity: Vec<String> =
        shown.iter().map(|(_, p)| format!("{} alone {:.3}", p.substructure, p.reciprocity)).collect();
    let mut figure = Figure::new(
        "consistency",
        "",
        "Consistency of the virtual points",
        format!(
            "Part of the measured motion (left) and force (right) that the {most} modes describe: 1 for an interface that stays rigid. Reciprocity \
             (impact and response swapped): {}.",
            reciprocity.join(", ")
        ),
    )
    .across(2);
    for (field, of) in [
        ("sensors", (|p| &p.sensors) as fn(&VirtualPoint) -> &BTreeMap<String, f64>),
        ("impacts", |p| &p.impacts),
    ] {
        let names: Vec<String> = shown.iter().flat_map(|(_, p)| of(p).keys().cloned()).collect();
        let low = shown.iter().flat_map(|(_, p)| of(p).values()).copied().fold(1.0, f64::min);
        let mut panel = Panel::new(
            Axis::named(field, names),
            Axis::linear("consistency", "", [(low - 0.05).max(0.0), 1.02]),
        );
        let mut from = 0;
        for (i, point) in &shown {
            let values = of(point);
            let role = if point.substructure == "A" { Role::SpecimenA } else { Role::SpecimenB };
            let at = values.values().enumerate().map(|(n, v)| [(from + n) as f64, *v]);
            panel.marks.push(
                Mark::points(role, Marker::Dot, at)
                    .saying(values.iter().map(|(name, v)| format!("{name}: {v:.4}")).collect())
                    .named(format!("{} alone", point.substructure))
                    .from("y", format!("/virtual_points/{i}/{field}/*"), 1.0),
            );
            from += values.len();
        }
        figure.panels.push(panel);
    }
    Some(figure)
}

/// Values below this fraction of the largest one are rounding errors.
const FLOOR: f64 = 1e-8;

/// The largest singular values; the suggested number of modes is drawn with thicker lines.
pub fn interface_modes(results: &Results) -> Option<Figure> {
    let modes = results.interface_modes.as_ref()?;
    let frequencies = [*modes.frequency_hz.first()?, *modes.frequency_hz.last()?];
    let values = || modes.singular_values_m_per_n.iter().flatten().copied();
    let high = values().fold(0.0, f64::max);
    let low = values().filter(|v| *v > FLOOR * high).fold(high, f64::min);
    if low >= high || frequencies[0] >= frequencies[1] || frequencies[0] <= 0.0 {
        return None;
    }
    let along = Along::of(&modes.frequency_hz);
    let lines = modes.singular_values_m_per_n.iter().enumerate().map(|(i, curve)| {
        let strong = i < modes.suggested;
        Mark::line(if strong { Role::Group1 } else { Role::Noise }, along.clone(), curve.iter().copied())
            .named(if strong { format!("{} suggested", modes.suggested) } else { "the rest".into() })
            .from("y", format!("/interface_modes/singular_values_m_per_n/{i}/*"), 1.0)
            .from("x", "/interface_modes/frequency_hz/*", 1.0)
    });
    let panel = Panel::new(
        Axis::frequency(Spread::Log, frequencies),
        Axis::log("singular value", "m/N", [low, 1.3 * high]),
    );
    Some(
        Figure::new(
            "interface-modes",
            "B.15",
            format!("What coupling adds: {} modes suggested", modes.suggested),
            "Singular values of Y(AJB) − Y(A) − Y(B), the CMIF. The number of curves well above the rest is the number of motions that couple the parts.",
        )
        .with(panel.high(Height::Tall).with(Mark::shade(Role::Band, MAIN_BAND)).with_all(lines)),
    )
}

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
            format!("singular value {}: {motion} contributes {:.0} %", i + 1, 100.0 * part)
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
            "How much each rigid motion of the virtual points contributes to each singular value, mean over the main band: the darkest is 100 %.",
        )
        .across(2)
        .with(Panel::new(Axis::named("motion", motions), Axis::named("", names)).with(mark)),
    )
}

//! What methods, shapes, excitations and outcomes are called.

use super::number::{decimals, short};
use crate::hysteresis::static_arm::Basis;
use crate::results::{Excitation, Force, Hysteresis, Identified, OverCycles, Shape};

/// What the slope between the spots is called.
pub const BETWEEN_SPOTS: &str = "slope between the spots";

/// A loop whose Δx lags T by more is no line: the phase from which a steady loop is called an ellipse, °.
pub const TURNED_DEG: f64 = 10.0;

/// The slope that may be quoted for a loop, with its name: that of the stick part where it has one, k_eq otherwise.
pub fn slope(loops: &Hysteresis) -> Option<(&'static str, OverCycles)> {
    let between = loops.slope_between_spots_n_per_m.map(|k| (BETWEEN_SPOTS, k));
    let whole = loops.k_eq_n_per_m.map(|k| ("k_eq", k));
    loops.k_t_n_per_m.map(|k| ("k_T", k)).or(between).or(whole)
}

/// The method as a tribologist would call it.
pub fn method(name: &str) -> &str {
    match name {
        "internal" => "Eq. 3 in least squares",
        "internal-printed" => "Eq. 3 as printed",
        "interface" => "Eq. A.3",
        "primal-a" => "Eq. A.2, block of A",
        "primal-b" => "Eq. A.2, block of B",
        "inverse" => "Eq. A.1",
        "inverse-ba" => "Eq. A.1, the other block",
        "direct" => "stiffness between the laser spots",
        "internal-aa" => "Eq. 1 rearranged for A alone",
        "internal-ab" => "Eq. 1 rearranged for hits on B seen on A",
        "internal-bb" => "Eq. 1 rearranged for B alone",
        other => other,
    }
}

/// What the corrected force was corrected by, and how that is known.
pub fn static_arm(arm: &Identified) -> String {
    let basis = match arm.basis {
        Basis::Given => "as stated",
        Basis::Hits => "from hits on B alone",
        Basis::Levels => "from stuck loops at several frequencies",
    };
    format!(
        "With the force at the contact, F = {} T + {} kg x\u{308}_B ({basis}):",
        decimals(1.0 + arm.correction.parallel_path, 4),
        decimals(arm.correction.effective_mass_kg, 2)
    )
}

/// A loop's shape by its name in files.
pub fn shape_name(shape: Shape) -> &'static str {
    match shape {
        Shape::Stuck => "stuck",
        Shape::Elliptical => "elliptical",
        Shape::Microslip => "microslip",
        Shape::GrossSlip => "gross-slip",
    }
}

/// Which excitation and force a row of loops is about.
pub fn excitation(loops: &Hysteresis) -> String {
    let mut words = match (loops.kind, loops.frequency_hz) {
        (Excitation::Impact, _) => "impacts, first cycle".into(),
        (Excitation::Shaker, Some(f)) => format!("shaker, {} Hz", short(f)),
        (Excitation::Shaker, None) => "shaker".into(),
    };
    if let Some(moment) = loops.moment {
        words += ", ";
        words += moment;
    }
    if loops.force == Force::Corrected {
        words += ", corrected force";
    }
    words
}

/// A check's outcome in a word.
pub fn outcome(ok: Option<bool>) -> &'static str {
    match ok {
        Some(true) => "passed",
        Some(false) => "look here",
        None => "undecided",
    }
}

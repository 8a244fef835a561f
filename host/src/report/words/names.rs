//! Names of methods, shapes, excitations and outcomes.

use super::number::{decimals, short};
use crate::hysteresis::static_arm::CorrectionSource;
use crate::results::{Excitation, Force, Hysteresis, Identified, OverCycles, Shape};

/// Name of the slope between the measured points.
pub const BETWEEN_SPOTS: &str = "slope between the spots";

/// Phase between Δx and T from which a steady loop counts as an ellipse rather than a line, °.
pub const TURNED_DEG: f64 = 10.0;

/// The slope that may be quoted for a loop, with its name: that of the stick part if it has one,
/// otherwise k_eq.
pub fn slope(loops: &Hysteresis) -> Option<(&'static str, OverCycles)> {
    let between = loops.slope_between_spots_n_per_m.map(|k| (BETWEEN_SPOTS, k));
    let whole = loops.k_eq_n_per_m.map(|k| ("k_eq", k));
    loops.k_t_n_per_m.map(|k| ("k_T", k)).or(between).or(whole)
}

/// Name of the method for readers.
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

/// The parameters of the force correction, and how they were determined.
pub fn static_arm(arm: &Identified) -> String {
    let basis = match arm.basis {
        CorrectionSource::Given => "as stated",
        CorrectionSource::Hits => "from hits on B alone",
        CorrectionSource::Levels => "from stuck loops at several frequencies",
    };
    format!(
        "With the force at the contact, F = {} T + {} kg x\u{308}_B ({basis}):",
        decimals(1.0 + arm.correction.parallel_path, 4),
        decimals(arm.correction.effective_mass_kg, 2)
    )
}

/// Name of a loop's shape, from its name in files.
pub fn shape_name(shape: Shape) -> &'static str {
    match shape {
        Shape::Stuck => "stuck",
        Shape::Elliptical => "elliptical",
        Shape::Microslip => "microslip",
        Shape::GrossSlip => "gross-slip",
    }
}

/// Excitation and force of a row of loops.
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

/// A check's outcome in one or two words.
pub fn outcome(ok: Option<bool>) -> &'static str {
    match ok {
        Some(true) => "passed",
        Some(false) => "look here",
        None => "undecided",
    }
}

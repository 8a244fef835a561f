//! Checks of single values; the error names the field.

use super::{Bushing, RigidBody};
use crate::rig::error::RigError;

pub(super) fn body(field: &str, body: &RigidBody) -> Result<(), RigError> {
    positive(&format!("{field}.mass_kg"), body.mass_kg)?;
    finite(&format!("{field}.cg_m"), &body.cg_m)?;
    match (body.inertia_kg_m2, body.box_m) {
        (Some(_), Some(_)) => Err(bad(field, "has both box_m and inertia_kg_m2: give one of them")),
        (Some(inertia), None) => {
            inertia.iter().try_for_each(|value| positive(&format!("{field}.inertia_kg_m2"), *value))
        }
        (None, Some(edges)) => edges.iter().try_for_each(|value| positive(&format!("{field}.box_m"), *value)),
        (None, None) => Err(bad(field, "needs box_m or inertia_kg_m2 to have an inertia")),
    }
}

pub(super) fn bushing(field: &str, bushing: &Bushing) -> Result<(), RigError> {
    finite(&format!("{field}.position_m"), &bushing.position_m)?;
    let groups = [
        ("stiffness_n_per_m", &bushing.stiffness_n_per_m[..]),
        ("rotation_nm_per_rad", &bushing.rotation_nm_per_rad[..]),
        ("damping_s", &bushing.damping_s[..]),
    ];
    for (name, values) in groups {
        for value in values {
            not_negative(&format!("{field}.{name}"), *value)?;
        }
    }
    Ok(())
}

pub(super) fn axes(field: &str, axes: Option<[[f64; 3]; 3]>) -> Result<(), RigError> {
    let Some([x, y, z]) = axes else { return Ok(()) };
    let dot = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let off = [dot(x, x) - 1.0, dot(y, y) - 1.0, dot(z, z) - 1.0, dot(x, y), dot(y, z), dot(z, x)];
    // users write about four digits
    if off.iter().all(|off| off.abs() < 1e-3) {
        return Ok(());
    }
    Err(bad(
        field,
        "must be three unit vectors at right angles: x, y and z of this spring in the rig's coordinates",
    ))
}

pub(super) fn bad(field: &str, reason: &str) -> RigError {
    RigError::Field { field: field.to_owned(), reason: reason.to_owned(), line: None }
}

pub(super) fn finite(field: &str, values: &[f64]) -> Result<(), RigError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(bad(field, &format!("must be finite, not {value}"))),
        None => Ok(()),
    }
}

pub(super) fn positive(field: &str, value: f64) -> Result<(), RigError> {
    finite(field, &[value])?;
    if value > 0.0 { Ok(()) } else { Err(bad(field, &format!("must be greater than zero, not {value}"))) }
}

pub(super) fn not_negative(field: &str, value: f64) -> Result<(), RigError> {
    finite(field, &[value])?;
    if value >= 0.0 { Ok(()) } else { Err(bad(field, &format!("must not be negative, but is {value}"))) }
}

pub(super) fn fraction(field: &str, value: f64) -> Result<(), RigError> {
    not_negative(field, value)?;
    if value <= 1.0 { Ok(()) } else { Err(bad(field, &format!("must be between 0 and 1, not {value}"))) }
}

pub(super) fn range(field: &str, [low, high]: [f64; 2]) -> Result<(), RigError> {
    not_negative(field, low)?;
    not_negative(field, high)?;
    if low <= high { Ok(()) } else { Err(bad(field, &format!("must be [low, high], not [{low}, {high}]"))) }
}

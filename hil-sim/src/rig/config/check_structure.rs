//! Checks of a user-defined structure: unknown names, springs that join nothing.

use super::values::{axes, bad, body, bushing};
use super::{BodyName, OwnBody, OwnStructure, RigConfig, Side};
use crate::rig::error::RigError;

/// Checks a user-defined structure, and that every point is on one of its bodies.
pub(super) fn check_structure(config: &RigConfig, own: &OwnStructure) -> Result<(), RigError> {
    bodies_and_springs(own)?;
    points(config, own)
}

fn bodies_and_springs(own: &OwnStructure) -> Result<(), RigError> {
    for (index, it) in own.bodies.iter().enumerate() {
        let field = format!("structure.bodies[{index}]");
        if it.name.as_str() == "ground" {
            return Err(bad(
                &format!("{field}.name"),
                "is ground, the reserved name of the fixed end of a spring",
            ));
        }
        if own.bodies[..index].iter().any(|earlier| earlier.name == it.name) {
            return Err(bad(
                &format!("{field}.name"),
                &format!("{:?} is already a body; names must differ", it.name.as_str()),
            ));
        }
        body(&field, &it.rigid())?;
    }
    for (index, it) in own.springs.iter().enumerate() {
        let field = format!("structure.springs[{index}]");
        bushing(&field, &it.bushing())?;
        axes(&format!("{field}.axes"), it.axes)?;
        let ends = it.ends();
        for end in ends.into_iter().flatten() {
            known(own, &format!("{field}.between"), end)?;
        }
        if ends[0] == ends[1] {
            return Err(bad(
                &format!("{field}.between"),
                "has one body twice: name two, or `ground` and one",
            ));
        }
        if it.present.is_empty() {
            return Err(bad(&format!("{field}.in"), "is empty: name A, B or AJB, or leave it out for all"));
        }
    }
    for (field, pair) in [("structure.joint", own.joint), ("structure.arms", own.arms)] {
        for (name, side) in pair.into_iter().zip([Side::A, Side::B]) {
            if known(own, field, name)?.of != side {
                return Err(bad(
                    field,
                    &format!(
                        "has {name} for {side:?}, to which it does not belong: first A's body, then B's"
                    ),
                ));
            }
        }
    }
    if let Some(held) = own.load_cells_on {
        known(own, "structure.load_cells_on", held)?;
    }
    Ok(())
}

/// Checks that all measured or excited points are on existing bodies.
fn points(config: &RigConfig, own: &OwnStructure) -> Result<(), RigError> {
    for (index, point) in config.responses.iter().enumerate() {
        known(own, &format!("responses[{index}].body"), point.body)?;
    }
    for (index, point) in config.impacts.iter().enumerate() {
        known(own, &format!("impacts[{index}].body"), point.body)?;
    }
    known(own, "spots.ldv_a.body", config.spots.ldv_a.body)?;
    known(own, "spots.ldv_b.body", config.spots.ldv_b.body)?;
    known(own, "shaker.body", config.shaker.body)?;
    Ok(())
}

fn known<'o>(own: &'o OwnStructure, field: &str, name: BodyName) -> Result<&'o OwnBody, RigError> {
    own.body(name).ok_or_else(|| {
        let names: Vec<&str> = own.bodies.iter().map(|body| body.name.as_str()).collect();
        bad(field, &format!("names {name}, which is not a body of [structure]: {}", names.join(", ")))
    })
}

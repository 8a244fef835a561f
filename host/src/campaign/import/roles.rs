//! The role of a channel from its name: as the plan names its sensors, or as the rig and
//! `jointrig export` name theirs.

use jointrig_protocol::channel::{Axis, Quantity, Role};

use crate::campaign::plan::Plan;

/// Letters and digits of a name, in lower case: `LDV_A` and `ldv a` are the same channel.
fn letters(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// Whether both names are the same but for case, spaces and punctuation.
pub fn same_name(one: &str, other: &str) -> bool {
    letters(one) == letters(other)
}

/// The role of the channel called `name` in a hit measured at `response`; `None` if neither the
/// plan nor the usual names know it.
///
/// | name | role |
/// |---|---|
/// | `hammer`, `force`, `hammer_force` | the hammer's force |
/// | `x`, `y`, `z`, also `vib_x` …, its own axes (`A1:x`, `A1:1`, `A1`) | the location's response |
/// | `LDV_A`, `LDV_B`, also `specimen_a`, `velocity_a` … | the specimens |
/// | `LC1`, `load_cell_1` … | load cells |
/// | `excitation`, `stinger` | the shaker's force |
/// | a channel of a fixed sensor of the plan | recorded with that sensor |
///
/// A force cannot be a response and a motion no force: the quantity decides where a name could be
/// both.
pub fn role_of(plan: &Plan, response: &str, name: &str, quantity: Quantity) -> Option<Role> {
    let own = letters(name);
    let motion = matches!(quantity, Quantity::Velocity | Quantity::Acceleration | Quantity::Displacement);
    if plan.sensor_on(name).is_some() {
        return motion.then_some(Role::Auxiliary);
    }
    let location = letters(response);
    let of_location = own.strip_prefix(location.as_str());
    let bare = of_location.filter(|rest| !rest.is_empty()).unwrap_or(&own);
    let axis = ["vib", "ldv", "response"].iter().find_map(|word| bare.strip_prefix(word)).unwrap_or(bare);
    // `A1:1` is the first axis of `A1`, but `A11` is another place
    let apart = name.contains(|c: char| !c.is_alphanumeric());
    let number = of_location.filter(|rest| !location.is_empty() && (rest.is_empty() || apart));
    let numbered =
        |prefix: &str| own.strip_prefix(prefix).is_some_and(|rest| rest.chars().all(|c| c.is_ascii_digit()));
    match (quantity, own.as_str()) {
        (Quantity::Force, "hammer" | "force" | "hammerforce") => Some(Role::HammerForce),
        (Quantity::Force, "excitation" | "excitationforce" | "stinger") => Some(Role::Excitation),
        (Quantity::Force, _) if numbered("lc") || numbered("loadcell") => Some(Role::LoadCell),
        (_, "ldva" | "specimena" | "velocitya") if motion => Some(Role::SpecimenA),
        (_, "ldvb" | "specimenb" | "velocityb") if motion => Some(Role::SpecimenB),
        // a location with axes of its own numbers them, and one with a single axis has its name
        _ if motion => match (axis, number) {
            ("x", _) | (_, Some("" | "1")) => Some(Role::Response(Axis::X)),
            ("y", _) | (_, Some("2")) => Some(Role::Response(Axis::Y)),
            ("z", _) | (_, Some("3")) => Some(Role::Response(Axis::Z)),
            _ => None,
        },
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::plan::CONTACT;

    #[test]
    fn names_of_the_rig_and_of_exports_have_their_roles() {
        let plan = Plan::parse(CONTACT, "contact.toml").expect("a plan");
        let role = |name: &str, quantity| role_of(&plan, "C1", name, quantity);
        let (force, velocity) = (Quantity::Force, Quantity::Velocity);
        assert_eq!(role("hammer", force), Some(Role::HammerForce));
        assert_eq!(role("hammer", velocity), None);
        assert_eq!(role("C1:z", velocity), Some(Role::Response(Axis::Z)));
        assert_eq!(role("vib_x", velocity), Some(Role::Response(Axis::X)));
        assert_eq!(role("C1:2", velocity), Some(Role::Response(Axis::Y)));
        assert_eq!(role("c1", velocity), Some(Role::Response(Axis::X)));
        assert_eq!(role("C11", velocity), None);
        assert_eq!(role_of(&plan, "", "1", velocity), None);
        assert_eq!(role("LDV_A", velocity), Some(Role::SpecimenA));
        assert_eq!(role("ldv b", velocity), Some(Role::SpecimenB));
        assert_eq!(role("lc_3", force), Some(Role::LoadCell));
        assert_eq!(role("LC2", velocity), None);
        assert_eq!(role("stinger", force), Some(Role::Excitation));
        assert_eq!(role("thermo", Quantity::Voltage), None);
        assert!(same_name("LDV_A", "ldv a") && !same_name("LC1", "LC2"));
    }
}

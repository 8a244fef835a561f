//! From TOML text to a checked configuration: the text merges into the default, and the values of
//! the rig, its fixed vibrometers and a user-defined structure (unknown names, springs that join
//! nothing) are checked. Each error names the field, and its line in the text.

use super::{
    Beam, BodyName, Bushing, ContactLaw, DEFAULT_TOML, ImpactPoint, KnownMass, OpenJoint, OwnBody,
    OwnStructure, ResponsePoint, RigConfig, RigidBody, Side, Spring,
};
use crate::rig::channels::{CHANNELS, FORCE, channels};
use crate::rig::{Configuration, RigError};
use jointrig_protocol::channel::{NARROW_BITS, WIDE_BITS};
use jointrig_protocol::limits::MAX_CHANNELS;
use nalgebra::Vector3;
use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Maximum number of steps of a scan in slip.
const MOST_SLIP_STEPS: f64 = 1000.0;
/// Minimum stiffness of a contact, N/m: a smaller value was probably given in N/µm or N/mm.
const SOFTEST_N_PER_M: f64 = 1e4;
/// Largest stated distance (m) of a true position from the stated one.
const LARGEST_OFFSET_M: f64 = 0.05;
/// Largest tilt (rad).
const LARGEST_TILT_RAD: f64 = 0.5;
/// Minimum length of a beam over the largest edge of its section: shorter, its sections are not
/// plane.
const SHORTEST_BEAM: f64 = 0.25;
/// Maximum ratio of the edges of a beam's section.
const THICKEST_BEAM: f64 = 100.0;
/// Range of Young's modulus (Pa): from plastics to a thousand times steel, which is practically
/// rigid.
const SOFTEST_PA: f64 = 1e8;
const STIFFEST_PA: f64 = 1e15;
/// Bounds of the relative change of stiffness or friction coefficient by wear.
const LEAST_WEAR: f64 = -0.9;
const MOST_WEAR: f64 = 10.0;

/// Maximum number of elements of a beam.
const MOST_BEAM_ELEMENTS: u32 = 20;
/// Maximum number of elements of an Iwan contact: more would only cost time.
const MOST_ELEMENTS: u32 = 1000;

pub fn check(config: &RigConfig) -> Result<(), RigError> {
    if config.scan_rate_hz == 0 {
        return Err(bad("scan_rate_hz", "must be at least 1 Hz"));
    }
    let bodies = &config.bodies;
    body("bodies.mass", &bodies.mass)?;
    body("bodies.arm_a", &bodies.arm_a)?;
    body("bodies.specimen_a", &bodies.specimen_a)?;
    body("bodies.arm_b", &bodies.arm_b)?;
    body("bodies.specimen_b", &bodies.specimen_b)?;
    for (index, spring) in config.leaf_springs.iter().enumerate() {
        bushing(&format!("leaf_springs[{index}]"), spring)?;
    }
    bushing("knife_edge", &config.knife_edge)?;
    if let Some(mass) = &config.known_mass {
        known_mass(mass)?;
    }
    if let Some(open) = &config.open_joint {
        open_joint(config, open)?;
    }
    bushing("wire.bushing", &config.wire.bushing)?;
    bushing("push_rod_a.bushing", &config.push_rod_a.bushing)?;
    bushing("clamp.loaded", &config.clamp.loaded)?;
    bushing("clamp.free", &config.clamp.free)?;
    bushing("clamp_b.loaded", &config.clamp_b.loaded)?;
    bushing("clamp_b.free", &config.clamp_b.free)?;
    if !config.lumped()[1] && bodies.specimen_b.mass_kg >= bodies.arm_b.mass_kg {
        return Err(bad(
            "bodies.specimen_b.mass_kg",
            "must be less than arm B's, which is stated with its specimen",
        ));
    }
    if let Some(own) = &config.structure {
        check_structure(config, own)?;
    }
    contact(config)?;
    if config.load_cells.len() != 3 {
        return Err(bad("load_cells", &format!("must be three, not {}", config.load_cells.len())));
    }
    for (index, cell) in config.load_cells.iter().enumerate() {
        bushing(&format!("load_cells[{index}]"), cell)?;
    }
    bushing("lower_push_rod", &config.lower_push_rod)?;
    for (index, path) in config.paths.iter().enumerate() {
        let field = format!("paths[{index}]");
        spring(&field, path)?;
        let missing = |end: &BodyName| match &config.structure {
            Some(own) => own.body(*end).is_none(),
            None => matches!(end, BodyName::Own(_)),
        };
        if let Some(end) = path.ends().into_iter().flatten().find(missing) {
            return Err(bad(
                &format!("{field}.between"),
                &format!("names {end}, which the rig does not have"),
            ));
        }
    }
    points(config)?;
    hammer(config)?;
    sensors(config)?;
    let surroundings = &config.surroundings;
    finite("surroundings.temperature_c", &[surroundings.temperature_c])?;
    finite("surroundings.warming_k_per_s", &[surroundings.warming_k_per_s])?;
    errors(config)
}

fn errors(config: &RigConfig) -> Result<(), RigError> {
    let errors = &config.errors;
    for (field, value) in [
        ("errors.position_m", errors.position_m),
        ("errors.aim_m", errors.aim_m),
        ("errors.specimen_point_m", errors.specimen_point_m),
        ("errors.spot_m", errors.spot_m),
        ("errors.hammer_angle_rad", errors.hammer_angle_rad),
        ("errors.gain", errors.gain),
        ("errors.hammer_gain", errors.hammer_gain),
        ("errors.skew_s", errors.skew_s),
        ("errors.transverse", errors.transverse),
        ("errors.load_cell_cross_talk", errors.load_cell_cross_talk),
    ] {
        not_negative(field, value)?;
    }
    let mut channels: Vec<String> = channels(&config.sensors).map(|channel| channel.name).into();
    channels.extend(config.sensors.fixed.iter().map(|own| own.name.clone()));
    for (name, volts) in &errors.volts {
        if !channels.contains(name) {
            return Err(bad(&format!("errors.volts.{name}"), "is not a channel of the rig"));
        }
        if !volts.is_finite() || *volts == 0.0 {
            return Err(bad(&format!("errors.volts.{name}"), "must be a number, and not zero"));
        }
    }
    let points = || {
        let named = config.response_points().map(|point| &point.name);
        named.chain(config.impacts.iter().map(|point| &point.name))
    };
    for (name, offset_m) in &errors.offset_m {
        let field = format!("errors.offset_m.{name}");
        finite(&field, offset_m)?;
        if !["contact", "ldv_a", "ldv_b"].contains(&name.as_str()) && !points().any(|point| point == name) {
            return Err(bad(&field, "is not contact, ldv_a, ldv_b, or a response or impact point"));
        }
        if offset_m.iter().any(|offset| offset.abs() > LARGEST_OFFSET_M) {
            return Err(bad(
                &field,
                &format!("is more than {LARGEST_OFFSET_M} m: the unit is m, 2e-4 for 0.2 mm"),
            ));
        }
    }
    for (name, tilt) in &errors.tilt_rad {
        let field = format!("errors.tilt_rad.{name}");
        finite(&field, tilt)?;
        let known = ["ldv_a", "ldv_b", "vibrometer", "hammer"].contains(&name.as_str())
            || config.sensors.fixed.iter().any(|own| &own.name == name);
        if !known {
            return Err(bad(&field, "is not ldv_a, ldv_b, vibrometer, hammer or a fixed sensor"));
        }
        if tilt.iter().any(|angle| angle.abs() > LARGEST_TILT_RAD) {
            return Err(bad(
                &field,
                &format!("is more than {LARGEST_TILT_RAD} rad: the unit is rad, 0.035 for 2°"),
            ));
        }
    }
    if errors.skew_s * f64::from(config.scan_rate_hz) > 1e3 {
        return Err(bad("errors.skew_s", "is more than 1000 scans: give it in seconds"));
    }
    positive("errors.normal_load_reference_m", errors.normal_load_reference_m)?;
    finite("errors.normal_load_variation", &[errors.normal_load_variation])?;
    let contact = &config.contact;
    if contact.law != ContactLaw::Linear {
        // The limit must grow more slowly than the spring's force; otherwise a slipping element
        // could never stick again.
        let shares = contact.shares();
        let largest = shares.iter().copied().fold(0.0, f64::max) * shares.len() as f64;
        let [stiffness, friction] = contact.wear.map_or([1.0; 2], |wear| {
            [1.0 + wear.stiffness_change.min(0.0), 1.0 + wear.friction_change.max(0.0)]
        });
        let reach_m = contact.friction_coefficient * friction * contact.normal_load_n * largest
            / (contact.stiffness_n_per_m[2] * stiffness);
        if errors.normal_load_slope_per_m().abs() * reach_m >= 1.0 {
            return Err(bad(
                "errors.normal_load_variation",
                "makes the limit grow faster than the spring's force: lower it, or raise normal_load_reference_m",
            ));
        }
    }
    Ok(())
}

fn contact(config: &RigConfig) -> Result<(), RigError> {
    let contact = &config.contact;
    bushing("contact", &contact.bushing())?;
    axes("contact.axes", contact.axes)?;
    if let Some(soft) =
        contact.stiffness_n_per_m.iter().find(|k| (f64::MIN_POSITIVE..SOFTEST_N_PER_M).contains(*k))
    {
        let reason = format!(
            "is {soft} N/m, softer than any contact between solids: the unit is N/m, 180e6 for 180 N/µm"
        );
        return Err(bad("contact.stiffness_n_per_m", &reason));
    }
    not_negative("contact.friction_coefficient", contact.friction_coefficient)?;
    normal_load(contact.normal_load_n)?;
    positive("contact.slip_step_s", contact.slip_step_s)?;
    if 1.0 / f64::from(config.scan_rate_hz) / contact.slip_step_s > MOST_SLIP_STEPS {
        return Err(bad("contact.slip_step_s", "makes more than 1000 steps of a scan: 5e-6 is fine enough"));
    }
    if !(1..=MOST_ELEMENTS).contains(&contact.iwan.elements) {
        return Err(bad(
            "contact.iwan.elements",
            &format!("must be 1 to {MOST_ELEMENTS}, not {}", contact.iwan.elements),
        ));
    }
    fraction("contact.iwan.spread", contact.iwan.spread)?;
    for (index, patch) in contact.patches.iter().enumerate() {
        let field = |name: &str| format!("contact.patches[{index}].{name}");
        finite(&field("offset_m"), &patch.offset_m)?;
        if patch.offset_m.iter().any(|offset| offset.abs() > LARGEST_OFFSET_M) {
            return Err(bad(
                &field("offset_m"),
                &format!("is more than {LARGEST_OFFSET_M} m: the unit is m"),
            ));
        }
        positive(&field("share"), patch.share)?;
    }
    if !contact.patches.is_empty() {
        let sum: f64 = contact.patches.iter().map(|patch| patch.share).sum();
        if (sum - 1.0).abs() > 1e-9 {
            return Err(bad("contact.patches", &format!("have shares that sum to {sum}, not to 1")));
        }
        if contact.law != ContactLaw::Linear {
            return Err(bad(
                "contact.patches",
                "are not possible for a contact that can slip: its law must be linear",
            ));
        }
    }
    finite("contact.drift_per_hit", &[contact.drift_per_hit])?;
    finite("contact.drift_per_s", &[contact.drift_per_s])?;
    for (field, drift) in
        [("contact.drift_per_hit", contact.drift_per_hit), ("contact.drift_per_s", contact.drift_per_s)]
    {
        if drift.abs() > 0.1 {
            return Err(bad(
                field,
                &format!("is {drift}: more than 0.1, that is 10 %, for each hit or second"),
            ));
        }
    }
    if let Some(wear) = &contact.wear {
        if contact.law == ContactLaw::Linear {
            return Err(bad(
                "contact.wear",
                "needs a contact that can slip: with the linear law nothing is dissipated by friction",
            ));
        }
        positive("contact.wear.stiffness_energy_j", wear.stiffness_energy_j)?;
        positive("contact.wear.friction_energy_j", wear.friction_energy_j)?;
        for (field, change) in [
            ("contact.wear.stiffness_change", wear.stiffness_change),
            ("contact.wear.friction_change", wear.friction_change),
        ] {
            if !(LEAST_WEAR..=MOST_WEAR).contains(&change) {
                return Err(bad(
                    field,
                    &format!(
                        "is {change}: it must be {LEAST_WEAR} to {MOST_WEAR}, the change relative to the unworn contact"
                    ),
                ));
            }
        }
    }
    if contact.law != ContactLaw::Linear && contact.stiffness_n_per_m[2] <= 0.0 {
        return Err(bad(
            "contact.stiffness_n_per_m",
            "needs kz greater than zero for a contact that can slip",
        ));
    }
    Ok(())
}

/// Checks the energy (J) that a contact's friction has dissipated.
pub fn worn(worn_j: f64) -> Result<(), RigError> {
    not_negative("contact.worn_j", worn_j)
}

/// Checks a normal load (N).
pub fn normal_load(normal_load_n: f64) -> Result<(), RigError> {
    not_negative("contact.normal_load_n", normal_load_n)
}

fn known_mass(mass: &KnownMass) -> Result<(), RigError> {
    body("known_mass.body", &mass.body)?;
    bushing("known_mass.foam", &mass.foam)?;
    struck_and_seen("known_mass", &mass.impact, &mass.response)?;
    for (field, body) in [("impact", mass.impact.body), ("response", mass.response.body)] {
        if body != BodyName::KnownMass {
            return Err(bad(&format!("known_mass.{field}.body"), "must be \"known_mass\""));
        }
    }
    Ok(())
}

fn open_joint(config: &RigConfig, open: &OpenJoint) -> Result<(), RigError> {
    struck_and_seen("open_joint", &open.impact, &open.response)?;
    for (field, body) in [("impact", open.impact.body), ("response", open.response.body)] {
        if !config.has(Configuration::A, body) {
            return Err(bad(&format!("open_joint.{field}.body"), "must be on side A"));
        }
    }
    let named = |name: &str| config.impacts.iter().any(|own| own.name == name);
    if named(&open.impact.name) {
        return Err(bad("open_joint.impact.name", "is the name of one of the impacts"));
    }
    if config.response_points().any(|own| own.name == open.response.name) {
        return Err(bad("open_joint.response.name", "is the name of one of the responses"));
    }
    Ok(())
}

fn struck_and_seen(table: &str, impact: &ImpactPoint, response: &ResponsePoint) -> Result<(), RigError> {
    finite(&format!("{table}.impact.position_m"), &impact.position_m)?;
    finite(&format!("{table}.response.position_m"), &response.position_m)?;
    finite(&format!("{table}.impact.direction"), &impact.direction)?;
    if impact.direction.iter().all(|d| *d == 0.0) {
        return Err(bad(
            &format!("{table}.impact.direction"),
            "must point somewhere: all three components are zero",
        ));
    }
    Ok(())
}

fn points(config: &RigConfig) -> Result<(), RigError> {
    if config.responses.is_empty() {
        return Err(bad("responses", "is empty: the vibrometer needs a point to aim at"));
    }
    if config.impacts.is_empty() {
        return Err(bad("impacts", "is empty: the hammer needs a point to hit"));
    }
    for (index, point) in config.responses.iter().enumerate() {
        finite(&format!("responses[{index}].position_m"), &point.position_m)?;
        if let Some(sigma_m) = point.sigma_m {
            not_negative(&format!("responses[{index}].sigma_m"), sigma_m)?;
        }
        if config.responses[..index].iter().any(|earlier| earlier.name == point.name) {
            return Err(bad(
                &format!("responses[{index}].name"),
                &format!("{:?} is already a response; names must differ", point.name),
            ));
        }
    }
    for (index, point) in config.impacts.iter().enumerate() {
        finite(&format!("impacts[{index}].position_m"), &point.position_m)?;
        let field = format!("impacts[{index}].direction");
        finite(&field, &point.direction)?;
        if point.direction.iter().all(|d| *d == 0.0) {
            return Err(bad(&field, "must point somewhere: all three components are zero"));
        }
        if config.impacts[..index].iter().any(|earlier| earlier.name == point.name) {
            return Err(bad(
                &format!("impacts[{index}].name"),
                &format!("{:?} is already an impact; names must differ", point.name),
            ));
        }
    }
    if let Some(mark) = &config.spots.mark {
        finite("spots.mark.position_m", &mark.position_m)?;
        not_negative("spots.mark.sigma_m", mark.sigma_m.unwrap_or_default())?;
    }
    finite("spots.ldv_a.position_m", &config.spots.ldv_a.position_m)?;
    finite("spots.ldv_b.position_m", &config.spots.ldv_b.position_m)?;
    finite("shaker.position_m", &config.shaker.position_m)?;
    finite("shaker.gain_n_per_v", &[config.shaker.gain_n_per_v])?;
    not_negative("shaker.limit_v", config.shaker.limit_v)
}

fn hammer(config: &RigConfig) -> Result<(), RigError> {
    let hammer = &config.hammer;
    positive("hammer.bolt_kg", hammer.bolt_kg)?;
    positive("hammer.tip_n_per_m", hammer.tip_n_per_m)?;
    positive("hammer.gap_m", hammer.gap_m)?;
    positive("hammer.spring_n_per_m", hammer.spring_n_per_m)?;
    not_negative("hammer.preload_n", hammer.preload_n)?;
    not_negative("hammer.coil_n", hammer.coil_n)?;
    fraction("hammer.restitution", hammer.restitution)?;
    fraction("hammer.warming", hammer.warming)?;
    positive("hammer.warming_attempts", hammer.warming_attempts)?;
    not_negative("hammer.speed_scatter", hammer.speed_scatter)?;
    not_negative("hammer.width_scatter", hammer.width_scatter)?;
    if let Some(hand) = &hammer.hand {
        positive("hammer.hand.every_s", hand.every_s)?;
        positive("hammer.hand.pulse_s", hand.pulse_s)?;
    }
    let mishaps = &hammer.mishaps;
    fraction("hammer.mishaps.double_hit", mishaps.double_hit)?;
    fraction("hammer.mishaps.weak", mishaps.weak)?;
    fraction("hammer.mishaps.overload", mishaps.overload)?;
    if mishaps.double_hit + mishaps.weak + mishaps.overload > 1.0 {
        return Err(bad(
            "hammer.mishaps",
            "at most one happens per attempt: the three chances must sum to at most 1",
        ));
    }
    range("hammer.mishaps.double_fraction", mishaps.double_fraction)?;
    range("hammer.mishaps.double_delay_s", mishaps.double_delay_s)?;
    range("hammer.mishaps.weak_fraction", mishaps.weak_fraction)?;
    range("hammer.mishaps.overload_factor", mishaps.overload_factor)
}

fn sensors(config: &RigConfig) -> Result<(), RigError> {
    check_fixed(config)?;
    let sensors = &config.sensors;
    let rate_hz = f64::from(config.scan_rate_hz);
    positive("sensors.range_v", sensors.range_v)?;
    if sensors.bits != 16 && !(NARROW_BITS + 1..=WIDE_BITS).contains(&sensors.bits) {
        let least = NARROW_BITS + 1;
        return Err(bad("sensors.bits", &format!("must be 16, or {least} to {WIDE_BITS}")));
    }
    let scales = [
        ("sensors.force", sensors.force.units_per_volt),
        ("sensors.vibrometer", sensors.vibrometer.units_per_volt),
        ("sensors.ldv_a", sensors.ldv_a.units_per_volt),
        ("sensors.ldv_b", sensors.ldv_b.units_per_volt),
        ("sensors.load_cells", sensors.load_cells.units_per_volt),
        ("sensors.excitation", sensors.excitation.units_per_volt),
    ];
    for (sensor, value) in scales {
        positive(&format!("{sensor}.units_per_volt"), value)?;
    }
    let noises = [
        ("sensors.force.noise_n", sensors.force.noise_n),
        ("sensors.force.ring_fraction", sensors.force.ring_fraction),
        ("sensors.vibrometer.floor", sensors.vibrometer.floor),
        ("sensors.vibrometer.speckle.floor_factor", sensors.vibrometer.speckle.floor_factor),
        ("sensors.vibrometer.speckle.dropouts_per_s", sensors.vibrometer.speckle.dropouts_per_s),
        ("sensors.vibrometer.speckle.dropout_floor_factor", sensors.vibrometer.speckle.dropout_floor_factor),
        ("sensors.ldv_a.floor", sensors.ldv_a.floor),
        ("sensors.ldv_b.floor", sensors.ldv_b.floor),
        ("sensors.load_cells.noise_n", sensors.load_cells.noise_n),
        ("sensors.excitation.noise_n", sensors.excitation.noise_n),
    ];
    for (field, value) in noises {
        not_negative(field, value)?;
    }
    positive("sensors.force.ring_hz", sensors.force.ring_hz)?;
    positive("sensors.force.ring_decay_s", sensors.force.ring_decay_s)?;
    positive("sensors.vibrometer.speckle.dropout_s", sensors.vibrometer.speckle.dropout_s)?;
    let delays = [
        ("sensors.force.delay_s", vec![sensors.force.delay_s]),
        ("sensors.vibrometer.delay_s", sensors.vibrometer.delay_s.to_vec()),
        ("sensors.ldv_a.delay_s", vec![sensors.ldv_a.delay_s]),
        ("sensors.ldv_b.delay_s", vec![sensors.ldv_b.delay_s]),
        ("sensors.load_cells.delay_s", sensors.load_cells.delay_s.to_vec()),
        ("sensors.excitation.delay_s", vec![sensors.excitation.delay_s]),
    ];
    for (field, values) in delays {
        for value in values {
            not_negative(field, value)?;
            if value * rate_hz > 1e4 {
                return Err(bad(field, "is more than 10000 scans: give the delay in seconds"));
            }
        }
    }
    let polarities = [
        ("sensors.force.polarity", vec![sensors.force.polarity]),
        ("sensors.vibrometer.polarity", sensors.vibrometer.polarity.to_vec()),
        ("sensors.ldv_a.polarity", vec![sensors.ldv_a.polarity]),
        ("sensors.ldv_b.polarity", vec![sensors.ldv_b.polarity]),
        ("sensors.load_cells.polarity", sensors.load_cells.polarity.to_vec()),
        ("sensors.excitation.polarity", vec![sensors.excitation.polarity]),
    ];
    for (field, values) in polarities {
        if values.iter().any(|sign| sign.abs() != 1) {
            return Err(bad(field, "must be 1 or -1"));
        }
    }
    Ok(())
}

/// Maximum length of a channel's name, bytes, as in the protocol.
const NAME_BYTES: usize = jointrig_protocol::limits::NAME_BYTES;

pub(super) fn check_fixed(config: &RigConfig) -> Result<(), RigError> {
    let fixed = &config.sensors.fixed;
    let mut taken: Vec<String> = channels(&config.sensors).map(|channel| channel.name).into();
    let left_out = &config.sensors.left_out;
    for (index, name) in left_out.iter().enumerate() {
        if name == &taken[FORCE] {
            return Err(bad("sensors.left_out", "the hammer's force is needed"));
        }
        if !taken.contains(name) || left_out[..index].contains(name) {
            return Err(bad(
                "sensors.left_out",
                &format!("`{name}` is not one of the ten channels, or is listed twice"),
            ));
        }
    }
    let most = MAX_CHANNELS - (CHANNELS - left_out.len());
    if fixed.len() > most {
        return Err(bad("sensors.fixed", &format!("are {}; a device has room for {most}", fixed.len())));
    }
    for (index, own) in fixed.iter().enumerate() {
        let field = |name: &str| format!("sensors.fixed[{index}].{name}");
        let name = &own.name;
        if name.is_empty() || name.len() > NAME_BYTES || !name.chars().all(|c| c.is_ascii_graphic()) {
            return Err(bad(&field("name"), &format!("must be 1 to {NAME_BYTES} letters, digits or signs")));
        }
        if taken.contains(name) {
            return Err(bad(&field("name"), &format!("`{name}` is another channel's name")));
        }
        taken.push(name.clone());
        if !config.response_points().any(|point| point.name == own.response) {
            return Err(bad(
                &field("response"),
                &format!("`{}` is not one of the rig's responses", own.response),
            ));
        }
        finite(&field("direction"), &own.direction)?;
        if own.direction.iter().all(|part| *part == 0.0) {
            return Err(bad(&field("direction"), "must point somewhere"));
        }
        positive(&field("units_per_volt"), own.units_per_volt)?;
        not_negative(&field("floor"), own.floor)?;
        not_negative(&field("mass_kg"), own.mass_kg)?;
        not_negative(&field("delay_s"), own.delay_s)?;
        if own.delay_s * f64::from(config.scan_rate_hz) > 1e4 {
            return Err(bad(&field("delay_s"), "is more than 10000 scans: give the delay in seconds"));
        }
        if own.polarity.abs() != 1 {
            return Err(bad(&field("polarity"), "must be 1 or -1"));
        }
    }
    Ok(())
}

pub(super) fn body(field: &str, body: &RigidBody) -> Result<(), RigError> {
    positive(&format!("{field}.mass_kg"), body.mass_kg)?;
    finite(&format!("{field}.cg_m"), &body.cg_m)?;
    if let Some(beam) = &body.beam {
        check_beam(&format!("{field}.beam"), beam)?;
    }
    match (body.inertia_kg_m2, body.box_m) {
        (Some(_), Some(_)) => Err(bad(field, "has both box_m and inertia_kg_m2: give one of them")),
        (Some(inertia), None) => {
            inertia.iter().try_for_each(|value| positive(&format!("{field}.inertia_kg_m2"), *value))
        }
        (None, Some(edges)) => edges.iter().try_for_each(|value| positive(&format!("{field}.box_m"), *value)),
        (None, None) => Err(bad(field, "needs box_m or inertia_kg_m2 to have an inertia")),
    }
}

fn check_beam(field: &str, beam: &Beam) -> Result<(), RigError> {
    let inner = |name: &str| format!("{field}.{name}");
    finite(&inner("from_m"), &beam.from_m)?;
    finite(&inner("to_m"), &beam.to_m)?;
    for edge in beam.section_m {
        positive(&inner("section_m"), edge)?;
    }
    let axis = Vector3::from(beam.to_m) - Vector3::from(beam.from_m);
    let (length, largest) = (axis.norm(), beam.section_m[0].max(beam.section_m[1]));
    if length < SHORTEST_BEAM * largest {
        let reason = format!(
            "is {length} m from from_m; a beam is at least {SHORTEST_BEAM} times its largest edge long ({largest} m)"
        );
        return Err(bad(&inner("to_m"), &reason));
    }
    if largest > THICKEST_BEAM * beam.section_m[0].min(beam.section_m[1]) {
        return Err(bad(
            &inner("section_m"),
            &format!("has edges that differ by more than a factor of {THICKEST_BEAM}: that is a plate"),
        ));
    }
    if let Some(edge) = beam.first_edge {
        finite(&inner("first_edge"), &edge)?;
        let edge = Vector3::from(edge);
        // NaN for a zero vector
        let sine = edge.cross(&axis).norm() / (edge.norm() * length);
        if sine.is_nan() || sine < 0.1 {
            return Err(bad(&inner("first_edge"), "must not point along the beam's axis"));
        }
    }
    finite(&inner("young_pa"), &[beam.young_pa])?;
    if !(SOFTEST_PA..=STIFFEST_PA).contains(&beam.young_pa) {
        let reason = format!(
            "must be {SOFTEST_PA:.0e} to {STIFFEST_PA:.0e}, not {:e}: the unit is Pa, 2.1e11 for steel",
            beam.young_pa
        );
        return Err(bad(&inner("young_pa"), &reason));
    }
    if !(0.0..0.5).contains(&beam.poisson) {
        return Err(bad(
            &inner("poisson"),
            &format!("must be at least 0 and less than 0.5, not {}", beam.poisson),
        ));
    }
    not_negative(&inner("damping_s"), beam.damping_s)?;
    if !(1..=MOST_BEAM_ELEMENTS).contains(&beam.elements) {
        return Err(bad(
            &inner("elements"),
            &format!("must be 1 to {MOST_BEAM_ELEMENTS}, not {}", beam.elements),
        ));
    }
    Ok(())
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

/// Checks a user-defined structure, and that every point is on one of its bodies.
pub(super) fn check_structure(config: &RigConfig, own: &OwnStructure) -> Result<(), RigError> {
    bodies_and_springs(own)?;
    points_exist(config, own)
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
        for end in it.ends().into_iter().flatten() {
            known(own, &format!("{field}.between"), end)?;
        }
        spring(&field, it)?;
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
    if let Some([from, to]) = own.load_cells_between {
        let field = "structure.load_cells_between";
        known(own, field, from)?;
        known(own, field, to)?;
        if from == to {
            return Err(bad(field, "has one body twice: name two"));
        }
        if own.load_cells_on.is_some() {
            return Err(bad(field, "and load_cells_on exclude each other: remove one of them"));
        }
    }
    Ok(())
}

fn spring(field: &str, spring: &Spring) -> Result<(), RigError> {
    bushing(field, &spring.bushing())?;
    axes(&format!("{field}.axes"), spring.axes)?;
    let ends = spring.ends();
    if ends[0] == ends[1] {
        return Err(bad(&format!("{field}.between"), "has one body twice: name two, or `ground` and one"));
    }
    if spring.present.is_empty() {
        return Err(bad(&format!("{field}.in"), "is empty: name A, B or AJB, or leave it out for all"));
    }
    Ok(())
}

/// Checks that all measured or excited points are on existing bodies.
fn points_exist(config: &RigConfig, own: &OwnStructure) -> Result<(), RigError> {
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

/// Fields that a user-defined structure replaces.
pub(super) const PAPERS_OWN: [&str; 8] =
    ["bodies", "leaf_springs", "knife_edge", "wire", "push_rod_a", "clamp", "clamp_b", "lower_push_rod"];

/// Merges `text` into the default and checks the result.
pub fn read(text: &str) -> Result<RigConfig, RigError> {
    let user = DeTable::parse(text).map_err(|error| document_error(&error, text))?;
    let mut merged =
        DeTable::parse(DEFAULT_TOML).expect("rigs/default.toml is TOML: it is embedded and a test reads it");
    merge(merged.get_mut(), user.get_ref().clone());
    if user.get_ref().contains_key("structure")
        && let Some(field) = PAPERS_OWN.into_iter().find(|field| user.get_ref().contains_key(*field))
    {
        let line = locate(user.get_ref(), field).map(|offset| line_of(text, offset));
        let reason = "describes the paper's rig, and [structure] another one: remove one of them".to_owned();
        return Err(RigError::Field { field: field.to_owned(), reason, line });
    }
    if user.get_ref().contains_key("structure") && !user.get_ref().contains_key("open_joint") {
        // the default's points are on the paper's arm A
        merged.get_mut().remove("open_joint");
    }
    // Only the user's text can be wrong here, so every span refers to it.
    let config = RigConfig::deserialize(toml::Deserializer::from(merged))
        .map_err(|error| document_error(&error, text))?;
    config.check().map_err(|error| match error {
        RigError::Field { field, reason, .. } => {
            let line = locate(user.get_ref(), &field).map(|offset| line_of(text, offset));
            RigError::Field { field, reason, line }
        }
        other => other,
    })?;
    Ok(config)
}

fn merge<'i>(base: &mut DeTable<'i>, over: DeTable<'i>) {
    // A body's inertia has two forms; the one stated by the user replaces the other.
    for (stated, replaced) in [("box_m", "inertia_kg_m2"), ("inertia_kg_m2", "box_m")] {
        if over.contains_key(stated) {
            base.remove(replaced);
        }
    }
    for (key, value) in over {
        let name: &str = key.get_ref();
        if let (Some(DeValue::Table(below)), DeValue::Table(inner)) =
            (base.get_mut(name).map(Spanned::get_mut), value.get_ref())
        {
            merge(below, inner.clone());
        } else {
            // Removed first: inserting over an equal key would keep the old key, and with it the
            // default's span.
            base.remove(name);
            base.insert(key, value);
        }
    }
}

fn document_error(error: &toml::de::Error, text: &str) -> RigError {
    let line = error.span().map(|span| line_of(text, span.start));
    RigError::Document { line, reason: error.message().trim().replace('\n', ", ") }
}

fn line_of(text: &str, offset: usize) -> usize {
    text.bytes().take(offset).filter(|byte| *byte == b'\n').count() + 1
}

/// Byte offset at which the user's document sets `path` (as `bodies.mass.mass_kg` or
/// `impacts[3].name`), or the nearest table around it that the document has.
fn locate(table: &DeTable<'_>, path: &str) -> Option<usize> {
    let (head, rest) = path.split_once('.').map_or((path, None), |(head, rest)| (head, Some(rest)));
    let (name, index) = match head.split_once('[') {
        Some((name, index)) => (name, index.trim_end_matches(']').parse::<usize>().ok()),
        None => (head, None),
    };
    let mut value = table.get(name)?;
    let mut offset = value.span().start;
    if let (Some(index), DeValue::Array(items)) = (index, value.get_ref()) {
        value = items.get(index)?;
        offset = value.span().start;
    }
    match (rest, value.get_ref()) {
        (Some(rest), DeValue::Table(inner)) => locate(inner, rest).or(Some(offset)),
        _ => Some(offset),
    }
}

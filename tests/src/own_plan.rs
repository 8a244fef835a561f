//! Plans for simulated rigs with a user-defined structure.

use jointrig::campaign::plan::SMALL;
use jointrig_hil_sim::rig::config::{RigConfig, Side};
use std::fmt::Write;

/// A plan with every point of the rig, in cells with the rig's names: two hits of one second. Fixed
/// vibrometers and a manual hammer are included if the rig has them.
pub fn plan(rig: &RigConfig) -> String {
    let own = rig.structure.as_ref().unwrap();
    let head = SMALL.split_once("[[configuration]]").unwrap().0;
    let mut text = head.replace("name = \"small\"", "name = \"clamped tips\"");
    text = text
        .replace("length_s = 2.0", "length_s = 1.0")
        .replace("exponential_per_s = 2.3", "exponential_per_s = 4.6");
    if rig.hammer.hand.is_some() {
        text += "[hammer]\nby = \"hand\"\n\n";
    }
    writeln!(
        text,
        "[structure]\na = \"frame\"\nb = \"base\"\nassembly = \"both\"\nsliding = [0.7071, 0.7071, 0.0]\n"
    )
    .unwrap();
    for (name, side) in [("frame", Some(Side::A)), ("base", Some(Side::B)), ("both", None)] {
        let on = |body| side.is_none_or(|side| own.body(body).unwrap().of == side);
        let impacts: Vec<&str> =
            rig.impacts.iter().filter(|point| on(point.body)).map(|point| point.name.as_str()).collect();
        let responses: Vec<&str> =
            rig.responses.iter().filter(|point| on(point.body)).map(|point| point.name.as_str()).collect();
        writeln!(
            text,
            "[[configuration]]\nname = {name:?}\nimpacts = {impacts:?}\nresponses = {responses:?}\n"
        )
        .unwrap();
    }
    let group = |body| if own.body(body).unwrap().of == Side::A { 1 } else { 2 };
    text += "[geometry]\nvirtual_point_m = [0.0, 0.0, 0.0]\n";
    for point in &rig.responses {
        let (name, at) = (&point.name, point.position_m);
        writeln!(
            text,
            "[[geometry.response]]\nname = {name:?}\ngrouping = {}\nposition_m = {at:?}",
            group(point.body)
        )
        .unwrap();
        let stays = rig.sensors.fixed.iter().filter(|own| own.response == *name);
        let (channels, axes): (Vec<&str>, Vec<[f64; 3]>) =
            stays.map(|own| (own.name.as_str(), own.direction)).unzip();
        if !channels.is_empty() {
            writeln!(text, "channels = {channels:?}\naxes = {axes:?}").unwrap();
        }
    }
    for point in &rig.impacts {
        let (name, at, along) = (&point.name, point.position_m, point.direction);
        writeln!(
            text,
            "[[geometry.impact]]\nname = {name:?}\ngrouping = {}\nposition_m = {at:?}\ndirection = {along:?}",
            group(point.body)
        )
        .unwrap();
    }
    text
}

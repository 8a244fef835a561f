//! Commands on the virtual rig's side: they reach the rig, and errors are reported.
#![allow(clippy::unwrap_used)]

use crate::support;

use jointrig_hil_sim::board::VirtualBoard;
use jointrig_hil_sim::console::{listen, obey};
use jointrig_protocol::event::Event;
use support::SmallHost;

#[test]
fn a_load_that_is_ordered_is_the_rigs_from_the_next_block_on() {
    let (board, link) = VirtualBoard::start(Some(include_str!("../../rigs/jenkins.toml")), 1).unwrap();
    let controls = board.controls();
    controls.watch_joint();
    let mut host = SmallHost::new(link);
    host.start();
    let mut limit_n = || {
        // the board is up to half a second ahead of its host
        host.go_on(40_000);
        controls.seen().joint.unwrap().limit_n
    };
    assert!((limit_n() - 180.0).abs() < 1e-9);
    let mut said = Vec::new();
    listen(controls, &b"\n  load 150 \nload -3\nload much\nlift 4\n"[..], &mut said).unwrap();
    let said = String::from_utf8(said).unwrap();
    let lines: Vec<&str> = said.lines().collect();
    assert_eq!(lines.len(), 4, "{said}");
    assert_eq!(lines[0], "normal load 150 N");
    assert!(lines[1].starts_with("not done") && lines[1].contains("-3"), "{said}");
    assert!(lines[2].contains("`much`") && lines[3].contains("load NEWTONS"), "{said}");
    assert!((limit_n() - 90.0).abs() < 1e-9, "0.6 times 150 N");
}

#[test]
fn the_safety_chain_is_worked_by_words() {
    let (board, link) = VirtualBoard::start(None, 1).unwrap();
    let mut host = SmallHost::new(link);
    host.start();
    for (line, known) in [
        ("guard open", true),
        ("guard shut", true),
        ("emergency press", true),
        ("guard", false),
        ("reset now", false),
    ] {
        assert_eq!(obey(board.controls(), line).is_ok(), known, "{line}");
    }
    host.go_on(40_000);
    assert!(host.events.contains(&Event::EmergencyStop(true)), "{:?}", host.events);
}

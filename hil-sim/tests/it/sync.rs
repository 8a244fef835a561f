//! Synchronisation with another recorder: its edges and ours on a common time axis, its clock for
//! our scans, and the behaviour when that clock fails.
#![allow(clippy::unwrap_used)]

use crate::support;

use jointrig_hil_sim::rig::RigConfig;
use jointrig_protocol::answer::{Answer, Hammer, Refusal};
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::request::{Configuration, Control, Request, Shake};
use jointrig_protocol::sync::{Clock, ClockFault, Edge, Line, Sync};
use support::{PULSE_US, SmallHost, Started};

const EXTERNAL: Clock = Clock::External { rate_hz: 51_200 };
/// Rounding down leaves half a unit of 2⁻¹⁶ scan on average; this is the largest rounding error.
const PART: f64 = 1.0 / 65_536.0;

fn sync(host: &mut SmallHost) -> Sync {
    match host.ask(Request::Sync) {
        Ok(Answer::Sync(sync)) => sync,
        other => panic!("no sync but {other:?}"),
    }
}

/// Requests a clock and waits until it is known to be good, or not.
fn clock(host: &mut SmallHost, clock: Clock) -> Sync {
    assert_eq!(host.ask(Request::Clock(clock)), Ok(Answer::Done));
    loop {
        let told = sync(host);
        if told.fault != Some(ClockFault::Unproven) {
            return told;
        }
    }
}

fn edges(host: &SmallHost) -> Vec<Edge> {
    let edge = |event: &Event| if let Event::Edge(edge) = event { Some(*edge) } else { None };
    host.events.iter().filter_map(edge).collect()
}

fn keeps_its_promises(start: impl Fn(&RigConfig) -> Started) {
    another_recorder_is_aligned(start(&RigConfig::default()));
    fast_edges_are_counted(start(&RigConfig::default()));
    a_shot_is_marked(start(&RigConfig::default()));
    a_clock_is_proven_before_it_is_used(start(&RigConfig::default()));
    a_lost_clock_ends_the_stream(start(&RigConfig::default()));
    a_lost_clock_stops_the_shaker(start(&RigConfig::default()));
}

/// The other recorder's samples are timed by a clock that is 80 ppm faster and started at another
/// time. Two of its edges determine the position of all its samples among the scans.
fn another_recorder_is_aligned((_board, controls, link): Started) {
    // a board runs ahead of its host, so later edges are set before the start
    let mut host = SmallHost::new(link);
    let (began, per_sample) = (1_234.567, 1.0 - 80e-6);
    let at = |sample: f64| began + sample * per_sample;
    for sample in [100.0, 20_100.0] {
        controls.wires().edge(at(sample));
    }
    host.start();
    host.until("both edges", |host| edges(host).len() == 2);
    let told: Vec<Edge> = edges(&host);
    assert!(told.iter().all(|edge| edge.line == Line::Input));
    assert_eq!((told[0].number, told[1].number), (1, 2));
    let [first, second] = [told[0].at.scans(), told[1].at.scans()];
    for (told, sample) in [(first, 100.0), (second, 20_100.0)] {
        assert!((0.0..PART).contains(&(at(sample) - told)), "{told} for {}", at(sample));
    }
    // any of its samples
    let placed = first + (second - first) * (12_345.0 - 100.0) / 20_000.0;
    assert!((placed - at(12_345.0)).abs() < 2.0 * PART);
}

fn fast_edges_are_counted((_board, controls, link): Started) {
    let mut host = SmallHost::new(link);
    for at in [5_000.0, 5_000.5, 5_001.25, 9_000.0] {
        controls.wires().edge(at);
    }
    host.start();
    host.until("the last edge", |host| edges(host).len() == 2);
    let told: Vec<(u32, f64)> = edges(&host).iter().map(|edge| (edge.number, edge.at.scans())).collect();
    assert_eq!(told, [(3, 5_001.25), (4, 9_000.0)], "numbers jump by what was lost");
    let told = sync(&mut host);
    assert_eq!((told.edges, told.edges_lost), (4, 2));
}

/// The output rises when the coil is switched on and when the force is detected; both recorders
/// know when.
fn a_shot_is_marked((_board, controls, link): Started) {
    let mut host = SmallHost::new(link);
    host.start();
    let at = host.stage(Configuration::Ajb, "AZ3", "B3", 0);
    let order = SmallHost::order(1, PULSE_US, at + host.lead());
    let shot = host.shoot(order);
    let told = edges(&host);
    assert_eq!(told.iter().map(|edge| edge.line).collect::<Vec<_>>(), [Line::Fired, Line::Trigger]);
    let seen = controls.wires().pulses();
    assert_eq!(told.iter().map(|edge| edge.at.scans()).collect::<Vec<_>>(), seen);
    let after = |edge: &Edge, what: u64| edge.at.scan - what;
    assert!(after(&told[0], shot.fired_at) <= 1, "{told:?}, {shot:?}");
    assert!(after(&told[1], shot.trigger) <= 25, "a block of 24 scans: {told:?}, {shot:?}");
    // and when the host requests it
    host.release();
    assert_eq!(host.ask(Request::Mark), Ok(Answer::Done));
    host.until("the mark", |host| edges(host).len() == 3);
    assert_eq!(edges(&host)[2].line, Line::Asked);
    assert_eq!(sync(&mut host).pulses, 3);
    assert_eq!(controls.coil_pulses_us(), [PULSE_US], "no edge and no pulse moves anything");
}

fn a_clock_is_proven_before_it_is_used((_board, controls, link): Started) {
    let mut host = SmallHost::new(link);
    assert_eq!(sync(&mut host), Sync::default());
    for rate_hz in [0, 48_000, 10_000_000] {
        let refused = host.ask(Request::Clock(Clock::External { rate_hz }));
        assert!(matches!(refused, Err(Refusal::OutOfBounds(_))), "{rate_hz} Hz");
    }
    // no clock; a completely different rate; one slightly out of tolerance
    for (ppm, fault) in
        [(None, ClockFault::Absent), (Some(1e5), ClockFault::Rate), (Some(-450.0), ClockFault::Rate)]
    {
        controls.wires().give_clock(ppm);
        let told = clock(&mut host, EXTERNAL);
        assert_eq!((told.clock, told.fault), (EXTERNAL, Some(fault)), "{ppm:?}");
        assert_eq!(host.ask(Request::Start), Err(Refusal::Clock(fault)), "nothing starts by it");
    }
    assert_eq!(clock(&mut host, Clock::Internal), Sync::default());
    controls.wires().give_clock(Some(-120.0));
    let told = clock(&mut host, EXTERNAL);
    assert_eq!((told.clock, told.fault), (EXTERNAL, None));
    assert!((told.ppm + 120.0).abs() < 12.0, "{}", told.ppm);
    host.start();
    host.go_on(51_200);
    assert!(
        matches!(host.ask(Request::Clock(Clock::Internal)), Err(Refusal::OutOfBounds(_))),
        "a stream runs"
    );
    let told = sync(&mut host);
    assert!((told.ppm + 120.0).abs() < 0.5, "{}", told.ppm);
    // a new session must request it again
    let mut host = SmallHost::again(host, 100);
    assert_eq!(sync(&mut host).clock, Clock::Internal);
}

fn a_lost_clock_ends_the_stream((_board, controls, link): Started) {
    let mut host = SmallHost::new(link);
    controls.wires().give_clock(Some(30.0));
    assert_eq!(clock(&mut host, EXTERNAL).fault, None);
    host.start();
    host.go_on(10_000);
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    let stops_at = host.next_scan + 60_000;
    controls.wires().stop_clock_at(stops_at);
    let lost = Event::Clock(ClockFault::Lost);
    host.until("the loss", |host| host.events.contains(&lost));
    let status = host.status();
    assert!(!status.streaming);
    assert_eq!(status.hammer, Hammer::Disarmed);
    assert!(host.events.contains(&Event::Disarmed(Reason::Clock)));
    assert!(host.next_scan <= stops_at + 48, "the stream went on for {} scans", host.next_scan - stops_at);
    assert_eq!(host.ask(Request::Start), Err(Refusal::Clock(ClockFault::Lost)));
    assert!(controls.coil_pulses_us().is_empty());
    // without it, and with it when it has returned
    assert_eq!(clock(&mut host, Clock::Internal).fault, None);
    host.start();
    host.go_on(100);
    assert_eq!(host.ask(Request::Stop), Ok(Answer::Done));
    controls.wires().give_clock(Some(30.0));
    assert_eq!(clock(&mut host, EXTERNAL).fault, None);
    host.start();
    host.go_on(5_000);
}

fn a_lost_clock_stops_the_shaker((_board, controls, link): Started) {
    let mut host = SmallHost::new(link);
    controls.wires().give_clock(Some(0.0));
    assert_eq!(clock(&mut host, EXTERNAL).fault, None);
    host.start();
    host.stage(Configuration::Ajb, "AZ3", "B3", 0);
    host.release();
    let shake = Shake {
        step: Shake::step_of(200.0, 51_200),
        control: Control::Drive,
        amplitude_v: 0.5,
        slew_v_per_s: 20.0,
        valid_ms: 60_000,
        limits: heapless::Vec::new(),
    };
    assert_eq!(host.ask(Request::Shake(shake)), Ok(Answer::Done));
    host.go_on(20_000);
    let stops_at = host.next_scan + 60_000;
    controls.wires().stop_clock_at(stops_at);
    host.until("the stop", |host| host.events.contains(&Event::ShakerStops(Reason::Clock)));
    host.until("the loss", |host| host.events.contains(&Event::Clock(ClockFault::Lost)));
}

#[test]
fn the_native_board_keeps_its_promises() {
    keeps_its_promises(support::native);
}

#[cfg(unix)]
#[test]
fn so_does_the_binary() {
    if let Some(image) = support::image() {
        keeps_its_promises(|config| support::emulated(&image, config));
    }
}

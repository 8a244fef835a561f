//! Tests of the shared state, without a board.

extern crate std;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use jointrig_protocol::answer::Answer;
use jointrig_protocol::channel::{Axis, Quantity, Role};
use jointrig_protocol::frame::{Accumulator, Kind};
use jointrig_protocol::hello::Hello;
use jointrig_protocol::request::Request;
use std::vec::Vec;

use super::*;
use crate::board::NoStage;
use crate::events::EVENTS;
use crate::hammer::CoilOrder;
use crate::safety::Orders;

/// A device that streams and whose hammer is armed.
fn armed<'a>(channels: &'a [Channel], slots: &'a mut [Slot]) -> Core<'a, NoopRawMutex> {
    let facts = Facts {
        board: Name::new(),
        serial: Name::new(),
        target: String::new(),
        build: 0,
        scan_rate_hz: 51_200,
        channels,
        coil_cap_us: 8_000,
        stage: false,
        sync: false,
        drive_v: 0.0,
        reset: jointrig_protocol::answer::Reset::Power,
        boot: 1,
    };
    let core = Core::new(facts, slots);
    core.with(|state| {
        state.safety.begin_stream();
        state.safety.arm(1_000).expect("a hammer at rest");
        while state.take_event().is_some() {}
    });
    core
}

fn channel(role: Role) -> Channel {
    Channel {
        name: Name::new(),
        role,
        quantity: Quantity::Force,
        units_per_volt: 1.0,
        range_v: 10.0,
        delay_ns: 0,
        bits: 16,
    }
}

fn orders(core: &Core<'_, NoopRawMutex>) -> Orders {
    core.with(|state| state.safety.take_orders())
}

fn said(core: &Core<'_, NoopRawMutex>) -> Vec<Event> {
    core.with(|state| core::iter::from_fn(|| state.safety.take_event()).map(|event| event.event).collect())
}

#[test]
fn inputs_are_heeded_and_told_without_a_block() {
    let channels = [channel(Role::HammerForce), channel(Role::Response(Axis::Z))];
    let mut slots = [Slot::EMPTY; 2];
    let core = armed(&channels, &mut slots);
    assert!(!core.see_inputs(true, false));
    assert_eq!(said(&core), []);
    assert!(core.to_send.try_take().is_some());

    assert!(core.see_inputs(false, false));
    assert_eq!(said(&core), [Event::Interlock(false), Event::Disarmed(Reason::Interlock)]);
    assert_eq!(orders(&core).coil, Some(CoilOrder::Off));
    assert_eq!(core.with(|state| state.safety.may_move()), Err(Refusal::Interlock));
    // the same inputs again: no new event, but still an order
    assert!(core.see_inputs(false, false));
    assert_eq!(said(&core), []);
    assert_eq!(orders(&core).coil, Some(CoilOrder::Off));
    assert!(!core.see_inputs(true, false));
    assert_eq!(said(&core), [Event::Interlock(true)]);
}

#[test]
fn an_emergency_stop_stays_when_its_button_is_released() {
    let channels = [channel(Role::HammerForce)];
    let mut slots = [Slot::EMPTY; 2];
    let core = armed(&channels, &mut slots);
    assert!(core.see_inputs(true, true));
    assert_eq!(said(&core), [Event::EmergencyStop(true), Event::Disarmed(Reason::EmergencyStop)]);
    assert!(orders(&core).drive_off);
    assert!(!core.see_inputs(true, false));
    assert!(!orders(&core).drive_off);
    // pressed again while latched: no new event, but still an order
    assert!(core.see_inputs(true, true));
    assert!(orders(&core).drive_off);
    assert!(!core.see_inputs(true, false));
    assert_eq!(said(&core), []);
    assert_eq!(core.with(|state| state.safety.may_move()), Err(Refusal::EmergencyStop));
}

#[test]
fn no_two_streams_of_some_starts_have_one_epoch() {
    let channels = [channel(Role::HammerForce)];
    let mut epochs = Vec::new();
    // a random number and the resets after it, across the wrap of its low 16 bits, which an epoch
    // contains
    for boot in [0xCAFE_FFFE_u32, 0xCAFE_FFFF, 0xCAFF_0000] {
        let mut slots = [Slot::EMPTY; 2];
        let mut core = armed(&channels, &mut slots);
        core.facts.boot = boot;
        for streams in [0, 1, 0xFFFF] {
            core.with(|state| state.streams = streams);
            let Ok(Answer::Started { epoch, .. }) = core.carry_out(&Request::Start, &mut NoStage) else {
                panic!("a stream can always be started");
            };
            epochs.push(epoch);
        }
    }
    assert_eq!(epochs[..3], [0xFFFE_0000, 0xFFFE_0001, 0xFFFE_FFFF]);
    epochs.sort_unstable();
    epochs.dedup();
    assert_eq!(epochs.len(), 9);
}

/// A link that accepts everything.
struct Wire<'a>(&'a RefCell<Vec<u8>>);

impl crate::board::ByteSink for Wire<'_> {
    async fn write(&mut self, frame: &[u8]) {
        self.0.borrow_mut().extend_from_slice(frame);
    }
}

/// All frames that wait for the link, in order.
fn transmits(core: &Core<'_, NoopRawMutex>) -> Vec<(Kind, Vec<u8>)> {
    let wire = RefCell::new(Vec::new());
    let mut sink = Wire(&wire);
    let mut task = core::pin::pin!(crate::transmit::transmit(core, &mut sink));
    let mut context = core::task::Context::from_waker(core::task::Waker::noop());
    assert!(task.as_mut().poll(&mut context).is_pending(), "it runs for ever");
    let (mut accumulator, bytes) = (Accumulator::new(), wire.borrow().clone());
    let (mut rest, mut frames) = (&bytes[..], Vec::new());
    while !rest.is_empty() {
        let (used, found) = accumulator.feed(rest);
        rest = &rest[used..];
        if let Some(frame) = found {
            let frame = frame.expect("whole");
            frames.push((frame.kind, frame.payload.to_vec()));
        }
    }
    frames
}

/// The events among `frames`.
fn events(frames: &[(Kind, Vec<u8>)]) -> Vec<event::Numbered> {
    let own = frames.iter().filter(|(kind, _)| *kind == Kind::Event);
    own.map(|(_, payload)| postcard::from_bytes(payload).expect("an event")).collect()
}

/// Performs the handshake of a host with this session number.
fn greet(core: &Core<'_, NoopRawMutex>, session: u32) {
    core.greet(&Hello::host(session).to_bytes());
}

/// As [`armed`], in a session whose host reads COBS.
fn in_session<'a>(channels: &'a [Channel], slots: &'a mut [Slot]) -> Core<'a, NoopRawMutex> {
    let core = armed(channels, slots);
    core.with(|state| state.session = Some(1));
    core
}

fn fire(number: u32) -> Request {
    Request::Fire(jointrig_protocol::request::Fire {
        number,
        pulse_us: 3_000,
        not_before: 1_000_000,
        quiet_limits: heapless::Vec::new(),
        quiet_window: 0,
        quiet_patience: 51_200,
    })
}

#[test]
fn a_new_session_receives_no_shot_of_the_session_before_and_every_fault() {
    let channels = [channel(Role::HammerForce)];
    let mut slots = [Slot::EMPTY; 2];
    let core = in_session(&channels, &mut slots);
    core.report_fault("a converter");
    core.carry_out(&fire(37), &mut NoStage).expect("armed");
    // the link of this session sends nothing, and its host ends while the shot waits
    core.with(|state| {
        state.safety.say(Event::Armed);
        state.safety.say(Event::Counters(state.counters()));
    });
    greet(&core, 2);
    let frames = transmits(&core);
    assert_eq!(frames[0].0, Kind::Hello);
    let events: Vec<Event> = events(&frames).into_iter().map(|event| event.event).collect();
    assert_eq!(events, [Event::Fault("a converter".try_into().expect("short"))]);
    assert_eq!(core.with(|state| state.safety.hammer().state()), answer::Hammer::Disarmed);
}

#[test]
fn a_shot_number_is_used_once_in_all_sessions_of_a_start() {
    let channels = [channel(Role::HammerForce)];
    let mut slots = [Slot::EMPTY; 2];
    let core = armed(&channels, &mut slots);
    core.carry_out(&fire(1), &mut NoStage).expect("armed");
    greet(&core, 2);
    core.carry_out(&Request::Start, &mut NoStage).expect("a stream");
    core.carry_out(&Request::Arm { valid_ms: 1_000 }, &mut NoStage).expect("at rest");
    assert_eq!(core.carry_out(&fire(1), &mut NoStage), Err(Refusal::ShotRepeated { last: 1 }));
    let Ok(Answer::Status(status)) = core.carry_out(&Request::Status, &mut NoStage) else {
        panic!("a status can always be asked for");
    };
    // from this, a host knows which numbers are unused
    assert_eq!(status.shot.map(|shot| (shot.number, shot.phase)), Some((1, Phase::Cancelled)));
    assert_eq!(core.carry_out(&fire(2), &mut NoStage), Ok(Answer::Scheduled { number: 2 }));
}

#[test]
fn counters_displace_no_other_event() {
    let channels = [channel(Role::HammerForce)];
    let mut slots = [Slot::EMPTY; 2];
    let core = armed(&channels, &mut slots);
    core.with(|state| {
        state.session = Some(1);
        // a minute on a link that accepts nothing
        for _ in 0..60 {
            state.safety.say(Event::Counters(Counters::default()));
        }
        for _ in 0..3 {
            state.ring.push(state.safety.next_scan(), 0, 15, &[0; limits::BLOCK_SAMPLE_BYTES]);
            state.safety.advance(15);
        }
    });
    assert!(core.see_inputs(false, true));
    let events: Vec<Event> = events(&transmits(&core)).into_iter().map(|event| event.event).collect();
    for wanted in
        [Event::Interlock(false), Event::EmergencyStop(true), Event::Disarmed(Reason::EmergencyStop)]
    {
        assert!(events.contains(&wanted), "{wanted:?} of {events:?}");
    }
    let lost =
        |event: &&Event| matches!(event, Event::Lost { first_scan: 0, scans: 15, why: Loss::LinkSlow, .. });
    assert_eq!(events.iter().filter(lost).count(), 1, "{events:?}");
}

#[test]
fn a_loss_is_reported_however_many_events_wait() {
    let channels = [channel(Role::HammerForce)];
    let mut slots = [Slot::EMPTY; 2];
    let core = in_session(&channels, &mut slots);
    for _ in 0..EVENTS {
        core.report_fault("a converter");
    }
    core.with(|state| {
        for _ in 0..4 {
            state.ring.push(state.safety.next_scan(), 0, 15, &[0; limits::BLOCK_SAMPLE_BYTES]);
            state.safety.advance(15);
        }
    });
    assert!(core.see_inputs(false, false));
    let events: Vec<Event> = events(&transmits(&core)).into_iter().map(|event| event.event).collect();
    let lost =
        |event: &&Event| matches!(event, Event::Lost { first_scan: 0, scans: 30, why: Loss::LinkSlow, .. });
    assert_eq!(events.iter().filter(lost).count(), 1, "{events:?}");
    assert!(events.contains(&Event::Interlock(false)), "{events:?}");
}

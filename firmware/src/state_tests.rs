//! What the tasks share, without a board.

extern crate std;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use jointrig_protocol::answer::Answer;
use jointrig_protocol::channel::{Axis, Quantity, Role};
use jointrig_protocol::request::Request;
use std::vec::Vec;

use super::*;
use crate::board::NoStage;

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
        state.streaming = true;
        state.hammer.arm(0, 1_000).expect("a hammer at rest");
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

fn said(core: &Core<'_, NoopRawMutex>) -> Vec<Event> {
    core.with(|state| core::iter::from_fn(|| state.events.pop_front()).map(|event| event.event).collect())
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
    assert_eq!(core.with(|state| state.coil.take()), Some(CoilOrder::Off));
    assert_eq!(core.with(|state| state.may_move()), Err(Refusal::Interlock));
    // the same again: nothing new to tell, but still an order
    assert!(core.see_inputs(false, false));
    assert_eq!(said(&core), []);
    assert_eq!(core.with(|state| state.coil.take()), Some(CoilOrder::Off));
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
    assert!(core.with(|state| core::mem::take(&mut state.drive_off)));
    assert!(!core.see_inputs(true, false));
    assert!(!core.with(|state| state.drive_off));
    // pressed again while it is latched: nothing new to tell, but still an order
    assert!(core.see_inputs(true, true));
    assert!(core.with(|state| state.drive_off));
    assert!(!core.see_inputs(true, false));
    assert_eq!(said(&core), []);
    assert_eq!(core.with(|state| state.may_move()), Err(Refusal::EmergencyStop));
}

#[test]
fn no_two_streams_of_some_starts_have_one_epoch() {
    let channels = [channel(Role::HammerForce)];
    let mut epochs = Vec::new();
    // a number of the RNG's, and the resets after it, over the end of what an epoch holds of it
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

/// A host says hello in a session of its own.
fn greet(core: &Core<'_, NoopRawMutex>, session: u32) {
    let hello = jointrig_protocol::hello::Hello::host(session).to_bytes();
    core.greet(&hello);
}

fn fire(number: u32) -> Request {
    Request::Fire(jointrig_protocol::request::Fire {
        number,
        pulse_us: 2_000,
        not_before: 1_000_000,
        quiet_limits: heapless::Vec::new(),
        quiet_window: 0,
        quiet_patience: 0,
    })
}

#[test]
fn a_new_session_gets_no_event_of_the_old_one_and_no_shot_number_twice() {
    let channels = [channel(Role::HammerForce)];
    let mut slots = [Slot::EMPTY; 2];
    let core = armed(&channels, &mut slots);
    greet(&core, 1);
    core.with(|state| {
        state.streaming = true;
        state.hammer.arm(0, 1_000).expect("a hammer at rest");
    });
    assert_eq!(core.carry_out(&fire(37), &mut NoStage), Ok(Answer::Scheduled { number: 37 }));
    core.report_fault("a converter");
    core.with(|state| state.heed(false, false));
    // the host is killed while the shot waits, and another one opens a session
    greet(&core, 2);
    let events = said(&core);
    assert!(events.iter().any(|event| matches!(event, Event::Fault(_))), "{events:?}");
    assert!(events.contains(&Event::Interlock(false)), "the board's own state is told");
    assert!(!events.iter().any(|event| matches!(event, Event::Shot(_) | Event::Disarmed(_))), "{events:?}");
    core.with(|state| {
        state.heed(true, false);
        state.streaming = true;
        state.hammer.arm(0, 1_000).expect("a hammer at rest");
    });
    assert_eq!(core.carry_out(&fire(1), &mut NoStage), Err(Refusal::ShotRepeated { last: 37 }));
    assert_eq!(core.carry_out(&fire(38), &mut NoStage), Ok(Answer::Scheduled { number: 38 }));
}

#[test]
fn a_flood_of_counters_drops_no_loss_and_no_safety_event() {
    let channels = [channel(Role::HammerForce)];
    let mut slots = [Slot::EMPTY; 2];
    let core = armed(&channels, &mut slots);
    let range = |first_scan| Range { first_scan, scans: 10 };
    core.with(|state| {
        for _ in 0..3 * EVENTS {
            state.say(Event::Counters(state.counters));
        }
        for first_scan in [100, 500, 900] {
            state.ring.report(range(first_scan), jointrig_protocol::event::Loss::LinkSlow);
        }
        state.report_losses();
        state.heed(false, true);
        for _ in 0..3 * EVENTS {
            state.say(Event::Counters(state.counters));
        }
        assert_eq!(
            state.counters.events_dropped as usize,
            5 * EVENTS + 6,
            "each counter that found no room, or gave it"
        );
    });
    let events = said(&core);
    let lost: Vec<u64> = events
        .iter()
        .filter_map(|event| if let Event::Lost { first_scan, .. } = event { Some(*first_scan) } else { None })
        .collect();
    assert_eq!(lost, [100, 500, 900]);
    assert!(events.contains(&Event::EmergencyStop(true)) && events.contains(&Event::Interlock(false)));
}

#[test]
fn a_loss_waits_while_the_queue_has_no_room_and_the_last_state_of_an_input_counts() {
    let channels = [channel(Role::HammerForce)];
    let mut slots = [Slot::EMPTY; 2];
    let core = armed(&channels, &mut slots);
    core.with(|state| {
        for _ in 0..EVENTS - 1 {
            state.say(Event::Fault(String::new()));
        }
        state.heed(false, false);
        state.heed(true, false);
        let lost = Range { first_scan: 7, scans: 3 };
        state.ring.report(lost, jointrig_protocol::event::Loss::FrontEnd);
        state.report_losses();
        assert!(state.ring.has_loss(), "it was not taken for an event that found no room");
        let events = &state.events;
        assert_eq!(events.iter().filter(|queued| queued.event == Event::Interlock(true)).count(), 1);
        state.events.pop_front();
        state.report_losses();
        assert!(!state.ring.has_loss());
    });
    assert!(said(&core).iter().any(|event| matches!(event, Event::Lost { first_scan: 7, scans: 3, .. })));
}

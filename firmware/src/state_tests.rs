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

//! Requirements for every virtual board, native or emulated: each scenario takes a board's controls
//! and a host.

use jointrig_hil_sim::board::Controls;
use jointrig_hil_sim::rig::RigConfig;
use jointrig_protocol::answer::{Answer, Hammer, Refusal, Shaker};
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::limits::{COIL_PULSE_CAP_US, SHAKE_RAMP_MS};
use jointrig_protocol::request::{Configuration, Control, Request, Shake};
use jointrig_protocol::shot::Phase;
use std::time::{Duration, Instant};

use super::{PULSE_US, SmallHost};

const RATE: u32 = 51_200;
/// Index of the excitation channel in a scan.
const EXCITATION: usize = 9;
const AMPLITUDE_V: f32 = 2.0;

/// An order for 200 Hz that rises within a tenth of a second.
pub fn shake() -> Shake {
    Shake {
        step: Shake::step_of(200.0, RATE),
        control: Control::Drive,
        amplitude_v: AMPLITUDE_V,
        slew_v_per_s: 20.0,
        valid_ms: 30_000,
        limits: heapless::Vec::new(),
    }
}

/// A scenario with a board's controls and its host.
pub type Scenario = fn(&Controls, &mut SmallHost);

/// The scenarios for a board whose time waits for its host.
pub const ALL: [Scenario; 9] = [
    a_shot_without_arming_is_refused,
    one_arming_allows_one_shot,
    hammer_and_shaker_exclude_each_other,
    the_shaker_pushes_as_ordered_and_comes_to_rest,
    a_limit_brings_the_shaker_to_rest,
    a_stop_in_mid_pulse_takes_the_coil_away,
    a_stop_takes_the_shaker_away_without_a_ramp,
    an_open_guard_brings_the_shaker_to_rest,
    a_pulled_link_brings_the_shaker_to_rest,
];

/// In all cases, no pulse was longer than the upper limit.
pub fn the_coil_kept_its_cap(controls: &Controls) {
    let pulses = controls.coil_pulses_us();
    assert!(pulses.iter().all(|pulse| *pulse <= COIL_PULSE_CAP_US), "{pulses:?}");
}

fn a_shot_without_arming_is_refused(controls: &Controls, host: &mut SmallHost) {
    host.start();
    let order = Request::Fire(SmallHost::order(1, PULSE_US, 0));
    assert_eq!(host.ask(order), Err(Refusal::NotArmed));
    host.go_on(RATE.into());
    assert_eq!(host.status().hammer, Hammer::Disarmed);
    assert!(controls.coil_pulses_us().is_empty());
}

fn one_arming_allows_one_shot(controls: &Controls, host: &mut SmallHost) {
    host.start();
    let at = host.stage(Configuration::Ajb, "AZ3", "A3", 0);
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    let order = |number, not_before| Request::Fire(SmallHost::order(number, PULSE_US, not_before));
    assert_eq!(host.ask(order(1, at + host.lead())), Ok(Answer::Scheduled { number: 1 }));
    assert_eq!(host.ask(order(2, 0)), Err(Refusal::Busy), "while the first one waits");
    host.release();
    host.until("the shot", |host| host.phases().contains(&Phase::Done));
    assert_eq!(host.ask(order(3, 0)), Err(Refusal::NotArmed), "after the first one");
    host.go_on(2 * u64::from(RATE));
    assert_eq!(controls.coil_pulses_us(), [PULSE_US]);
    assert_eq!(host.status().hammer, Hammer::Disarmed);
}

fn hammer_and_shaker_exclude_each_other(controls: &Controls, host: &mut SmallHost) {
    assert_eq!(host.ask(Request::Shake(shake())), Err(Refusal::NotStreaming));
    host.start();
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    assert_eq!(host.ask(Request::Shake(shake())), Err(Refusal::HammerArmed));
    assert_eq!(host.ask(Request::Disarm), Ok(Answer::Done));
    assert_eq!(host.ask(Request::Shake(shake())), Ok(Answer::Done));
    let order = || Request::Fire(SmallHost::order(1, PULSE_US, 0));
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Err(Refusal::ShakerRuns));
    assert_eq!(host.ask(order()), Err(Refusal::ShakerRuns));
    host.go_on(RATE.into());
    assert_eq!(host.status().shaker, Shaker::Steady);
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Err(Refusal::ShakerRuns));
    assert_eq!(host.ask(order()), Err(Refusal::ShakerRuns));
    assert!(controls.seen().driven_until > 0, "the rig is driven");
    // its time stops during the ramp-down
    halt(host);
    assert_eq!(host.ask(Request::Rest), Ok(Answer::Done));
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Err(Refusal::ShakerRuns), "on its way down");
    assert_eq!(host.ask(order()), Err(Refusal::ShakerRuns), "on its way down");
    host.release();
    host.until("rest", |host| host.events.contains(&Event::ShakerRests));
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    assert!(controls.coil_pulses_us().is_empty());
}

/// Holds the board, and waits until it stops, half a ring ahead.
fn halt(host: &mut SmallHost) {
    host.hold_at = host.next_scan;
    let halt = host.hold_at + u64::from(host.hello.unwrap().ring_scans / 2);
    host.until("the halt", |host| host.next_scan >= halt);
}

/// Peak code of the excitation channel in the last `scans` scans.
fn excitation(host: &SmallHost, scans: usize) -> i16 {
    let first = host.codes.len() - scans * host.channels;
    let codes = host.codes[first..].iter().skip(EXCITATION).step_by(host.channels);
    codes.map(|code| code.saturating_abs()).max().unwrap()
}

fn the_shaker_pushes_as_ordered_and_comes_to_rest(_: &Controls, host: &mut SmallHost) {
    host.start();
    assert_eq!(host.ask(Request::Shake(shake())), Ok(Answer::Done));
    host.go_on(RATE.into());
    let status = host.status();
    assert_eq!((status.shaker, status.drive_v), (Shaker::Steady, AMPLITUDE_V));
    let config = RigConfig::default();
    let newtons = f64::from(AMPLITUDE_V) * config.shaker.gain_n_per_v;
    let code = newtons / config.sensors.excitation.units_per_volt / 10.0 * 32_768.0;
    // ten cycles; the force cell's noise adds some codes to the peak
    let peak = f64::from(excitation(host, 2_560));
    assert!((peak / code - 1.0).abs() < 0.02, "{peak} for {code}");
    assert_eq!(host.ask(Request::Rest), Ok(Answer::Done));
    host.until("rest", |host| host.events.contains(&Event::ShakerRests));
    host.go_on(u64::from(RATE / 1000 * SHAKE_RAMP_MS) + 5_120);
    assert!(f64::from(excitation(host, 2_560)) < 0.02 * code);
    assert_eq!(host.status().shaker, Shaker::Resting);
}

/// From 0.1 s after this scan on the drive is zero, for at least half a second.
fn the_drive_rests_within_100_ms_of(scan: u64, controls: &Controls, host: &mut SmallHost) {
    host.until("a second", |host| host.latest >= scan + u64::from(RATE));
    let seen = controls.seen();
    assert!(seen.driven_until > 0 && seen.driven_until <= scan + u64::from(RATE / 10), "{seen:?} for {scan}");
    assert!(seen.drive_v == 0.0 && seen.scans > scan + u64::from(RATE / 2), "{seen:?} for {scan}");
    assert_eq!(host.status().shaker, Shaker::Resting);
}

fn a_limit_brings_the_shaker_to_rest(controls: &Controls, host: &mut SmallHost) {
    host.start();
    let config = RigConfig::default();
    let mut order = shake();
    for _ in 0..EXCITATION {
        order.limits.push(0.0).unwrap();
    }
    // half of the force that the order would reach
    let limit_n = f64::from(AMPLITUDE_V) * config.shaker.gain_n_per_v / 2.0;
    order.limits.push(limit_n as f32).unwrap();
    assert_eq!(host.ask(Request::Shake(order)), Ok(Answer::Done));
    host.until("rest", |host| host.events.contains(&Event::ShakerRests));
    let reason = Reason::Limit { channel: EXCITATION as u8 };
    assert!(host.events.contains(&Event::ShakerStops(reason)), "{:?}", host.events);
    let bound = limit_n / config.sensors.excitation.units_per_volt / 10.0 * 32_768.0;
    let mut forces = host.codes.iter().skip(EXCITATION).step_by(host.channels);
    let tripped = forces.position(|code| f64::from(code.unsigned_abs()) > bound).unwrap() as u64;
    the_drive_rests_within_100_ms_of(host.first_scan + tripped, controls, host);
}

fn a_stop_in_mid_pulse_takes_the_coil_away(controls: &Controls, host: &mut SmallHost) {
    host.start();
    host.stage(Configuration::Ajb, "AZ3", "A3", 0);
    // A held board stops half a ring ahead. The order is given while it is stopped, and it
    // continues until a second stop, a hundred scans (2 ms) or a few blocks after the coil was
    // switched on.
    let half = u64::from(host.hello.unwrap().ring_scans / 2);
    let (first, second) = (host.hold_at, host.hold_at + 10_240);
    host.until("the first halt", |host| host.next_scan >= first + half);
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    let order = Request::Fire(SmallHost::order(1, COIL_PULSE_CAP_US, second + half - 100));
    assert_eq!(host.ask(order), Ok(Answer::Scheduled { number: 1 }));
    host.hold_at = second;
    host.acknowledge();
    host.until("the coil", |host| host.phases().contains(&Phase::Firing));
    host.until("the second halt", |host| host.next_scan >= second + half);
    assert_eq!(controls.coil_pulses_us(), [COIL_PULSE_CAP_US]);
    controls.press_emergency_stop(true);
    host.release();
    host.until("the stop", |host| host.events.contains(&Event::EmergencyStop(true)));
    host.go_on(RATE.into());
    // at most 100 scans and two blocks of 24
    let pulses = controls.coil_pulses_us();
    assert!(pulses.len() == 1 && (1_000..3_000).contains(&pulses[0]), "{pulses:?}");
    let status = host.status();
    assert!(status.emergency_stop);
    assert!(matches!(status.hammer, Hammer::Disarmed | Hammer::HoldOff), "{status:?}");
    assert_eq!(host.ask(Request::Arm { valid_ms: 1000 }), Err(Refusal::EmergencyStop));
}

fn a_stop_takes_the_shaker_away_without_a_ramp(controls: &Controls, host: &mut SmallHost) {
    host.start();
    assert_eq!(host.ask(Request::Shake(shake())), Ok(Answer::Done));
    host.go_on(RATE.into());
    controls.press_emergency_stop(true);
    host.until("the stop", |host| host.events.contains(&Event::EmergencyStop(true)));
    assert!(host.events.contains(&Event::ShakerStops(Reason::EmergencyStop)));
    let status = host.status();
    assert_eq!((status.shaker, status.drive_v), (Shaker::Resting, 0.0));
    host.go_on(RATE.into());
    assert!(excitation(host, 2_560) < 20);
    assert_eq!(host.ask(Request::Shake(shake())), Err(Refusal::EmergencyStop));
}

fn an_open_guard_brings_the_shaker_to_rest(controls: &Controls, host: &mut SmallHost) {
    host.start();
    assert_eq!(host.ask(Request::Shake(shake())), Ok(Answer::Done));
    controls.open_guard(true);
    host.until("rest", |host| host.events.contains(&Event::ShakerRests));
    assert!(host.events.contains(&Event::ShakerStops(Reason::Interlock)));
    assert_eq!(host.ask(Request::Shake(shake())), Err(Refusal::Interlock));
}

fn a_pulled_link_brings_the_shaker_to_rest(controls: &Controls, host: &mut SmallHost) {
    host.start();
    assert_eq!(host.ask(Request::Shake(shake())), Ok(Answer::Done));
    host.go_on(RATE.into());
    // the link is cut while the board's time is stopped, during the shake
    halt(host);
    let seen = controls.seen();
    assert!(seen.scans < seen.driven_until + 24, "{seen:?}");
    host.cut();
    host.release();
    the_drive_rests_within_100_ms_of(seen.scans, controls, host);
    assert!(host.events.contains(&Event::ShakerStops(Reason::LinkLost)), "{:?}", host.events);
}

/// `lose(from, scans)` makes the converters lose `scans` scans.
pub fn lost_scans_take_the_drive_away(lose: impl Fn(u64, u64), controls: &Controls, host: &mut SmallHost) {
    host.start();
    assert_eq!(host.ask(Request::Shake(shake())), Ok(Answer::Done));
    host.go_on(RATE.into());
    assert_eq!(host.status().shaker, Shaker::Steady);
    // further ahead than the board can be; blocks of 24 scans
    let (from, scans) = ((host.next_scan + 2 * host.lead()) / 24 * 24, 240);
    lose(from, scans);
    host.until("the loss", |host| host.latest > from + scans);
    the_drive_rests_within_100_ms_of(from, controls, host);
    // it played only what it had been given for one block, and did not continue when scans came
    // again
    let seen = controls.seen();
    assert!((from..=from + 48).contains(&seen.driven_until), "{seen:?} from {from}");
    for event in [Event::ShakerStops(Reason::FrontEnd), Event::ShakerRests] {
        assert!(host.events.contains(&event), "{:?}", host.events);
    }
    assert_eq!(host.ask(Request::Shake(shake())), Ok(Answer::Done));
    host.go_on(RATE.into());
    assert_eq!(host.status().shaker, Shaker::Steady, "it can be begun anew");
}

/// Needs a board whose time advances without its host.
pub fn a_host_that_is_gone_leaves_nothing_moving(controls: &Controls, host: &mut SmallHost) {
    host.start();
    assert_eq!(host.ask(Request::Shake(shake())), Ok(Answer::Done));
    let last_word = controls.seen().scans;
    silence(controls, host);
    let status = host.status();
    assert_eq!((status.shaker, status.drive_v), (Shaker::Resting, 0.0));
    assert!(host.events.contains(&Event::ShakerStops(Reason::LinkLost)), "{:?}", host.events);
    // 1 s of silence, 0.1 s until it is noticed, 0.1 s to rest, and 0.1 s until the order was
    // processed
    let seen = controls.seen();
    let bound = u64::from(RATE / 10 * 13);
    assert!(seen.driven_until > 0 && seen.driven_until < last_word + bound, "{seen:?} after {last_word}");
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    silence(controls, host);
    assert_eq!(host.status().hammer, Hammer::Disarmed);
    assert!(host.events.contains(&Event::Disarmed(Reason::LinkLost)), "{:?}", host.events);
    assert!(controls.coil_pulses_us().is_empty());
}

/// Sends and reads nothing for three seconds of the board's time, however long these take.
fn silence(controls: &Controls, host: &mut SmallHost) {
    let (begun, end) = (Instant::now(), controls.seen().scans + 3 * u64::from(RATE));
    while controls.seen().scans < end {
        assert!(
            begun.elapsed() < Duration::from_mins(2),
            "the board's time stands still: {:?}",
            controls.seen()
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    host.pump();
}

/// Behaviour of a board whose front end fails for `scans` scans.
pub fn after_a_front_end_failure(host: &mut SmallHost, from: u64, scans: u64) {
    let end = from + scans + u64::from(RATE);
    host.until("the end of the failure", |host| host.latest >= end);
    let missing: u64 = host.gaps.iter().map(|(first, end)| end - first).sum();
    let status = host.status();
    assert_eq!(status.counters.scans_missed, missing, "what is missing is what was counted");
    // rounded to whole blocks
    assert!(missing > 0 && missing.abs_diff(scans) <= 24, "{missing} of {scans}");
    let told: u64 = host
        .events
        .iter()
        .map(|event| match event {
            Event::Lost { scans, .. } => u64::from(*scans),
            _ => 0,
        })
        .sum();
    assert_eq!(told, missing, "what is missing is what was told");
    assert!(host.events.contains(&Event::Disarmed(Reason::FrontEnd)), "{:?}", host.events);
    assert_eq!(status.hammer, Hammer::Disarmed);
    assert!(status.streaming && status.epoch == host.epoch, "no reset");
}

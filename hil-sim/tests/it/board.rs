//! Tests of the virtual board: the firmware's guarantees, observed from the link and from the rig's
//! side.
#![allow(clippy::unwrap_used)]

use crate::support;

use jointrig_hil_sim::board::{Options, VirtualBoard};
use jointrig_hil_sim::executor::Polling;
use jointrig_hil_sim::rig::RigConfig;
use jointrig_protocol::answer::{Answer, Hammer, Refusal};
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::frame::Kind;
use jointrig_protocol::hello::Hello;
use jointrig_protocol::limits::COIL_PULSE_CAP_US;
use jointrig_protocol::request::{Configuration, Request};
use jointrig_protocol::shot::Phase;
use support::{PULSE_US, SmallHost, scenarios};

fn board(seed: u64) -> (VirtualBoard, SmallHost) {
    with(&Options { seed, ..Options::default() })
}

fn with(options: &Options) -> (VirtualBoard, SmallHost) {
    let (board, link) = VirtualBoard::start_with(&RigConfig::default(), options).unwrap();
    (board, SmallHost::new(link))
}

fn scenario(options: &Options, dawdle: bool) -> Vec<Vec<i16>> {
    let (_board, mut host) = with(options);
    host.three_shots(dawdle)
}

#[test]
fn the_device_introduces_itself() {
    let (_board, mut host) = board(1);
    let Ok(Answer::Info(info)) = host.ask(Request::Info) else { panic!("no info") };
    assert_eq!((info.channels, info.scan_rate_hz, info.stage), (10, 51_200, true));
    assert!(info.ring_scans >= 51_200, "the ring holds a second");
    for index in 0..10 {
        assert!(matches!(host.ask(Request::Channel { index }), Ok(Answer::Channel(_))));
    }
    assert_eq!(host.ask(Request::Channel { index: 10 }), Err(Refusal::NoSuchChannel));
}

#[test]
fn a_host_of_another_schema_is_greeted_but_not_served() {
    let (_board, mut host) = board(1);
    let other = Hello { schema: 1, ..Hello::host(7) };
    host.hello = None;
    host.send(Kind::Hello, &other.to_bytes());
    host.until("a Hello", |host| host.hello.is_some());
    assert!(other.check(&host.hello.unwrap()).is_err());
    let request = jointrig_protocol::request::Numbered { number: 1, request: Request::Start };
    host.send(Kind::Request, postcard::to_slice(&request, &mut [0; 64]).unwrap());
    (0..20).for_each(|_| host.pump());
    assert!(host.codes.is_empty());
}

#[test]
fn a_shot_hits_with_the_force_that_its_pulse_is_for() {
    let (board, mut host) = board(3);
    host.start();
    let at = host.stage(Configuration::Ajb, "AZ3", "A3", 0);
    let shot = host.shoot(SmallHost::order(1, PULSE_US, at + host.lead()));
    assert_eq!(shot.phase, Phase::Done);
    // a few per cent of scatter around 50 N
    assert!((40.0..60.0).contains(&shot.peak_n), "{shot:?}");
    // above half of the peak for two thirds of 0.41 ms
    assert!((220.0..330.0).contains(&shot.width_us), "{shot:?}");
    assert!(shot.friction_peak_n > 5.0, "{shot:?}");
    assert_eq!(board.controls().coil_pulses_us(), [PULSE_US]);
}

#[test]
fn the_same_seed_gives_the_same_records_however_they_are_polled_and_however_slow_the_host() {
    let options = Options { seed: 11, ..Options::default() };
    let join = scenario(&options, false);
    assert_eq!(join, scenario(&options, true));
    assert_eq!(join, scenario(&Options { polling: Polling::Tasks, ..options.clone() }, false));
    assert_ne!(join, scenario(&Options { seed: 12, ..options }, false));
}

#[test]
fn the_board_never_runs_more_than_half_a_ring_ahead() {
    let (_board, mut host) = board(1);
    host.hold_at = 0;
    host.start();
    assert_eq!(host.first_scan, 0);
    let half = u64::from(host.hello.unwrap().ring_scans / 2);
    host.until("half a ring", |host| host.next_scan - host.first_scan >= half);
    (0..20).for_each(|_| host.pump());
    let status = host.status();
    assert!(status.next_scan - host.first_scan < half + 24, "{status:?}");
    assert_eq!(status.counters.scans_dropped, 0);
}

#[test]
fn nothing_moves_that_is_not_armed_or_not_bounded() {
    let (board, mut host) = board(1);
    let order = |number, pulse| Request::Fire(SmallHost::order(number, pulse, 0));
    assert_eq!(host.ask(Request::Arm { valid_ms: 1000 }), Err(Refusal::NotStreaming));
    assert_eq!(host.ask(order(1, 3000)), Err(Refusal::NotStreaming));
    host.start();
    assert_eq!(host.ask(order(1, 3000)), Err(Refusal::NotArmed));
    assert!(matches!(host.ask(Request::Arm { valid_ms: 0 }), Err(Refusal::OutOfBounds(_))));
    assert!(matches!(host.ask(Request::Arm { valid_ms: 60_001 }), Err(Refusal::OutOfBounds(_))));
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    let refused = Err(Refusal::PulseOutOfBounds { cap_us: COIL_PULSE_CAP_US });
    assert_eq!(host.ask(order(1, COIL_PULSE_CAP_US + 1)), refused);
    assert_eq!(host.ask(order(1, 0)), refused);
    assert!(board.controls().coil_pulses_us().is_empty());
}

#[test]
fn a_repeated_request_fires_once() {
    let (board, mut host) = board(1);
    host.start();
    let at = host.stage(Configuration::Ajb, "AZ3", "A3", 0);
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    let order = Request::Fire(SmallHost::order(5, PULSE_US, at + host.lead()));
    for _ in 0..3 {
        assert_eq!(host.ask_as(1000, order.clone()), Ok(Answer::Scheduled { number: 5 }));
    }
    let end = at + 2 * 51_200;
    host.release();
    host.until("two seconds", |host| host.next_scan >= end);
    assert_eq!(host.ask_as(1000, order.clone()), Ok(Answer::Scheduled { number: 5 }));
    assert_eq!(host.ask(order.clone()), Err(Refusal::NotArmed));
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    assert_eq!(host.ask(order), Err(Refusal::ShotRepeated { last: 5 }));
    assert_eq!(board.controls().coil_pulses_us().len(), 1);
}

#[test]
fn arming_expires_and_a_waiting_shot_is_cancelled_by_it() {
    let (board, mut host) = board(1);
    host.start();
    // the board may be half a ring ahead, and that must not use up the whole time for which the
    // arming is valid
    assert_eq!(host.ask(Request::Arm { valid_ms: 20_000 }), Ok(Answer::Done));
    let far = host.next_scan + 50 * 51_200;
    assert_eq!(host.ask(Request::Fire(SmallHost::order(1, 3000, far))), Ok(Answer::Scheduled { number: 1 }));
    let end = host.next_scan + 51_200 * 22;
    host.until("22 seconds", |host| host.next_scan >= end);
    let status = host.status();
    assert_eq!((status.hammer, status.shot.unwrap().phase), (Hammer::Disarmed, Phase::Cancelled));
    assert!(host.events.iter().any(|event| *event == Event::Disarmed(Reason::Expired)));
    assert!(board.controls().coil_pulses_us().is_empty());
}

#[test]
fn an_open_guard_or_a_pressed_stop_forbids_shots() {
    let (board, mut host) = board(1);
    host.start();
    let on = |host: &mut SmallHost| {
        let end = host.next_scan + 5_120;
        host.until("a tenth of a second", |host| host.next_scan >= end);
    };
    on(&mut host);
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    board.controls().open_guard(true);
    // the board may be half a ring ahead when the guard opens
    host.until("the guard to be noticed", |host| host.events.contains(&Event::Disarmed(Reason::Interlock)));
    assert_eq!(host.ask(Request::Arm { valid_ms: 1000 }), Err(Refusal::Interlock));
    board.controls().open_guard(false);
    host.until("the guard to be closed", |host| host.events.contains(&Event::Interlock(true)));
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    board.controls().press_emergency_stop(true);
    host.until("the stop to be noticed", |host| host.events.contains(&Event::EmergencyStop(true)));
    board.controls().press_emergency_stop(false);
    on(&mut host);
    assert_eq!(
        host.ask(Request::Arm { valid_ms: 1000 }),
        Err(Refusal::EmergencyStop),
        "released is not reset"
    );
    board.controls().reset();
    host.until("the reset", |host| host.events.contains(&Event::EmergencyStop(false)));
    assert_eq!(host.ask(Request::Arm { valid_ms: 1000 }), Ok(Answer::Done));
    assert!(board.controls().coil_pulses_us().is_empty());
}

#[test]
fn a_host_that_falls_silent_disarms_the_hammer() {
    // here time advances without the host, because this test covers link loss
    let (board, mut host) = with(&Options { seed: 1, free_running: true, ..Options::default() });
    host.start();
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    let far = host.next_scan + 40 * 51_200;
    // the silence may already have disarmed the board when the order arrives: both are safe
    let _ = host.ask(Request::Fire(SmallHost::order(1, 3000, far)));
    std::thread::sleep(std::time::Duration::from_millis(500));
    let status = host.status();
    assert_eq!(status.hammer, Hammer::Disarmed);
    assert!(board.controls().coil_pulses_us().is_empty());
}

#[test]
fn garbage_is_counted_and_harms_nothing() {
    let (_board, mut host) = board(1);
    host.start();
    let garbage: Vec<u8> = (0..40_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    for piece in garbage.chunks(1000) {
        host.send_raw(piece);
        host.pump();
    }
    host.send_raw(&[0]);
    let status = host.status();
    assert!(status.counters.frames_bad > 10, "{status:?}");
    assert_eq!(status.hammer, Hammer::Disarmed);
}

#[test]
fn hammer_and_shaker_keep_every_promise() {
    for scenario in scenarios::ALL {
        let (board, mut host) = board(3);
        scenario(board.controls(), &mut host);
        scenarios::the_coil_kept_its_cap(board.controls());
    }
}

#[test]
fn lost_scans_take_the_drive_away() {
    let (board, mut host) = board(3);
    let lose = |from, scans| board.controls().lose_scans(from, scans);
    scenarios::lost_scans_take_the_drive_away(lose, board.controls(), &mut host);
}

#[test]
fn a_host_that_is_gone_leaves_nothing_moving() {
    let (board, mut host) = with(&Options { seed: 1, free_running: true, ..Options::default() });
    scenarios::a_host_that_is_gone_leaves_nothing_moving(board.controls(), &mut host);
}

//! The emulated board: the firmware's binary gives the same records as the native board, and fails
//! safely.
//!
//! These tests need the image and QEMU; `cargo xtask test` builds the image and sets its path, and
//! installs QEMU. Without `JOINTRIG_MPS2_IMAGE` they print a message and pass.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

#[path = "it/support/mod.rs"]
mod support;

use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::time::Duration;

use jointrig_firmware::ad7606b::reader::Trouble;
use jointrig_hil_sim::board::qemu::{ConverterFault, Faults, QemuBoard, QemuError, Slip};
use jointrig_hil_sim::board::{Options, VirtualBoard};
use jointrig_hil_sim::rig::RigConfig;
use jointrig_protocol::answer::{self, Answer, Hammer, Refusal};
use jointrig_protocol::block::Block;
use jointrig_protocol::event::{Event, Loss, Reason};
use jointrig_protocol::frame::{Accumulator, Kind, encode};
use jointrig_protocol::hello::Hello;
use jointrig_protocol::limits::MAX_WIRE;
use jointrig_protocol::request::{Configuration, Numbered, Request};
use support::{SmallHost, image, scenarios};

fn board(seed: u64) -> Option<(QemuBoard, SmallHost)> {
    let (board, link) = QemuBoard::start(&image()?, None, seed).unwrap();
    Some((board, SmallHost::new(link)))
}

#[test]
fn the_binary_gives_the_native_boards_records_sample_for_sample() {
    let Some((emulated, mut host)) = board(11) else { return };
    let in_qemu = host.three_shots(false);
    let options = Options { seed: 11, ..Options::default() };
    let (native, link) = VirtualBoard::start_with(&RigConfig::elastic(), &options).unwrap();
    let natively = SmallHost::new(link).three_shots(false);
    assert_eq!(in_qemu, natively);
    assert_eq!(emulated.controls().coil_pulses_us(), native.controls().coil_pulses_us());
    let Some(image) = image() else { return };
    let (_board, link) = QemuBoard::start(&image, None, 11).unwrap();
    let mut host = SmallHost::reading(link, true);
    assert!(host.hello.unwrap().packets);
    assert_eq!(host.three_shots(false), natively, "packets carry the same");
    let Some((_other, mut host)) = board(12) else { return };
    assert_ne!(host.three_shots(false), natively, "another seed is another run");
}

#[test]
fn the_emulated_board_names_itself() {
    let Some((board, mut host)) = board(1) else { return };
    let Ok(Answer::Info(info)) = host.ask(Request::Info) else { panic!("no info") };
    assert_eq!(info.board, "mps2-an505");
    assert_eq!(info.target, "thumbv8m.main-none-eabihf");
    assert_eq!((info.channels, info.scan_rate_hz, info.stage), (10, 51_200, true));
    assert!(info.ring_scans >= 51_200, "the ring holds a second");
    let (native, link) = VirtualBoard::start(None, 1).unwrap();
    let mut other = SmallHost::new(link);
    for index in 0..info.channels {
        assert_eq!(host.ask(Request::Channel { index }), other.ask(Request::Channel { index }));
    }
    assert_eq!(host.hello.unwrap().schema, other.hello.unwrap().schema);
    drop((board, native));
}

#[test]
fn qemu_ends_with_its_board() {
    let Some((board, host)) = board(1) else { return };
    let process = PathBuf::from(format!("/proc/{}", board.process_id()));
    drop(board);
    assert!(!process.exists(), "the process is gone and reaped");
    drop(host);
}

#[test]
fn what_is_no_image_is_refused_with_a_reason() {
    if image().is_none() {
        return;
    }
    let refused = |path: &str| match QemuBoard::start(&PathBuf::from(path), None, 1) {
        Ok(_) => panic!("{path} started"),
        Err(error) => error,
    };
    assert!(matches!(refused("/nowhere/image"), QemuError::NoImage(_)));
    let message = refused("Cargo.toml").to_string();
    assert!(message.contains("did not start") && !message.contains('\n'), "{message}");
}

#[test]
fn a_stage_order_that_cannot_be_is_refused_through_the_firmware() {
    let Some((_board, mut host)) = board(1) else { return };
    host.start();
    let (impact, response) = ("NOWHERE".try_into().unwrap(), "B3".try_into().unwrap());
    let order =
        jointrig_protocol::request::Stage { configuration: Configuration::Ajb, impact, response, attempt: 0 };
    let Err(Refusal::Stage(sentence)) = host.ask(Request::Stage(order)) else { panic!("not refused") };
    assert!(sentence.contains("NOWHERE"), "{sentence}");
}

#[test]
fn a_flood_of_garbage_is_counted_and_harms_nothing() {
    let Some((board, mut host)) = board(1) else { return };
    host.start();
    let garbage: Vec<u8> = (0..400_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    for piece in garbage.chunks(20_000) {
        host.send_raw(piece);
        host.pump();
    }
    host.send_raw(&[0]);
    let status = host.status();
    assert!(status.counters.frames_bad > 100, "{status:?}");
    assert_eq!(status.hammer, Hammer::Disarmed);
    assert_eq!((board.failure(), board.controls().coil_pulses_us().len()), (None, 0));
}

/// Stalls the link for `scans` scans while the hammer is armed, then continues to read.
fn stalled(scans: u64) -> Option<(QemuBoard, SmallHost, u64)> {
    let (board, mut host) = board(5)?;
    host.start();
    // the board runs half a ring beyond this and not further, so the stall begins at a known scan
    let hold = host.first_scan + 51_200;
    host.hold_at = hold;
    host.until("a second", |host| host.next_scan >= hold);
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    let from = hold + host.lead() - 64 - 2_400;
    board.faults().stall_link(from, scans);
    host.hold_at = u64::MAX;
    host.acknowledge();
    let end = from + scans + 51_200;
    host.until("the stall's end", |host| host.latest >= end);
    Some((board, host, from))
}

#[test]
fn a_link_that_stalls_for_half_a_second_loses_nothing() {
    let Some((board, mut host, _)) = stalled(25_600) else { return };
    let status = host.status();
    assert_eq!(status.counters.scans_dropped, 0, "{status:?}");
    assert!(host.gaps.is_empty(), "{:?}", host.gaps);
    assert_eq!(status.hammer, Hammer::Armed, "half a second is no silence");
    assert_eq!(board.failure(), None);
}

#[test]
fn a_link_that_stalls_for_five_seconds_loses_what_is_reported_and_disarms() {
    let Some((board, mut host, from)) = stalled(256_000) else { return };
    let status = host.status();
    let lost: Vec<(u64, u64)> = host
        .events
        .iter()
        .filter_map(|event| match event {
            Event::Lost { first_scan, scans, why: Loss::LinkSlow, .. } => {
                Some((*first_scan, first_scan + u64::from(*scans)))
            }
            _ => None,
        })
        .collect();
    assert_eq!(lost, host.gaps, "what is missing is what was reported");
    let missing: u64 = lost.iter().map(|(first, end)| end - first).sum();
    assert_eq!(status.counters.scans_dropped, missing);
    assert!(missing > 150_000 && lost[0].0 >= from - 51_200, "{lost:?} from {from}");
    assert_eq!(status.hammer, Hammer::Disarmed);
    assert!(host.events.contains(&Event::Disarmed(Reason::LinkLost)), "{:?}", host.events);
    assert_eq!((status.epoch, status.streaming), (host.epoch, true), "no reset");
    assert_eq!((board.failure(), board.controls().coil_pulses_us().len()), (None, 0));
}

/// The board's final message after `fault`.
fn end_of(fault: impl FnOnce(&Faults)) -> Option<String> {
    let (board, mut host) = board(1)?;
    host.start();
    fault(board.faults());
    let mut link = host.into_link();
    let mut bytes = [0; 4096];
    while link.read(&mut bytes, Duration::from_secs(10)).is_ok_and(|count| count > 0) {}
    let error = link.read(&mut bytes, Duration::from_secs(10)).unwrap_err();
    assert_eq!(error.kind(), std::io::ErrorKind::BrokenPipe);
    assert!(board.controls().coil_pulses_us().is_empty());
    Some(board.failure().unwrap())
}

#[test]
fn a_panic_in_a_task_ends_the_board_with_its_sentence() {
    let Some(sentence) = end_of(Faults::panic) else { return };
    assert!(sentence.contains("the simulator asked for a panic"), "{sentence}");
}

#[test]
fn a_processor_fault_is_told_with_its_cause_and_address() {
    let Some(sentence) = end_of(Faults::fault_processor) else { return };
    assert!(
        sentence.contains("processor fault at 0x10") && sentence.contains("bus error at 0x70000000"),
        "{sentence}"
    );
}

#[test]
fn a_stack_that_overflows_is_told_and_overwrites_nothing() {
    let Some(sentence) = end_of(Faults::overflow_stack) else { return };
    assert!(sentence.contains("stack overflow"), "{sentence}");
}

#[test]
fn hammer_and_shaker_keep_every_promise() {
    for scenario in scenarios::ALL {
        let Some((board, mut host)) = board(3) else { return };
        scenario(board.controls(), &mut host);
        scenarios::the_coil_kept_its_cap(board.controls());
        assert_eq!(board.failure(), None);
    }
}

#[test]
fn lost_scans_take_the_drive_away() {
    for fault in [ConverterFault::Hung, ConverterFault::Noticed(Trouble::Silent(0, 0))] {
        let Some((board, mut host)) = board(3) else { return };
        let lose = |from, scans| board.faults().break_converters(fault, from, scans);
        scenarios::lost_scans_take_the_drive_away(lose, board.controls(), &mut host);
        assert_eq!(board.failure(), None);
    }
}

#[test]
fn a_host_that_is_gone_leaves_nothing_moving() {
    let Some(image) = image() else { return };
    let options = Options { seed: 1, free_running: true, ..Options::default() };
    let (board, link) = QemuBoard::start_with(&image, &RigConfig::default(), &options).unwrap();
    scenarios::a_host_that_is_gone_leaves_nothing_moving(board.controls(), &mut SmallHost::new(link));
    assert_eq!(board.failure(), None);
}

/// Breaks the converters of an armed board.
fn broken_converters(fault: ConverterFault, scans: u64) -> Option<SmallHost> {
    let (board, mut host) = board(7)?;
    host.start();
    host.hold_at = host.first_scan;
    assert_eq!(host.ask(Request::Arm { valid_ms: 60_000 }), Ok(Answer::Done));
    // a shot that waits for a scan that is lost in the failure
    let from = host.first_scan + 51_200;
    let order = Request::Fire(SmallHost::order(1, 3_000, from + 24));
    assert_eq!(host.ask(order), Ok(Answer::Scheduled { number: 1 }));
    board.faults().break_converters(fault, from, scans);
    host.release();
    scenarios::after_a_front_end_failure(&mut host, from, scans);
    assert_eq!((board.failure(), board.controls().coil_pulses_us().len()), (None, 0));
    Some(host)
}

#[test]
fn converters_that_fail_disarm_and_are_reported() {
    // silent for a second; one corrupt scan, which costs its block; late by a few blocks
    for (trouble, scans) in [(Trouble::Silent(0, 0), 51_200), (Trouble::Crc, 24), (Trouble::Overrun, 240)] {
        let Some(host) = broken_converters(ConverterFault::Noticed(trouble), scans) else { return };
        let words = trouble.to_string();
        let told = |event: &&Event| matches!(event, Event::Fault(text) if text.as_str() == words);
        assert_eq!(host.events.iter().filter(told).count(), 1, "told once: {:?}", host.events);
    }
}

#[test]
fn converters_that_hang_the_board_disarm_it_too() {
    let Some(host) = broken_converters(ConverterFault::Hung, 102_400) else { return };
    let at = |wanted: &Event| host.events.iter().position(|event| event == wanted);
    let lost = host.events.iter().position(|event| matches!(event, Event::Lost { .. }));
    assert!(at(&Event::Disarmed(Reason::FrontEnd)) < lost, "while it hangs, not after it");
}

#[test]
fn the_uart_is_a_link_too() {
    let Some(image) = image() else { return };
    let socket = std::env::temp_dir().join(format!("jointrig-uart-{}", std::process::id()));
    let uart = Some(format!("unix:{},server=on,wait=off", socket.display()));
    let options = Options { seed: 1, uart, ..Options::default() };
    let (board, _link) = QemuBoard::start_with(&image, &RigConfig::default(), &options).unwrap();
    let mut line = UnixStream::connect(&socket).unwrap();
    line.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
    let mut wire = [0; MAX_WIRE];
    line.write_all(encode(Kind::Hello, &Hello::host(5).to_bytes(), &mut wire).unwrap()).unwrap();
    let (mut accumulator, mut heard, mut bytes) = (Accumulator::new(), Vec::new(), [0; 512]);
    let mut number = 0;
    let mut ask = |line: &mut UnixStream, request: Request| {
        number += 1;
        let mut bytes = [0; 64];
        let numbered = postcard::to_slice(&Numbered { number, request }, &mut bytes).unwrap();
        line.write_all(encode(Kind::Request, numbered, &mut [0; MAX_WIRE]).unwrap()).unwrap();
    };
    // the handshake, a reply, and a second of samples that have not been acknowledged
    let mut scans = 0;
    while scans < 20_000 {
        let count = line.read(&mut bytes).unwrap();
        let mut rest = &bytes[..count];
        while !rest.is_empty() {
            let (used, frame) = accumulator.feed(rest);
            rest = &rest[used..];
            let Some(frame) = frame else { continue };
            let frame = frame.unwrap();
            match frame.kind {
                Kind::Hello => {
                    assert_eq!(Hello::from_bytes(frame.payload).unwrap().session, 5);
                    ask(&mut line, Request::Info);
                }
                Kind::Answer => {
                    heard.push(
                        postcard::from_bytes::<answer::Numbered>(frame.payload).unwrap().outcome.unwrap(),
                    );
                    if heard.len() == 1 {
                        ask(&mut line, Request::Start);
                    }
                }
                Kind::Samples => scans += u32::from(Block::from_payload(frame.payload).unwrap().header.scans),
                _ => {}
            }
        }
    }
    assert!(matches!(&heard[..], [Answer::Info(info), Answer::Started { .. }] if info.board == "mps2-an505"));
    drop(board);
    // created by QEMU
    let _ = std::fs::remove_file(socket);
}

/// Converters that lose alignment, in every way and with a program that appears late: misaligned
/// data is never sent.
#[test]
fn converters_out_of_step_are_found_before_anything_is_sent() {
    let options = Options { seed: 7, ..Options::default() };
    let (_native, link) = VirtualBoard::start_with(&RigConfig::default(), &options).unwrap();
    let mut host = SmallHost::new(link);
    let end = 150_000;
    let undisturbed = {
        host.start();
        host.until("three seconds", |host| host.next_scan >= end);
        host.codes
    };
    let from = 90_007;
    let lags = [[9, 0], [0, 9], [-9, 0], [0, -9], [9, 9], [-9, 9], [18, 0], [0, 45], [1, 0], [0, -1], [4, 0]];
    for (number, lags) in lags.into_iter().enumerate() {
        let Some((board, mut host)) = board(7) else { return };
        let late = [0, 1, 5, 23, 24, 70, 120, 170, 400, 2, 0][number];
        board.faults().break_converters(ConverterFault::Slips(Slip { lags, late }), from, 240);
        host.start();
        let mut before = Vec::new();
        host.until("the stream's end", |host| {
            if host.gaps.is_empty() {
                before.clone_from(&host.codes);
            }
            host.latest >= end
        });
        let told = |event: &&Event| matches!(event, Event::Fault(text) if text.contains("out of step") || text.contains("too late"));
        assert_eq!(host.events.iter().filter(told).count(), 1, "{lags:?}, {late}: {:?}", host.events);
        let &[(first, gap_end)] = &host.gaps[..] else { panic!("{lags:?}: {:?}", host.gaps) };
        // the block with the slip, and what passed until the program read the rings
        assert!((first..gap_end).contains(&from), "{lags:?}: {first} to {gap_end}");
        assert!(
            from - first < 24 && gap_end - from <= u64::from(late) + 3 * 24,
            "{lags:?}: {first} to {gap_end}"
        );
        let channels = host.channels;
        assert!(
            before.len() > 60_000 * channels && before[..] == undisturbed[..before.len()],
            "{lags:?}: before it"
        );
        let after = (end - gap_end) as usize * channels;
        let due = &undisturbed[gap_end as usize * channels..];
        assert!(host.codes[..after] == due[..after], "{lags:?}: after it");
        assert_eq!(board.failure(), None);
    }
}

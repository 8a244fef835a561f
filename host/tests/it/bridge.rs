//! A recorder of 64 channels at a rate that is no integer, behind a bridge.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use jointrig::device::address::Address;
use jointrig::device::error::DeviceError;
use jointrig::device::samples::ChannelView;
use jointrig::device::session::Session;
use jointrig::exchange::units::{Dimension, Unit};

use jointrig_protocol::answer::Hammer;
use jointrig_protocol::channel::{Quantity, Role};
use jointrig_protocol::request::{Control, Fire, Shake};
use std::fmt::Write as _;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

const CHANNELS: usize = 64;
const RATE_HZ: f64 = 51_200.0 / 3.0;

/// A code that tells its scan and channel.
fn code(scan: usize, channel: usize) -> i32 {
    let count = i32::try_from((scan * 64 + channel) % 60_000).expect("small");
    // the lower bits differ from code to code as well
    (count - 30_000) * 277
}

/// Three seconds of 24-bit codes in blocks of 1000 scans.
fn stream() -> Vec<u8> {
    let mut line = format!(
        r#"{{"jointrig_bridge":1,"board":"two dozen boxes","serial":"7","rate_hz":{RATE_HZ:?},"sample":"i32","bits":24,"held":true,"channels":["#
    );
    for channel in 0..CHANNELS {
        let role = if channel == 0 { "hammer_force" } else { "auxiliary" };
        write!(line, r#"{{"name":"c{channel}","role":"{role}","unit":"N","full_scale":5000}},"#).unwrap();
    }
    line.pop();
    let mut bytes = format!("{line}]}}\n").into_bytes();
    for block in 0..51 {
        bytes.extend(jointrig_bridge::blocks::head(1000, 0, false));
        for scan in block * 1000..(block + 1) * 1000 {
            bytes.extend((0..CHANNELS).flat_map(|channel| code(scan, channel).to_le_bytes()));
        }
    }
    bytes
}

#[test]
fn sixty_four_channels_at_a_rational_rate() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stream");
    std::fs::write(&path, stream()).unwrap();
    let address = format!("bridge:cat {}", path.display());
    let transport = address.parse::<Address>().unwrap().open(0).unwrap();
    let mut session = Session::open(transport, &address).unwrap();
    let info = session.info().unwrap();
    assert_eq!((info.board.as_str(), info.serial.as_str()), ("two dozen boxes", "7"));
    assert_eq!((info.coil_cap_us, info.drive_v, info.stage), (0, 0.0, false));
    let map = session.channels(&info).unwrap();
    assert_eq!((map.len(), map.rate_hz, map.exact_hz), (CHANNELS, 17_067, Some(RATE_HZ)));
    assert_eq!((map.channels[0].role, map.channels[0].quantity), (Role::HammerForce, Quantity::Force));
    assert_eq!(map.full_scale(63), Some(5000.0));
    // all channels are calibrated in one request
    let mut other = map.clone();
    other.channels.iter_mut().for_each(|channel| channel.units_per_volt *= 1.01);
    session.calibrate(&map, &other).unwrap();

    let (_, first) = session.start(&map).unwrap();
    assert_eq!(first, 0, "a source that is held begins with the stream");
    session.wait_for(20_000).unwrap();
    let (samples, gaps) = session.cut(0..20_000).unwrap();
    assert!(gaps.is_empty(), "{gaps:?}");
    for channel in [0, 1, 31, 63] {
        let ChannelView::I32(codes) = samples.channel(channel) else { panic!("codes of 24 bits") };
        let wanted: Vec<i32> = (0..20_000).map(|scan| code(scan, channel)).collect();
        assert!(codes == wanted, "channel {channel}");
    }
    assert_eq!(session.recorder().unwrap().longest_block, 1000);

    // it moves nothing
    let refused = |done: Result<(), DeviceError>| matches!(done, Err(DeviceError::Refused { .. }));
    assert!(refused(session.arm(1000)));
    let fire = Fire {
        number: 1,
        pulse_us: 1,
        not_before: 0,
        quiet_limits: std::iter::empty().collect(),
        quiet_window: 0,
        quiet_patience: 0,
    };
    assert!(refused(session.fire(fire)));
    let shake = Shake {
        step: 1 << 20,
        control: Control::Drive,
        amplitude_v: 0.1,
        slew_v_per_s: 0.1,
        valid_ms: 1000,
        limits: std::iter::empty().collect(),
    };
    assert!(refused(session.shake(shake)));
    assert_eq!(session.finish().unwrap().lost, 0);
}

/// The bridge has a table of its own, because it does not depend on this crate.
#[test]
fn units_mean_the_same_over_the_bridge_and_in_files() {
    for (label, quantity, si) in jointrig_bridge::header::UNITS {
        let dimension = match quantity {
            Quantity::Force => Dimension::FORCE,
            Quantity::Velocity => Dimension::VELOCITY,
            Quantity::Displacement => Dimension::DISPLACEMENT,
            Quantity::Acceleration => Dimension::ACCELERATION,
            // a voltage is no quantity of a file
            Quantity::Voltage => continue,
        };
        let unit = Unit::parse(label, &[dimension]).unwrap();
        assert!((unit.factor / si - 1.0).abs() < 1e-15, "{label}: {} and {si}", unit.factor);
    }
}

/// A program with a hammer at the other end of a socket: zeros in blocks of 20 ms, and the lines
/// that it is sent, each with its time, until they end.
fn hammer_program(shortest_pause_s: f64) -> (String, JoinHandle<Vec<(f64, String)>>) {
    const RATE_HZ: u64 = 5_000;
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("bridge:tcp:{}", listener.local_addr().unwrap());
    let program = std::thread::spawn(move || {
        let (mut peer, _) = listener.accept().unwrap();
        let header = format!(
            r#"{{"jointrig_bridge":1,"board":"b","serial":"s","rate_hz":{RATE_HZ},"sample":"i16","hammer":{{"longest_us":5000,"shortest_pause_s":{shortest_pause_s}}},"channels":[{{"name":"force","role":"hammer_force","unit":"N","full_scale":200}}]}}"#
        );
        peer.write_all(format!("{header}\n").as_bytes()).unwrap();
        let begun = Instant::now();
        let reader = BufReader::new(peer.try_clone().unwrap());
        let lines = std::thread::spawn(move || {
            let lines = reader.lines().map_while(Result::ok);
            lines.map(|line| (begun.elapsed().as_secs_f64(), line)).collect()
        });
        let block = RATE_HZ / 50;
        let mut bytes = jointrig_bridge::blocks::head(u32::try_from(block).unwrap(), 0, false).to_vec();
        bytes.resize(bytes.len() + 2 * block as usize, 0);
        // the host ends the connection
        for count in 1.. {
            std::thread::sleep((begun + count * Duration::from_millis(20)).duration_since(Instant::now()));
            if peer.write_all(&bytes).is_err() {
                break;
            }
        }
        lines.join().unwrap()
    });
    (address, program)
}

fn opened(address: &str) -> Session {
    let transport = address.parse::<Address>().unwrap().open(0).unwrap();
    let mut session = Session::open(transport, address).unwrap();
    let info = session.info().unwrap();
    let map = session.channels(&info).unwrap();
    session.start(&map).unwrap();
    session
}

fn pulse(number: u32, pulse_us: u32) -> Fire {
    Fire {
        number,
        pulse_us,
        not_before: 0,
        quiet_limits: std::iter::empty().collect(),
        quiet_window: 0,
        quiet_patience: 60_000,
    }
}

/// Reads for so long, and tells the device that the host is there.
fn attend(session: &mut Session, seconds: f64) {
    let until = Instant::now() + Duration::from_secs_f64(seconds);
    while Instant::now() < until {
        session.status().unwrap();
        session.pump(Duration::from_millis(20)).unwrap();
    }
}

/// The same until the hammer is disarmed: a busy machine takes longer than any fixed time.
fn attend_until_disarmed(session: &mut Session) {
    let until = Instant::now() + Duration::from_mins(1);
    while session.status().unwrap().hammer != Hammer::Disarmed {
        assert!(Instant::now() < until, "the hammer is not disarmed");
        session.pump(Duration::from_millis(20)).unwrap();
    }
}

/// Their words, without those that only say that the host is there.
fn orders(lines: &[(f64, String)]) -> Vec<&str> {
    lines.iter().map(|(_, line)| line.as_str()).filter(|line| !line.contains("alive")).collect()
}

const ARMED: &str = r#"{"armed": true}"#;
const DISARMED: &str = r#"{"armed": false}"#;

#[test]
fn a_hammer_behind_a_bridge_is_fired_only_when_armed_within_its_bounds() {
    let (address, program) = hammer_program(1.5);
    let mut session = opened(&address);
    assert_eq!(session.info().unwrap().coil_cap_us, 5000);
    let refused = |done: Result<(), DeviceError>, word: &str| {
        let said = done.unwrap_err().to_string();
        assert!(said.contains(word), "{said}");
    };
    refused(session.fire(pulse(1, 3500)), "not armed");
    session.arm(60_000).unwrap();
    refused(session.fire(pulse(1, 5001)), "5000");
    session.fire(pulse(1, 5000)).unwrap();
    // no force follows: the bolt counts as missed after 0.1 s, and the host may order the next one
    attend_until_disarmed(&mut session);
    refused(session.fire(pulse(2, 3500)), "not armed");
    session.arm(60_000).unwrap();
    // the device holds the order until the coil has rested
    session.fire(pulse(2, 3500)).unwrap();
    attend_until_disarmed(&mut session);
    session.arm(60_000).unwrap();
    session.disarm().unwrap();
    session.finish().unwrap();
    drop(session);
    let lines = program.join().unwrap();
    let first = r#"{"fire_us": 5000, "sequence": 1}"#;
    let second = r#"{"fire_us": 3500, "sequence": 2}"#;
    let told = orders(&lines);
    assert_eq!(told[..6], [ARMED, first, DISARMED, ARMED, second, DISARMED], "{told:?}");
    // The program reads the state every 20 ms and can miss the last arming. It can also lose the
    // last line, because the host then closes the connection, which disarms as well.
    assert!(matches!(told[6..], [] | [ARMED] | [ARMED, DISARMED]), "{told:?}");
    let time = |wanted: &str| lines.iter().find(|(_, line)| line == wanted).unwrap().0;
    assert!(time(second) - time(first) > 1.5, "{lines:?}");
    // while the second order waited for the pause
    assert!(lines.iter().filter(|(_, line)| line.contains("alive")).count() >= 3, "{lines:?}");
}

#[test]
fn a_hammer_behind_a_bridge_is_off_when_the_host_is_gone() {
    // it hangs: nothing is read or written
    let (address, program) = hammer_program(0.6);
    let mut session = opened(&address);
    session.arm(60_000).unwrap();
    session.fire(Fire { not_before: 1_000_000, ..pulse(1, 3500) }).unwrap();
    std::thread::sleep(Duration::from_secs(2));
    assert_eq!(session.status().unwrap().hammer, Hammer::Disarmed);
    drop(session);
    let lines = program.join().unwrap();
    assert_eq!(orders(&lines), [ARMED, DISARMED]);
    let held_s = lines.last().unwrap().0 - lines[0].0;
    assert!((0.9..1.6).contains(&held_s), "armed for {held_s} s");

    // it ends: the device disarms, and the connection is closed in any case
    let (address, program) = hammer_program(0.6);
    let mut session = opened(&address);
    session.arm(60_000).unwrap();
    session.fire(Fire { not_before: 1_000_000, ..pulse(1, 3500) }).unwrap();
    attend(&mut session, 0.1);
    drop(session);
    let lines = program.join().unwrap();
    assert!(matches!(orders(&lines)[..], [ARMED] | [ARMED, DISARMED]), "{lines:?}");
}

//! A recorder of 64 channels at a rate that is no integer, behind a bridge.
#![cfg(unix)]
#![allow(clippy::unwrap_used)]

use jointrig::device::address::Address;
use jointrig::device::error::DeviceError;
use jointrig::device::samples::ChannelView;
use jointrig::device::session::Session;
use jointrig::exchange::units::{Dimension, Unit};

use jointrig_protocol::channel::{Quantity, Role};
use jointrig_protocol::request::{Control, Fire, Shake};
use std::fmt::Write;

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

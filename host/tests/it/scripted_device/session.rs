//! A session reconstructs the same samples whatever the link does, and reports what is wrong with a
//! device.

use std::time::Duration;

use crate::scripted_device::fake::{Fake, RING};
use crate::scripted_device::faulty::{Faults, Faulty};
use jointrig::device::logs::Tables;
use jointrig::device::samples::Samples;
use jointrig::device::session::Session;
use jointrig::device::stream::Accounts;
use jointrig::device::transport::Transport;
use jointrig_logs::example::{WARNING, image, line};
use jointrig_logs::file_name;
use jointrig_protocol::hello::Hello;
use jointrig_protocol::request::Fire;
use jointrig_protocol::sync::Clock;

fn open(transport: impl Transport + 'static) -> Session {
    Session::open(Box::new(transport), "fake:").expect("it answers")
}

/// Streams, fires once, and returns the samples around the trigger and the final counts.
fn measure(transport: impl Transport + 'static) -> (Samples, Accounts, u64) {
    let mut session = open(transport);
    let info = session.info().expect("info");
    let map = session.channels(&info).expect("channels");
    let (_, first) = session.start(map.len()).expect("start");
    session.hold_acknowledgement(Some(first));
    session.arm(1_000).expect("arm");
    let not_before = first + u64::from(RING);
    let fire = Fire {
        number: 1,
        pulse_us: 3_000,
        not_before,
        quiet_limits: [].into_iter().collect(),
        quiet_window: 0,
        quiet_patience: 0,
    };
    session.fire(fire).expect("fire");
    session.hold_acknowledgement(None);
    session.wait_for(not_before + 2_000).expect("scans");
    let status = session.status().expect("status");
    let trigger = status.shot.expect("a shot").trigger;
    session.wait_for(trigger + 40_000).expect("scans");
    let (samples, gaps) = session.cut(trigger - 256..trigger + 40_000).expect("a stream");
    assert!(gaps.is_empty(), "{gaps:?}");
    let accounts = session.finish().expect("the end");
    (samples, accounts, session.frames().1)
}

#[test]
fn a_faulty_link_gives_the_same_samples_and_every_scan_is_accounted_for() {
    let (clean, accounts, bad) = measure(Fake::default());
    assert_eq!((accounts.unexplained(), accounts.recovered, accounts.lost, bad), (0, 0, 0, 0));
    for seed in 0..3 {
        let faults = Faults { drop: 0.02, corrupt: 0.02, duplicate: 0.02, truncate: 0.01 };
        let (spoilt, accounts, bad) = measure(Faulty::new(Fake::default(), faults, seed));
        assert!(clean == spoilt, "seed {seed}: other samples");
        assert_eq!((accounts.unexplained(), accounts.lost), (0, 0), "{accounts:?}");
        assert!(accounts.recovered > 0 && bad > 0, "{accounts:?}, {bad} bad frames");
    }
}

/// Log frames in the stream, with all kinds of content.
fn logs() -> Vec<Vec<u8>> {
    let garbage = |seed: u32| {
        (0..400_u32).map(|i| (i.wrapping_add(seed).wrapping_mul(2_654_435_761) >> 13) as u8).collect()
    };
    let mut says: Vec<Vec<u8>> = (0..20).map(garbage).collect();
    says.extend([vec![], vec![0; 400], line(WARNING, 3, &[7, 0, 0, 0])]);
    says
}

#[test]
fn log_frames_of_any_content_change_no_sample() {
    let (clean, ..) = measure(Fake::default());
    let (spoken, accounts, bad) = measure(Fake::scripted(|fake| fake.says = logs()));
    assert!(clean == spoken, "other samples");
    assert_eq!((accounts.unexplained(), accounts.lost, bad), (0, 0, 0));
}

#[test]
fn a_log_is_read_by_the_table_of_the_build_and_counted_without_one() {
    let folder = tempfile::tempdir().expect("a folder");
    // the build that the scripted device names
    std::fs::write(folder.path().join(file_name(1)), image(1)).expect("written");
    for (folders, text) in [(vec![folder.path().into()], Some("WARN 0.000003 pressure 7")), (vec![], None)] {
        let encoded = line(WARNING, 3, &[7, 0, 0, 0]);
        let mut session = open(Fake::scripted(|fake| fake.says = vec![encoded.clone()]));
        session.look_for_log_tables(Tables::in_folders(folders));
        session.status().expect("status");
        assert!(session.log_lines().is_empty(), "which build it is, nobody knows yet");
        session.info().expect("info");
        session.status().expect("status");
        let (lines, undecoded) = (session.log_lines(), session.undecoded_log_bytes());
        match text {
            Some(text) => assert_eq!((lines, undecoded), (vec![text.to_owned(); 3], 0)),
            None => assert_eq!((lines.len(), undecoded), (0, 3 * encoded.len() as u64)),
        }
    }
}

#[test]
fn what_the_device_lost_is_a_range_and_explained() {
    let drops = 9_600..9_696;
    for seed in [None, Some(3)] {
        let fake = Fake::scripted(|fake| fake.drops = drops.clone());
        let transport: Box<dyn Transport> = match seed {
            None => Box::new(fake),
            Some(seed) => Box::new(Faulty::new(fake, Faults { drop: 0.03, ..Faults::default() }, seed)),
        };
        let mut session = open(transport);
        session.start(5).expect("start");
        session.wait_for(20_000).expect("scans");
        let (_, gaps) = session.cut(9_000..20_000).expect("a stream");
        assert!(gaps.len() == 1 && gaps[0] == (600..696), "{gaps:?}");
        let accounts = session.finish().expect("the end");
        assert_eq!((accounts.lost, accounts.unexplained()), (96, 0), "{accounts:?}");
    }
}

#[test]
fn the_device_never_passes_half_a_ring_beyond_a_held_acknowledgement() {
    let mut session = open(Fake::default());
    session.start(5).expect("start");
    session.hold_acknowledgement(Some(5_000));
    session.wait_for(8_000).expect("half a ring more");
    for _ in 0..20 {
        session.pump(Duration::from_millis(1)).expect("pump");
    }
    let next = session.status().expect("status").next_scan;
    assert!(next <= 5_000 + u64::from(RING) / 2, "{next}");
}

#[test]
fn another_version_is_refused_and_both_are_named() {
    let other = Hello { major: 9, ..Fake::default().hello };
    let refused = Session::open(Box::new(Fake::scripted(|fake| fake.hello = other)), "serial:/dev/x");
    let said = refused.err().expect("refused").to_string();
    assert!(said.contains("serial:/dev/x") && said.contains("version 1 here, 9 there"), "{said}");
}

#[test]
fn refusals_say_who_and_why() {
    let mut session = open(Fake::default());
    let fire = Fire {
        number: 1,
        pulse_us: 1,
        not_before: 0,
        quiet_limits: [].into_iter().collect(),
        quiet_window: 0,
        quiet_patience: 0,
    };
    let said = session.fire(fire).expect_err("not armed").to_string();
    assert!(said.contains("fake:") && said.contains("not armed"), "{said}");
}

#[test]
fn a_controller_of_an_older_protocol_is_not_told_scales_and_is_asked_for_nothing_slow() {
    let older = |fake: &mut Fake| fake.hello = Hello { minor: 0, schema: 1, ..fake.hello };
    let mut session = open(Fake::scripted(older));
    assert_eq!(session.slow().expect("nothing is asked"), None);
    let info = session.info().expect("info");
    let device = session.channels(&info).expect("channels");
    session.calibrate(&device, &device).expect("what is not calibrated needs no telling");
    let mut calibrated = device.clone();
    calibrated.channels[0].units_per_volt *= 1.03;
    let refused = session.calibrate(&device, &calibrated).expect_err("it cannot be told").to_string();
    assert!(
        refused.contains("speaks protocol 1.0") && refused.contains("flash firmware of protocol 1.1"),
        "{refused}"
    );
    // a device that supports it receives the scales, and receives them again when the first scales
    // apply again
    let mut session = open(Fake::default());
    session.info().expect("info");
    session.calibrate(&device, &calibrated).expect("told");
    session.calibrate(&device, &device).expect("told again");
}

#[test]
fn a_controller_of_an_older_protocol_is_refused_by_a_plan_with_sync_and_asked_for_nothing_otherwise() {
    let older = |fake: &mut Fake| fake.hello = Hello { minor: 1, schema: 1, ..fake.hello };
    let mut session = open(Fake::scripted(older));
    assert_eq!(session.sync().expect("nothing is asked"), None);
    let refused = session.take_clock(Clock::Internal).expect_err("it knows of no clock").to_string();
    assert!(
        refused.contains("speaks protocol 1.1") && refused.contains("flash firmware of protocol 1.2"),
        "{refused}"
    );
    // one that knows the request but has no sync port reports this
    let refused = open(Fake::default()).take_clock(Clock::External { rate_hz: 48_000 }).expect_err("no port");
    assert!(refused.to_string().contains("cannot do that"), "{refused}");
}

//! The shaker under control, on the simulated rig: the amplitude that was ordered is the one that the structure has.
#![allow(clippy::unwrap_used)]

mod support;

use jointrig_hil_sim::board::VirtualBoard;
use jointrig_hil_sim::rig::{Rig, RigConfig};
use jointrig_protocol::answer::Answer;
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::request::{Control, Request, Shake};
use support::SmallHost;

const RATE: u32 = 51_200;
/// Places of the two single-point vibrometers in a scan.
const LDV: [usize; 2] = [4, 5];

fn order(frequency_hz: f64, control: Control) -> Shake {
    Shake {
        step: Shake::step_of(frequency_hz, RATE),
        control,
        amplitude_v: 10.0,
        slew_v_per_s: 20.0,
        valid_ms: 60_000,
        limits: heapless::Vec::new(),
    }
}

/// Amplitude (m) of the specimens' relative displacement in the last `scans` scans, whole cycles of `frequency_hz`.
fn relative_m(host: &SmallHost, frequency_hz: f64, scans: usize) -> f64 {
    let rig = Rig::new(&RigConfig::default(), 1).unwrap();
    let unit = LDV.map(|place| {
        let channel = &rig.channels()[place];
        channel.units_per_volt * f64::from(channel.polarity) * channel.range_v / 32_768.0
    });
    let codes = &host.codes[host.codes.len() - scans * host.channels..];
    let (mut re, mut im) = (0.0, 0.0);
    for (i, scan) in codes.chunks(host.channels).enumerate() {
        let velocity = f64::from(scan[LDV[0]]) * unit[0] - f64::from(scan[LDV[1]]) * unit[1];
        let angle = std::f64::consts::TAU * frequency_hz * i as f64 / f64::from(RATE);
        re += velocity * angle.cos();
        im += velocity * angle.sin();
    }
    2.0 * re.hypot(im) / scans as f64 / (std::f64::consts::TAU * frequency_hz)
}

#[test]
fn the_specimens_move_as_far_as_was_ordered() {
    for (frequency_hz, amplitude_m) in
        [(100.0, 2e-7_f32), (200.0, 1e-7), (250.0, 1.5e-7), (300.0, 2e-7), (500.0, 1e-7)]
    {
        let (_board, link) = VirtualBoard::start(None, 4).unwrap();
        let mut host = SmallHost::new(link);
        host.start();
        let shake = order(frequency_hz, Control::Displacement { amplitude_m });
        assert_eq!(host.ask(Request::Shake(shake)), Ok(Answer::Done));
        // windows of 0.1 s, from the first order on
        let mut amplitudes = Vec::new();
        for _ in 0..80 {
            host.go_on(5_120);
            amplitudes.push(relative_m(&host, frequency_hz, 5_120) / f64::from(amplitude_m));
        }
        let most = amplitudes.iter().copied().fold(0.0, f64::max);
        assert!(most < 1.2, "{frequency_hz} Hz, {amplitude_m} m: {amplitudes:?}");
        let settled = &amplitudes[60..];
        assert!(
            settled.iter().all(|ratio| (ratio - 1.0).abs() < 0.02),
            "{frequency_hz} Hz, {amplitude_m} m: {amplitudes:?}"
        );
        let measured = f64::from(host.status().controlled / amplitude_m);
        assert!((measured - 1.0).abs() < 0.02, "{measured}");
        assert!(!host.events.iter().any(|event| matches!(event, Event::ShakerStops(_))));
    }
}

#[test]
fn an_amplitude_out_of_reach_is_told_and_ends_in_a_ramp() {
    let (_board, link) = VirtualBoard::start(None, 4).unwrap();
    let mut host = SmallHost::new(link);
    host.start();
    // a thousandth of a volt is 0.04 N
    let weak = Shake { amplitude_v: 1e-3, ..order(250.0, Control::Displacement { amplitude_m: 2e-7 }) };
    assert_eq!(host.ask(Request::Shake(weak)), Ok(Answer::Done));
    host.until("rest", |host| host.events.contains(&Event::ShakerRests));
    assert!(host.events.contains(&Event::ShakerStops(Reason::Weak)), "{:?}", host.events);
}

#[test]
fn the_force_can_be_held_too() {
    let (_board, link) = VirtualBoard::start(None, 4).unwrap();
    let mut host = SmallHost::new(link);
    host.start();
    let shake = order(250.0, Control::Force { amplitude_n: 20.0 });
    assert_eq!(host.ask(Request::Shake(shake)), Ok(Answer::Done));
    host.go_on(6 * u64::from(RATE));
    let status = host.status();
    assert!((status.controlled / 20.0 - 1.0).abs() < 0.02, "{status:?}");
    // 40 N per V
    assert!((status.drive_v - 0.5).abs() < 0.02, "{status:?}");
}

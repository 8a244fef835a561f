//! The benchmark's script: the host's requests and the rig's data, in order.

use heapless::Vec;
use jointrig_protocol::channel::Name;
use jointrig_protocol::limits::MAX_CHANNELS;
use jointrig_protocol::request::{Configuration, Control, Fire, Request, Shake, Stage, Trigger};

/// Scans per second.
pub const RATE_HZ: u32 = 51_200;

/// One step of the script.
pub enum Step {
    /// The handshake, with this session.
    Greet(u32),
    /// One request, with the name of its figure.
    Ask(&'static str, Request),
    /// Blocks of noise; the figure is per scan.
    Stream(&'static str, u32),
    /// One block with contact in its force channel.
    Contact(&'static str),
    /// One block with the guard open.
    Guard(&'static str),
}

/// The session of a host on the vendor interface, which reads packets.
pub const VENDOR: u32 = 7;

/// The script, by number.
pub fn step(number: usize) -> Option<Step> {
    let fire = |number, watched: usize| {
        let mut quiet_limits = Vec::new();
        for channel in 0..MAX_CHANNELS {
            // far below the noise, so that the structure is never quiet
            let _ = quiet_limits.push(if (1..=watched).contains(&channel) { 1e-12 } else { 0.0 });
        }
        let quiet_window = if watched == 0 { 0 } else { 256 };
        let order = Fire {
            number,
            pulse_us: 3_000,
            not_before: 0,
            quiet_limits,
            quiet_window,
            quiet_patience: u32::MAX,
        };
        Request::Fire(order)
    };
    let trigger = Trigger { level_n: 1.0, flight_scans: 51_200, listen_scans: 3_800, hold_off_scans: 256 };
    let place =
        Stage { configuration: Configuration::Ajb, impact: text("AZ3"), response: text("B4"), attempt: 2 };
    let arm = Request::Arm { valid_ms: 60_000 };
    let mut limits = Vec::new();
    for limit in [0.0, 0.0, 0.0, 0.0, 0.5, 0.5] {
        let _ = limits.push(limit);
    }
    let shake = Shake {
        step: Shake::step_of(200.0, RATE_HZ),
        control: Control::Drive,
        amplitude_v: 5.0,
        slew_v_per_s: 100.0,
        valid_ms: 60_000,
        limits,
    };
    Some(match number {
        0 => Step::Greet(VENDOR),
        1 => Step::Ask("info", Request::Info),
        2 => Step::Ask("channel", Request::Channel { index: 3 }),
        3 => Step::Ask("status", Request::Status),
        4 => Step::Ask("trigger", Request::Trigger(trigger)),
        5 => Step::Ask("load_cells", Request::LoadCells { matrix: [1.0; 9] }),
        6 => Step::Ask("stage", Request::Stage(place)),
        7 => Step::Ask("start", Request::Start),
        8 => Step::Stream("scan.steady", 3_414),
        9 => Step::Ask("arm", arm),
        10 => Step::Ask("fire", fire(1, 3)),
        11 => Step::Stream("scan.waiting", 1_024),
        12 => Step::Ask("disarm", Request::Disarm),
        13 => Step::Ask("shake", Request::Shake(shake)),
        14 => Step::Stream("scan.shaking", 1_024),
        15 => Step::Ask("rest", Request::Rest),
        // the ramp down, and noise blocks after it
        16 => Step::Stream("", 256),
        17 | 27 => Step::Ask("", arm),
        18 => Step::Ask("", fire(2, 0)),
        19 | 29 => Step::Stream("", 1),
        20 => Step::Stream("scan.flight", 64),
        21 => Step::Contact("block.contact"),
        22 => Step::Stream("scan.listening", 256),
        23 => Step::Ask("resend", Request::Resend { epoch: 0, first_scan: 49_000, scans: 15 }),
        24 => Step::Ask("stop", Request::Stop),
        25 | 33 => Step::Ask("", Request::Start),
        26 => Step::Stream("", 64),
        28 => Step::Ask("", fire(3, 0)),
        30 => Step::Guard("block.guard"),
        31 => Step::Ask("emergency_stop", Request::EmergencyStop),
        // the same over a byte stream
        32 => Step::Greet(VENDOR + 1),
        34 => Step::Stream("scan.stuffed", 1_024),
        _ => return None,
    })
}

/// A name.
pub fn text(value: &str) -> Name {
    Name::try_from(value).unwrap_or_default()
}

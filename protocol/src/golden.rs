//! Golden vectors: one frame of every kind (and every reply that carries data), byte for byte.
//!
//! The bytes are committed under `protocol/golden/`. [`for_each`] builds the same frames again, so
//! that one comparison runs on the PC, on the controller and in the emulator. `JOINTRIG_BLESS=1
//! cargo test -p jointrig-protocol` rewrites the files after a deliberate change of the protocol.

use heapless::{String, Vec};

use crate::acknowledge::Acknowledge;
use crate::answer::{self, Answer, Counters, Hammer, Info, Refusal, Reset, Shaker, Status};
use crate::block::{Header, OVER_RANGE, TRIGGER};
use crate::channel::{Axis, Channel, Quantity, Role};
use crate::event::{self, Event, Loss, Reason};
use crate::frame::{FrameError, Kind, Writer};
use crate::hello::{Hello, Role as HelloRole};
use crate::request::{self, Configuration, Control, Fire, Request, Shake, Stage, Trigger};
use crate::shot::{Phase, Shot};
use crate::slow::{Slow, Supply};
use crate::sync::{Clock, ClockFault, Edge, Line, Moment, Sync};

macro_rules! golden {
    ($($name:ident),* $(,)?) => {
        /// The committed bytes, by name.
        pub const COMMITTED: &[(&str, &[u8])] = &[
            $((stringify!($name), include_bytes!(concat!("../golden/", stringify!($name), ".bin")))),*
        ];
    };
}

golden!(
    hello,
    info,
    channel,
    status,
    started,
    refused,
    slow,
    sync,
    clock_refused,
    fire,
    shake,
    stage,
    trigger,
    resend,
    scales,
    clock,
    shot_event,
    shaker_event,
    lost_event,
    counters_event,
    edge_event,
    clock_event,
    samples,
    short_samples,
    acknowledge,
    log,
    hello_packets,
    samples_packet,
    status_packet,
);

fn text<const N: usize>(value: &str) -> String<N> {
    let mut out = String::new();
    // text that does not fit is dropped: the comparison with the committed bytes would then fail
    let _ = out.push_str(value);
    out
}

const SHOT: Shot = Shot {
    number: 41,
    phase: Phase::Done,
    fired_at: 5_000_000_100,
    trigger: 5_000_000_320,
    pulse_us: 3_200,
    peak_n: 50.25,
    width_us: 273.0,
    rebound_ratio: 0.0,
    rebound_after: 0,
    friction_peak_n: 17.5,
    quiet_ratio: 0.5,
};

const COUNTERS: Counters = Counters {
    frames_in: 12,
    frames_bad: 1,
    scans_produced: 102_400,
    scans_sent: 102_376,
    scans_resent: 48,
    scans_dropped: 24,
    scans_missed: 0,
    events_dropped: 0,
    logs_dropped: 3,
};

const STATUS: Status = Status {
    epoch: 3,
    streaming: true,
    next_scan: 5_000_102_720,
    oldest_scan: 5_000_038_720,
    hammer: Hammer::HoldOff,
    armed_for_ms: 0,
    interlock_closed: true,
    emergency_stop: false,
    friction_n: -1.5,
    shot: Some(SHOT),
    shaker: Shaker::Resting,
    drive_v: 0.0,
    controlled: 0.0,
    counters: COUNTERS,
};

/// Builds every vector and passes its name and wire bytes to `each`, in the order of [`COMMITTED`].
///
/// # Errors
/// [`FrameError::TooLong`] if a vector does not fit a frame, which would be a defect of the
/// protocol.
pub fn for_each(mut each: impl FnMut(&str, &[u8])) -> Result<(), FrameError> {
    let mut frame = Writer::new(Kind::Hello);
    // The golden Hello contains a fixed hash: the real one changes with every deliberate change of
    // the protocol and is checked by the handshake.
    let hello = Hello { schema: 0x0123_4567_89ab_cdef, ..Hello::device(77, 3, 64_000) };
    debug_assert!(hello.role == HelloRole::Device);
    let bytes = hello.to_bytes();
    frame.payload_mut()[..bytes.len()].copy_from_slice(&bytes);
    each("hello", frame.seal(bytes.len())?);

    let answers = [
        (
            "info",
            Ok(Answer::Info(Info {
                board: text("golden"),
                serial: text("0001"),
                version: text("1.2.3"),
                target: text("thumbv8m.main-none-eabihf"),
                build: 0xfeed_beef,
                channels: 16,
                scan_rate_hz: 51_200,
                ring_scans: 64_000,
                coil_cap_us: 8_000,
                stage: false,
                drive_v: 10.0,
                reset: Reset::Watchdog,
            })),
        ),
        (
            "channel",
            Ok(Answer::Channel(Channel {
                name: text("vib_z"),
                role: Role::Response(Axis::Z),
                quantity: Quantity::Velocity,
                units_per_volt: 0.005,
                range_v: 10.0,
                delay_ns: 12_500,
                bits: 16,
            })),
        ),
        ("status", Ok(Answer::Status(STATUS))),
        ("started", Ok(Answer::Started { epoch: 3, map: 1, first_scan: 0 })),
        ("refused", Err(Refusal::Gone { oldest: 5_000_038_720 })),
    ];
    let mut supplies = Vec::new();
    let _ = supplies.push(Supply { channel: 0, bias_v: 11.5 });
    frame.restart(Kind::Answer);
    for (number, (name, outcome)) in answers.into_iter().enumerate() {
        each(name, frame.seal_value(&answer::Numbered { number: number as u32, outcome })?);
    }

    let slow = Slow { temperature_c: Some(22.25), supplies };
    each("slow", frame.seal_value(&answer::Numbered { number: 6, outcome: Ok(Answer::Slow(slow)) })?);
    let sync = Sync {
        clock: Clock::External { rate_hz: 51_200 },
        fault: Some(ClockFault::Rate),
        ppm: -212.5,
        edges: 300,
        edges_lost: 2,
        pulses: 41,
    };
    each("sync", frame.seal_value(&answer::Numbered { number: 7, outcome: Ok(Answer::Sync(sync)) })?);
    let refused = answer::Numbered { number: 8, outcome: Err(Refusal::Clock(ClockFault::Absent)) };
    each("clock_refused", frame.seal_value(&refused)?);

    let mut quiet_limits = Vec::new();
    for limit in [0.0, 2.5e-6, 2.5e-6] {
        // three limits fit a vector with a capacity of sixteen
        let _ = quiet_limits.push(limit);
    }
    let mut shake_limits = Vec::new();
    for limit in [0.0, 0.0, 0.02] {
        let _ = shake_limits.push(limit);
    }
    let mut units_per_volt = Vec::new();
    for scale in [44.643, 0.00515, -0.00485] {
        let _ = units_per_volt.push(scale);
    }
    let requests = [
        (
            "fire",
            Request::Fire(Fire {
                number: 41,
                pulse_us: 3_200,
                not_before: 5_000_000_000,
                quiet_limits,
                quiet_window: 256,
                quiet_patience: 1_536_000,
            }),
        ),
        (
            "shake",
            Request::Shake(Shake {
                step: Shake::step_of(200.0, 51_200),
                control: Control::Displacement { amplitude_m: 1.5e-7 },
                amplitude_v: 2.5,
                slew_v_per_s: 5.0,
                valid_ms: 30_000,
                limits: shake_limits,
            }),
        ),
        (
            "stage",
            Request::Stage(Stage {
                configuration: Configuration::Ajb,
                impact: text("AZ3"),
                response: text("B4"),
                attempt: 2,
            }),
        ),
        (
            "trigger",
            Request::Trigger(Trigger {
                level_n: 1.0,
                flight_scans: 5_120,
                listen_scans: 10_240,
                hold_off_scans: 25_600,
            }),
        ),
        ("resend", Request::Resend { epoch: 3, first_scan: 5_000_000_000, scans: 48 }),
        ("scales", Request::Scales { units_per_volt }),
        ("clock", Request::Clock(Clock::External { rate_hz: 51_200 })),
    ];
    frame.restart(Kind::Request);
    for (number, (name, request)) in requests.into_iter().enumerate() {
        each(name, frame.seal_value(&request::Numbered { number: 100 + number as u32, request })?);
    }

    let events = [
        ("shot_event", Event::Shot(SHOT)),
        ("shaker_event", Event::ShakerStops(Reason::Limit { channel: 2 })),
        ("lost_event", Event::Lost { epoch: 3, first_scan: 24, scans: 24, why: Loss::LinkSlow }),
        ("counters_event", Event::Counters(COUNTERS)),
        (
            "edge_event",
            Event::Edge(Edge {
                line: Line::Trigger,
                number: 300,
                at: Moment { scan: 5_000_000_335, part: 0x8001 },
            }),
        ),
        ("clock_event", Event::Clock(ClockFault::Lost)),
    ];
    frame.restart(Kind::Event);
    for (number, (name, event)) in events.into_iter().enumerate() {
        each(
            name,
            frame.seal_value(&event::Numbered { number: number as u32, at_scan: 5_000_000_320, event })?,
        );
    }
    debug_assert!(Reason::Asked != Reason::Expired);

    // a full block of 15 scans of 16 channels, and a short one
    for (name, scans, channels) in [("samples", 15_u8, 16_usize), ("short_samples", 3, 10)] {
        frame.restart(Kind::Samples);
        let used = block_of(&mut frame, scans, channels);
        each(name, frame.seal(used)?);
    }

    frame.restart(Kind::Acknowledge);
    let bytes = Acknowledge { epoch: 3, next_scan: 5_000_000_325 }.to_bytes();
    frame.payload_mut()[..bytes.len()].copy_from_slice(&bytes);
    each("acknowledge", frame.seal(bytes.len())?);

    frame.restart(Kind::Log);
    frame.payload_mut()[..4].copy_from_slice(&[0, 1, 0, 255]);
    each("log", frame.seal(4)?);

    packets(&mut frame, each)
}

/// Vectors in the other encoding: a Hello that announces packets, and two packets.
fn packets(frame: &mut Writer, mut each: impl FnMut(&str, &[u8])) -> Result<(), FrameError> {
    let hello =
        Hello { schema: 0x0123_4567_89ab_cdef, packets: true, ..Hello::device(78, 3, 64_000) }.to_bytes();
    frame.restart(Kind::Hello);
    frame.payload_mut()[..hello.len()].copy_from_slice(&hello);
    each("hello_packets", frame.seal(hello.len())?);

    frame.restart(Kind::Samples);
    let used = block_of(frame, 15, 16);
    each("samples_packet", frame.seal_packet(used)?);

    frame.restart(Kind::Answer);
    let answer = answer::Numbered { number: 5, outcome: Ok(Answer::Status(STATUS)) };
    let used = answer.write(frame.payload_mut()).map_err(|_| FrameError::TooLong)?;
    each("status_packet", frame.seal_packet(used)?);
    Ok(())
}

/// Writes a block in which every byte value occurs, including zeros, and returns its length.
fn block_of(frame: &mut Writer, scans: u8, channels: usize) -> usize {
    let header = Header { flags: TRIGGER | OVER_RANGE, map: 1, scans, epoch: 3, first_scan: 5_000_000_310 };
    let (head, samples) = frame.payload_mut().split_at_mut(crate::block::HEADER_PAYLOAD);
    head.copy_from_slice(&header.to_bytes());
    let used = usize::from(scans) * channels * 2;
    for (i, pair) in samples[..used].as_chunks_mut::<2>().0.iter_mut().enumerate() {
        *pair = (i as u16).wrapping_mul(273).wrapping_add(33_536).to_le_bytes();
    }
    crate::block::HEADER_PAYLOAD + used
}

/// Compares every vector with its committed bytes and returns the number of vectors.
///
/// # Errors
/// The name of the first vector that differs or cannot be built.
pub fn check() -> Result<usize, &'static str> {
    let mut compared = 0;
    let mut differs = None;
    for_each(|name, wire| {
        if COMMITTED.get(compared).is_none_or(|(known, bytes)| *known != name || *bytes != wire) {
            differs =
                differs.or(Some(COMMITTED.get(compared).map_or("a vector too many", |(known, _)| *known)));
        }
        compared += 1;
    })
    .map_err(|_| "a vector does not fit a frame")?;
    match differs {
        Some(name) => Err(name),
        None if compared == COMMITTED.len() => Ok(compared),
        None => Err("a committed vector is no longer built"),
    }
}

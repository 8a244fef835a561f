//! The benchmark: instructions of the real tasks, served from inside the image by a script.
//!
//! The same tasks over the same parts run as under the simulator; only [`serve`] stands in for it. What the
//! script itself does between two turns is not counted. Sixteen channels of small noise around zero flow,
//! whose high bytes are mostly 0 or 255: a hard case for COBS, and the usual one at rest.

use core::cell::RefCell;
use core::hint::black_box;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::Vec;
use jointrig_firmware::lockstep::{
    Ask, BLOCK_AT, DELIVERY_BYTES, Delivery, INTERLOCK_CLOSED, Op, RING_BYTES, Reply, Setup, TO_DEVICE_AT,
    to_text,
};
use jointrig_protocol::acknowledge::Acknowledge;
use jointrig_protocol::block::HEADER_PAYLOAD;
use jointrig_protocol::channel::{Axis, Channel, Name, Quantity, Role};
use jointrig_protocol::frame::{Accumulator, Kind, Writer};
use jointrig_protocol::hello::Hello;
use jointrig_protocol::limits::{BLOCK_SAMPLE_BYTES, MAX_CHANNELS};
use jointrig_protocol::request::{Configuration, Control, Fire, Numbered, Request, Shake, Stage, Trigger};
use semihosting::{eprintln, println, process};

use mps2_an505::{device, memory, port};

use crate::{counter, stack};

const RATE_HZ: u32 = 51_200;
const PER_BLOCK: u64 = 15;
/// A host acknowledges every so many blocks.
const ACKNOWLEDGE_EVERY: u32 = 8;
/// Different blocks of noise.
const NOISES: usize = 16;
/// The force channel's code during contact: well above any trigger.
const HIT: i16 = 8_000;

/// One step of the script.
enum Step {
    /// The handshake.
    Greet,
    /// One request.
    Ask(&'static str, Request),
    /// Blocks of noise; the figure is per scan.
    Stream(&'static str, u32),
    /// One block whose force channel shows contact.
    Contact(&'static str),
    /// One block with the guard open.
    Guard(&'static str),
}

/// The script, by number.
fn step(number: usize) -> Option<Step> {
    let fire = |number, watched: usize| {
        let mut quiet_limits = Vec::new();
        for channel in 0..MAX_CHANNELS {
            // far below the noise's own motion, so that the structure is never quiet
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
        0 => Step::Greet,
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
        // the ramp down, and the noise of the blocks after it
        16 => Step::Stream("", 256),
        17 | 27 => Step::Ask("", arm),
        18 => Step::Ask("", fire(2, 0)),
        19 | 29 => Step::Stream("", 1),
        20 => Step::Stream("scan.flight", 64),
        21 => Step::Contact("block.contact"),
        22 => Step::Stream("scan.listening", 256),
        23 => Step::Ask("resend", Request::Resend { epoch: 0, first_scan: 49_000, scans: 15 }),
        24 => Step::Ask("stop", Request::Stop),
        25 => Step::Ask("", Request::Start),
        26 => Step::Stream("", 64),
        28 => Step::Ask("", fire(3, 0)),
        30 => Step::Guard("block.guard"),
        31 => Step::Ask("emergency_stop", Request::EmergencyStop),
        _ => return None,
    })
}

/// What one figure counts.
type Figure = (&'static str, u64);

struct Bench {
    step: usize,
    left: u32,
    request: u32,
    blocks: u32,
    spent: u64,
    since_block: u64,
    worst_block: u64,
    released: u32,
    reply: Reply,
    noise: [[u8; BLOCK_SAMPLE_BYTES]; NOISES],
    figures: Vec<Figure, 48>,
    writer: Writer,
}

static BENCH: Mutex<CriticalSectionRawMutex, RefCell<Bench>> = Mutex::new(RefCell::new(Bench {
    step: 0,
    left: 0,
    request: 0,
    blocks: 0,
    spent: 0,
    since_block: 0,
    worst_block: 0,
    released: 0,
    reply: Reply {
        now_us: 0,
        inputs: INTERLOCK_CLOSED,
        blocks: 0,
        to_device_head: 0,
        to_host_tail: 0,
        log_tail: 0,
        length: 0,
        ran_dry: 0,
        cuts: 0,
    },
    noise: [[0; BLOCK_SAMPLE_BYTES]; NOISES],
    figures: Vec::new(),
    writer: Writer::new(Kind::Hello),
}));

/// Runs the benchmark, prints its figures and ends.
pub fn run() -> ! {
    counter::start();
    BENCH.lock(|bench| bench.borrow_mut().prepare());
    port::serve_by(serve);
    device::run(&set_up())
}

fn serve(ask: &Ask) -> Reply {
    let entered = counter::ticks();
    BENCH.lock(|bench| {
        let mut bench = bench.borrow_mut();
        let reply = bench.turn(ask, entered);
        bench.released = counter::ticks();
        reply
    })
}

impl Bench {
    /// Makes the noise and counts what needs no tasks.
    fn prepare(&mut self) {
        let mut state = 12_345_u32;
        let mut uniform = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            i32::from((state >> 26) as u8) - 32
        };
        for block in &mut self.noise {
            for pair in block.as_chunks_mut::<2>().0 {
                *pair = ((uniform() + uniform()) as i16).to_le_bytes();
            }
        }
        let noise = self.noise[0];
        let mut copy = [0; BLOCK_SAMPLE_BYTES];
        self.count("part.copy_480", || black_box(&mut copy).copy_from_slice(black_box(&noise)));
        let mut writer = Writer::new(Kind::Samples);
        writer.payload_mut()[HEADER_PAYLOAD..HEADER_PAYLOAD + noise.len()].copy_from_slice(&noise);
        let full = HEADER_PAYLOAD + noise.len();
        self.count("frame.seal", || {
            let _ = black_box(black_box(&mut writer).seal(full));
        });
        let mut accumulator = Accumulator::new();
        let Ok(wire) = writer.seal(full) else { return };
        self.count("frame.read", || {
            let _ = black_box(accumulator.feed(black_box(wire)));
        });
        let mut acknowledge = Writer::new(Kind::Acknowledge);
        self.count("frame.seal_short", || {
            let _ = black_box(black_box(&mut acknowledge).seal(12));
        });
    }

    fn count(&mut self, name: &'static str, mut work: impl FnMut()) {
        // the second time, so that nothing is done for the first time
        let mut spent = 0;
        for _ in 0..2 {
            let before = counter::ticks();
            let empty = counter::ticks().wrapping_sub(before);
            let before = counter::ticks();
            work();
            spent = counter::ticks().wrapping_sub(before) - empty;
        }
        self.note(name, counter::instructions(u64::from(spent)));
    }

    fn note(&mut self, name: &'static str, value: u64) {
        if !name.is_empty() && self.figures.push((name, value)).is_err() {
            broken("there are more figures than room for them");
        }
    }

    fn turn(&mut self, ask: &Ask, entered: u32) -> Reply {
        let spent = u64::from(entered.wrapping_sub(self.released));
        self.spent += spent;
        self.since_block += spent;
        self.reply.length = 0;
        self.reply.to_host_tail = ask.to_host_head;
        self.reply.log_tail = ask.log_head;
        match Op::from_word(ask.op) {
            Some(Op::Idle) => self.idle(ask),
            Some(Op::Pulse) => self.note_coil("latency.coil_on"),
            Some(Op::Off) => self.note_coil("latency.coil_off"),
            Some(Op::Stage | Op::Play | Op::Rest) => {}
            Some(Op::Start | Op::Panic) | None => broken("an unknown wish"),
        }
        self.reply
    }

    /// From a block's delivery to the coil's order; the first of each is the one meant.
    fn note_coil(&mut self, name: &'static str) {
        if self.figures.iter().all(|(known, _)| *known != name) {
            self.note(name, counter::instructions(self.since_block));
        }
    }

    fn idle(&mut self, ask: &Ask) {
        if self.blocks > 0 {
            self.worst_block = self.worst_block.max(self.since_block);
        }
        if self.left > 0 {
            self.stream(ask);
            return;
        }
        if self.step > 0 {
            self.finish();
        }
        let Some(next) = step(self.step) else { self.end() };
        self.step += 1;
        self.spent = 0;
        self.since_block = 0;
        match next {
            Step::Greet => {
                let hello = Hello::host(7).to_bytes();
                self.say(Kind::Hello, &hello);
            }
            Step::Ask(_, mut request) => {
                if let Request::Resend { epoch, .. } = &mut request {
                    // the first stream of boot 1
                    *epoch = 1 << 16;
                }
                self.request += 1;
                let mut bytes = [0; 400];
                let numbered = Numbered { number: self.request, request };
                let Some(used) = to_text(&numbered, &mut bytes) else { broken("a request is too long") };
                self.say(Kind::Request, used);
            }
            Step::Stream(_, blocks) => {
                self.left = blocks;
                self.stream(ask);
            }
            Step::Contact(_) => {
                self.left = 1;
                self.stream(ask);
                // every fourth scan from the third on shows force
                for scan in (2..PER_BLOCK as usize).step_by(4) {
                    memory::write(BLOCK_AT + DELIVERY_BYTES + scan * 2 * MAX_CHANNELS, &HIT.to_le_bytes());
                }
            }
            Step::Guard(_) => {
                self.left = 1;
                self.stream(ask);
                self.reply.inputs = 0;
            }
        }
    }

    /// Notes what the step that has just ended took.
    fn finish(&mut self) {
        let spent = self.spent;
        match step(self.step - 1) {
            Some(Step::Ask(name, _)) => {
                if !name.is_empty() {
                    self.note(name, counter::instructions(spent));
                }
            }
            Some(Step::Stream(name, blocks)) => {
                let scans = u64::from(blocks) * PER_BLOCK;
                self.note(name, counter::instructions(spent).div_ceil(scans));
            }
            Some(Step::Contact(name) | Step::Guard(name)) => self.note(name, counter::instructions(spent)),
            Some(Step::Greet) => self.note("greet", counter::instructions(spent)),
            None => {}
        }
    }

    /// Lets time go on: to the next alarm, or to the next block.
    fn stream(&mut self, ask: &Ask) {
        if ask.alarm_us < ask.block_us {
            self.reply.now_us = ask.alarm_us;
            return;
        }
        self.reply.now_us = ask.block_us;
        self.since_block = 0;
        self.left -= 1;
        memory::write(BLOCK_AT, &Delivery { scans: PER_BLOCK as u32, ..Delivery::default() }.to_bytes());
        memory::write(BLOCK_AT + DELIVERY_BYTES, &self.noise[self.blocks as usize % NOISES]);
        self.blocks += 1;
        self.reply.blocks = self.blocks;
        if self.blocks.is_multiple_of(ACKNOWLEDGE_EVERY) {
            let epoch = if self.step <= 25 { 1 << 16 } else { (1 << 16) + 1 };
            let next_scan = u64::from(self.blocks - 1) * PER_BLOCK;
            self.say(Kind::Acknowledge, &Acknowledge { epoch, next_scan }.to_bytes());
        }
    }

    fn say(&mut self, kind: Kind, payload: &[u8]) {
        self.writer.restart(kind);
        self.writer.payload_mut()[..payload.len()].copy_from_slice(payload);
        let Ok(wire) = self.writer.seal(payload.len()) else { broken("a frame is too long") };
        memory::write_ring(TO_DEVICE_AT, self.reply.to_device_head, wire);
        self.reply.to_device_head = self.reply.to_device_head.wrapping_add(wire.len() as u32);
        debug_assert!(wire.len() < RING_BYTES as usize);
    }

    fn end(&mut self) -> ! {
        for (name, value) in &self.figures {
            println!("figure {name} {value}");
        }
        println!("figure block.worst {}", counter::instructions(self.worst_block));
        println!("figure stack {}", stack::high_water());
        process::exit(0)
    }
}

/// Sixteen channels with all roles that cost something.
fn set_up() -> Setup {
    let channel = |index: usize| Channel {
        name: text("channel"),
        role: match index {
            0 => Role::HammerForce,
            1 => Role::Response(Axis::X),
            2 => Role::Response(Axis::Y),
            3 => Role::Response(Axis::Z),
            4..=6 => Role::LoadCell,
            _ => Role::Auxiliary,
        },
        quantity: if index == 0 { Quantity::Force } else { Quantity::Velocity },
        units_per_volt: 10.0,
        range_v: 10.0,
        delay_ns: 0,
        bits: 16,
    };
    let channels = (0..MAX_CHANNELS).map(channel).collect();
    Setup { serial: text("bench"), scan_rate_hz: RATE_HZ, boot: 1, slots: 3_414, channels }
}

fn text(value: &str) -> Name {
    Name::try_from(value).unwrap_or_default()
}

fn broken(why: &str) -> ! {
    eprintln!("the benchmark's script is broken: {why}");
    process::exit(1)
}

//! The benchmark: instruction counts and the peak stack usage of the real tasks, driven by a script
//! inside the image: the host's requests and the rig's data, in order.
//!
//! The same tasks with the same parts run as with the simulator; only [`serve`] replaces it.
//! Instructions of the script itself between two turns are not counted. The data are sixteen
//! channels of small noise around zero, whose high bytes are mostly 0 or 255: a demanding case for
//! COBS, and the usual one at rest.
//!
//! A timer of the machine counts instructions. Under `-icount shift=10`, QEMU advances its clock by
//! 1024 ns per executed instruction and by nothing else, so TIMER0 (20 MHz) counts instructions,
//! identically in every run. They are not cycles. The start-up code fills the stack with a pattern,
//! and words that lost it were used.

use core::cell::RefCell;
use core::hint::black_box;
use core::ptr;
use cortex_m_rt::STACK_PAINT_VALUE;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::Vec;
use jointrig_firmware::ad7606b::reader::{Moment, SCAN_WORDS};
use jointrig_firmware::lockstep::{
    Ask, BLOCK_AT, CLOCK, DELIVERY_BYTES, Delivery, INTERLOCK_CLOSED, Op, RING_BLOCKS, RING_BYTES, Reply,
    Setup, TO_DEVICE_AT, to_text,
};
use jointrig_hot::half_band::{HalfBand, INPUT};
use jointrig_hot::pair::{CHANNELS, CHIP_BYTES, data_crc, join};
use jointrig_protocol::acknowledge::Acknowledge;
use jointrig_protocol::block::HEADER_PAYLOAD;
use jointrig_protocol::channel::{Axis, Channel, Name, Quantity, Role};
use jointrig_protocol::frame::{Accumulator, Kind, Writer};
use jointrig_protocol::hello::Hello;
use jointrig_protocol::limits::{BLOCK_SAMPLE_BYTES, MAX_CHANNELS};
use jointrig_protocol::request::{Configuration, Control, Fire, Numbered, Request, Shake, Stage, Trigger};
use mps2_an505::{device, memory, port};
use semihosting::{eprintln, println, process};

const PER_BLOCK: u64 = 15;
/// The host acknowledges after this many blocks.
const ACKNOWLEDGE_EVERY: u32 = 8;
/// Number of different noise blocks.
const NOISES: usize = 16;
/// The force channel's code during contact: well above any trigger.
const HIT: i16 = 8_000;

/// Name and value of one figure.
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
    /// Blocks as sent by the two converters.
    chips: [[[u8; CHIP_BYTES]; 2 * PER_BLOCK as usize]; NOISES],
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
    chips: [[[0; CHIP_BYTES]; 2 * PER_BLOCK as usize]; NOISES],
    figures: Vec::new(),
    writer: Writer::new(Kind::Hello),
}));

/// Runs the benchmark, prints its figures and exits.
pub fn run() -> ! {
    start_counter();
    BENCH.lock(|bench| bench.borrow_mut().prepare());
    port::serve_by(serve);
    device::run(&set_up())
}

fn serve(ask: &Ask) -> Reply {
    let entered = ticks();
    BENCH.lock(|bench| {
        let mut bench = bench.borrow_mut();
        let reply = bench.turn(ask, entered);
        bench.released = ticks();
        reply
    })
}

impl Bench {
    /// Generates the noise and measures what needs no tasks.
    fn prepare(&mut self) {
        let mut state = 12_345_u32;
        let mut uniform = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            i32::from((state >> 26) as u8) - 32
        };
        for chip in self.chips.as_flattened_mut() {
            let codes = core::array::from_fn(|_| (uniform() + uniform()) as i16);
            *chip = sent(&codes);
        }
        let mut noise = [0; BLOCK_SAMPLE_BYTES];
        let [chips, ..] = self.chips;
        let (first, second) = chips.split_at(PER_BLOCK as usize);
        self.count("part.join", || {
            black_box(join(black_box(first), black_box(second), MAX_CHANNELS, black_box(&mut noise)));
        });
        let mut filter = HalfBand::new();
        let (twice, mut once) = ([[0x123; MAX_CHANNELS]; INPUT], [[0; MAX_CHANNELS]; INPUT / 2]);
        self.count("part.half_band", || {
            black_box(&mut filter).block(black_box(&twice), black_box(&mut once));
        });
        let mut copy = [0; BLOCK_SAMPLE_BYTES];
        self.count("part.copy_480", || black_box(&mut copy).copy_from_slice(black_box(&noise)));
        let mut writer = Writer::new(Kind::Samples);
        writer.payload_mut()[HEADER_PAYLOAD..HEADER_PAYLOAD + noise.len()].copy_from_slice(&noise);
        let full = HEADER_PAYLOAD + noise.len();
        self.count("frame.seal_packet", || {
            let _ = black_box(black_box(&mut writer).seal_packet(full));
        });
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
        // the second run counts, so that one-time work is excluded
        let mut spent = 0;
        for _ in 0..2 {
            let before = ticks();
            let empty = ticks().wrapping_sub(before);
            let before = ticks();
            work();
            spent = ticks().wrapping_sub(before) - empty;
        }
        self.note(name, instructions(u64::from(spent)));
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
            Some(Op::Stage | Op::Play | Op::Rest | Op::Clock | Op::Mark) => {}
            Some(Op::Join) => self.reply.length = self.blocks * PER_BLOCK as u32,
            Some(Op::Start | Op::Panic) | None => broken("an unknown wish"),
        }
        self.reply
    }

    /// Notes the instructions from a block's delivery to the coil order; only the first of each
    /// counts.
    fn note_coil(&mut self, name: &'static str) {
        if self.figures.iter().all(|(known, _)| *known != name) {
            self.note(name, instructions(self.since_block));
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
            Step::Greet(session) => {
                let hello = Hello { packets: session == VENDOR, ..Hello::host(session) }.to_bytes();
                self.say(Kind::Hello, &hello);
            }
            Step::Ask(_, mut request) => {
                if let Request::Resend { epoch, .. } = &mut request {
                    // epoch of the first stream of boot 1
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
                // every fourth scan from the third on contains force
                let hit = sent(&[HIT, 0, 0, 0, 0, 0, 0, 0]);
                for scan in (2..PER_BLOCK as usize).step_by(4) {
                    memory::write(BLOCK_AT + DELIVERY_BYTES + scan * CHIP_BYTES, &hit);
                }
            }
            Step::Guard(_) => {
                self.left = 1;
                self.stream(ask);
                self.reply.inputs = 0;
            }
        }
    }

    /// Notes the result of the step that has just ended.
    fn finish(&mut self) {
        let spent = self.spent;
        match step(self.step - 1) {
            Some(Step::Ask(name, _)) => {
                if !name.is_empty() {
                    self.note(name, instructions(spent));
                }
            }
            Some(Step::Stream(name, blocks)) => {
                let scans = u64::from(blocks) * PER_BLOCK;
                self.note(name, instructions(spent).div_ceil(scans));
            }
            Some(Step::Contact(name) | Step::Guard(name)) => self.note(name, instructions(spent)),
            Some(Step::Greet(VENDOR)) => self.note("greet", instructions(spent)),
            Some(Step::Greet(_)) | None => {}
        }
    }

    /// Advances the time to the next alarm or the next block.
    fn stream(&mut self, ask: &Ask) {
        if ask.alarm_us < ask.block_us {
            self.reply.now_us = ask.alarm_us;
            return;
        }
        self.reply.now_us = ask.block_us;
        self.since_block = 0;
        self.left -= 1;
        memory::write(BLOCK_AT + DELIVERY_BYTES, self.chips[self.blocks as usize % NOISES].as_flattened());
        self.blocks += 1;
        let periods = self.blocks * PER_BLOCK as u32 - 1;
        let words = (periods + 1) * SCAN_WORDS % (RING_BLOCKS * PER_BLOCK as u32 * SCAN_WORDS);
        let moment = Moment { periods, phase: CLOCK.read_by, words: [words; 2] };
        let delivery = Delivery { scans: PER_BLOCK as u32, periods, moment, ..Delivery::default() };
        memory::write(BLOCK_AT, &delivery.to_bytes());
        self.reply.blocks = self.blocks;
        if self.blocks.is_multiple_of(ACKNOWLEDGE_EVERY) {
            // epochs of the first, second and third stream of boot 1
            let stream = u32::from(self.step > 25) + u32::from(self.step > 33);
            let epoch = (1 << 16) + stream;
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
        println!("figure block.worst {}", instructions(self.worst_block));
        println!("figure stack {}", stack_high_water());
        process::exit(0)
    }
}

/// A scan of one converter, as it is sent.
fn sent(codes: &[i16; CHANNELS]) -> [u8; CHIP_BYTES] {
    let mut bytes = [0; CHIP_BYTES];
    let words = codes.iter().copied().chain([data_crc(codes).cast_signed()]);
    for (place, word) in bytes.as_chunks_mut().0.iter_mut().zip(words) {
        *place = word.to_le_bytes();
    }
    bytes
}

/// Sixteen channels, with all roles that affect the processing time.
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

fn broken(why: &str) -> ! {
    eprintln!("the benchmark's script is broken: {why}");
    process::exit(1)
}

/// TIMER0: control, value, reload.
const TIMER: *mut u32 = 0x5000_0000 as *mut u32;
const TICK_NS: u64 = 50;
const INSTRUCTION_NS: u64 = 1 << 10;

/// Starts the timer, which repeatedly counts down from its largest value.
fn start_counter() {
    for (register, value) in [(0, 0), (2, u32::MAX), (1, u32::MAX), (0, 1)] {
        // SAFETY: TIMER0's registers are at this address on this machine, and nothing else uses
        // them; with its interrupt disabled it changes nothing but its own value.
        unsafe { TIMER.add(register).write_volatile(value) }
    }
}

/// Ticks since a fixed instant, modulo 2³².
#[inline]
fn ticks() -> u32 {
    // SAFETY: as in `start`; reading the value has no effect.
    !unsafe { ptr::read_volatile(TIMER.add(1)) }
}

/// Instructions for a number of ticks.
fn instructions(ticks: u64) -> u64 {
    (ticks * TICK_NS + INSTRUCTION_NS / 2) / INSTRUCTION_NS
}

unsafe extern "C" {
    /// From the linker script: the lowest word of the stack.
    static _stack_end: u32;
    /// From the linker script: the end of RAM, where the stack begins.
    static _stack_start: u32;
}

/// Bytes of stack used so far, at most.
fn stack_high_water() -> usize {
    let (mut word, top) = (&raw const _stack_end, &raw const _stack_start);
    // SAFETY: only the stack's memory lies between the two symbols; it is read word by word with
    // volatile reads, never beyond its top. The part in use is above this function's own frame,
    // where the scan ends.
    unsafe {
        while word < top && ptr::read_volatile(word) == STACK_PAINT_VALUE {
            word = word.add(1);
        }
    }
    top.addr() - word.addr()
}

/// Scans per second.
const RATE_HZ: u32 = 51_200;

/// One step of the script.
enum Step {
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
const VENDOR: u32 = 7;

/// The script, by number.
fn step(number: usize) -> Option<Step> {
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
fn text(value: &str) -> Name {
    Name::try_from(value).unwrap_or_default()
}

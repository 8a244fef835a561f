//! The device: the firmware's four functions as tasks, with this board's parts, which implement the
//! firmware's traits with the shared memory.

use crate::{executor, fault, memory, port, uart};
use core::future::poll_fn;
use core::task::Poll;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::{String, Vec};
use jointrig_firmware::ad7606b::reader::{Alignment, Reader, Trouble};
use jointrig_firmware::board::{Board, Delivered, RanDry, Seen};
use jointrig_firmware::lockstep::{
    BLOCK_AT, CLOCK, DELIVERY_BYTES, DRIVE_AT, DRIVE_FULL_SCALE_V, Delivery, EMERGENCY_STOP, HELD,
    INTERLOCK_CLOSED, LOCAL_RESET, MUST_FAULT, MUST_OVERFLOW, MUST_PANIC, NEVER, Op, PERIOD, RING_BLOCKS,
    RING_BYTES, SEEN_AT, SEEN_WORDS, SLOW_AT, SLOW_BYTES, SLOW_MEASURED, Setup, TEXT_AT, TEXT_BYTES,
    TO_DEVICE_AT, TO_HOST_AT, from_text, seen_from_words, to_text,
};
use jointrig_firmware::ring::Slot;
use jointrig_firmware::ruler::Ago;
use jointrig_firmware::{Core, Facts, board};
use jointrig_hot::pair::CHIP_BYTES;
use jointrig_protocol::answer::{Info, Refusal, Reset};
use jointrig_protocol::channel::{Channel, Name};
use jointrig_protocol::limits::{BLOCK_SAMPLE_BYTES, COIL_PULSE_CAP_US, MAX_CHANNELS, scans_per_block};
use jointrig_protocol::request::Stage as Place;
use jointrig_protocol::slow::Slow;
use jointrig_protocol::sync::{Clock, ClockFault};
use static_cell::{ConstStaticCell, StaticCell};

/// Blocks in the ring: a second of sixteen channels at 51.2 kHz.
const SLOTS: usize = 3_414;

/// State shared by the tasks.
pub type Shared = Core<'static, <Emulated as Board>::Mutex>;

/// Runs the firmware forever.
///
/// # Panics
/// A set-up without channels, or a second call.
pub fn run(setup: &Setup) -> ! {
    static MEMORY: ConstStaticCell<[Slot; SLOTS]> = ConstStaticCell::new([Slot::EMPTY; SLOTS]);
    static CHANNELS: StaticCell<Vec<Channel, MAX_CHANNELS>> = StaticCell::new();
    static CORE: StaticCell<Shared> = StaticCell::new();

    let channels: &'static [Channel] = CHANNELS.init(setup.channels.clone());
    // the emulated converters have 16 bits: every channel is one word of a scan
    let per_block = scans_per_block(channels.len()).expect("a set-up names 1 to 16 channels");
    let facts = Facts {
        board: Name::try_from(Info::EMULATED_BOARD).unwrap_or_default(),
        serial: setup.serial.clone(),
        target: String::try_from(env!("JOINTRIG_TARGET")).unwrap_or_default(),
        build: jointrig_board_log::build_id(),
        scan_rate_hz: setup.scan_rate_hz,
        channels,
        coil_cap_us: COIL_PULSE_CAP_US,
        stage: true,
        sync: true,
        drive_v: board::Drive::full_scale_v(&Drive),
        reset: Reset::Power,
        boot: setup.boot,
    };
    let slots = (setup.slots as usize).clamp(1, SLOTS);
    let core: &'static Shared =
        CORE.init(Core::new(facts, &mut MEMORY.take()[..slots]).with_logs(&jointrig_board_log::TAP));
    let scans = Scans::new(core, per_block, channels.len(), setup.scan_rate_hz);
    executor::run(|spawner| {
        const ONCE: &str = "each task is made once";
        spawner.spawn(acquire(core, scans).expect(ONCE));
        spawner.spawn(receive(core).expect(ONCE));
        spawner.spawn(transmit(core).expect(ONCE));
        spawner.spawn(watch(core).expect(ONCE));
    })
}

#[embassy_executor::task]
async fn acquire(core: &'static Shared, mut scans: Scans) {
    jointrig_firmware::acquire::acquire(core, &mut scans, &mut Coil, &mut Drive, &mut Inputs::default())
        .await;
}

#[embassy_executor::task]
async fn receive(core: &'static Shared) {
    jointrig_firmware::receive::receive(core, &mut Source::default(), &mut Stage).await;
}

#[embassy_executor::task]
async fn transmit(core: &'static Shared) {
    jointrig_firmware::transmit::transmit(core, &mut Sink).await;
}

#[embassy_executor::task]
async fn watch(core: &'static Shared) {
    jointrig_firmware::watch::watch(core).await;
}

/// Most scans of a block: those of ten channels, which fill the block area of the shared memory (32
/// bytes of header and 24 scans of 36 bytes).
const MOST_SCANS: usize = 24;

/// The emulated board; it names the types of its parts.
pub enum Emulated {}

impl board::Board for Emulated {
    type Mutex = CriticalSectionRawMutex;
    type Scans = Scans;
    type Coil = Coil;
    type Drive = Drive;
    type Inputs = Inputs;
    type Source = Source;
    type Sink = Sink;
    type Stage = Stage;
}

/// Converters whose words are delivered by the simulator.
pub struct Scans {
    core: &'static Shared,
    reader: Reader,
    per_block: usize,
    rate_hz: u32,
    /// The instant at which the next block is complete: whole µs, and a fraction of a further µs in
    /// units of 1 / scan rate.
    due: (u64, u32),
    blocks: u32,
    /// The rings must be restarted.
    join: bool,
    last_report: Option<Trouble>,
    /// Activity at the sync port during the last block.
    seen: Option<Seen>,
    /// Periods of the clock begun so far.
    periods: u32,
}

impl Scans {
    /// Converters that deliver `per_block` scans per block, with `channels` channels.
    pub fn new(core: &'static Shared, per_block: usize, channels: usize, rate_hz: u32) -> Self {
        let alignment = Alignment { clock: CLOCK, block_scans: per_block as u32, blocks: RING_BLOCKS };
        let reader = Reader::new(alignment, channels, 0);
        Self {
            core,
            reader,
            per_block,
            rate_hz,
            due: (0, 0),
            blocks: 0,
            join: true,
            last_report: None,
            seen: None,
            periods: 0,
        }
    }

    /// Waits until the simulator has delivered a block.
    async fn delivered(&mut self) -> u32 {
        let at_us = self.due.0 + u64::from(self.due.1 > 0);
        poll_fn(|context| {
            port::with(|port| {
                if port.reply.blocks != self.blocks {
                    port.ask.block_us = NEVER;
                    self.blocks = self.blocks.wrapping_add(1);
                    return Poll::Ready(port.reply.inputs);
                }
                port.ask.block_us = at_us;
                port.block.register(context.waker());
                Poll::Pending
            })
        })
        .await
    }

    /// Period of the next scan to be delivered or reported missing, relative to the clock's count
    /// of periods; added to instants that the simulator gives relative to that count.
    fn behind(&self) -> i32 {
        self.reader.next_period().wrapping_sub(self.periods).cast_signed()
    }

    fn report(&mut self, trouble: Trouble) {
        self.join = true;
        if self.last_report != Some(trouble) {
            self.last_report = Some(trouble);
            self.core.report_fault(&trouble);
        }
    }
}

impl board::Scans for Scans {
    const PERIOD: u32 = PERIOD;

    fn seen(&mut self) -> Option<Seen> {
        let mut seen = self.seen.take()?;
        if let Some(edge) = &mut seen.edge {
            edge.scans += self.behind();
        }
        Some(seen)
    }

    fn clock(&mut self, clock: Clock) -> Result<(), ClockFault> {
        match port::turn(Op::Clock, u32::from(clock != Clock::Internal)).length {
            0 => Ok(()),
            1 => Err(ClockFault::Absent),
            _ => Err(ClockFault::Rate),
        }
    }

    fn mark(&mut self) -> Option<Ago> {
        let part = port::turn(Op::Mark, 0).length as u16;
        Some(Ago { scans: self.behind(), part })
    }

    fn can_be_held(&self) -> bool {
        port::with(|port| port.reply.inputs & HELD != 0)
    }

    async fn next(&mut self, block: &mut [u8; BLOCK_SAMPLE_BYTES]) -> Delivered {
        if core::mem::take(&mut self.join) {
            let first = port::turn(Op::Join, 0).length;
            self.reader.start(first);
            let parts = u64::from(first) * 1_000_000;
            let rate_hz = u64::from(self.rate_hz);
            self.due = (parts / rate_hz, (parts % rate_hz) as u32);
        }
        let parts = self.due.1 + self.per_block as u32 * 1_000_000;
        self.due = (self.due.0 + u64::from(parts / self.rate_hz), parts % self.rate_hz);
        let inputs = self.delivered().await;
        assert!(inputs & MUST_PANIC == 0, "the simulator asked for a panic");
        if inputs & (MUST_FAULT | MUST_OVERFLOW) != 0 {
            fault::end_by(inputs & MUST_OVERFLOW != 0);
        }
        let mut head = [0; DELIVERY_BYTES];
        memory::read(BLOCK_AT, &mut head);
        let delivery = Delivery::from_bytes(&head);
        self.periods = delivery.periods;
        if delivery.seen {
            let mut words = [[0; 4]; SEEN_WORDS];
            memory::read(SEEN_AT, words.as_flattened_mut());
            self.seen = Some(seen_from_words(words.map(u32::from_le_bytes)));
        }
        if let Some(trouble) = delivery.trouble {
            self.report(trouble);
            return self.reader.nothing(delivery.periods);
        }
        let scans = (delivery.scans as usize).min(MOST_SCANS);
        let reader = &mut self.reader;
        let taken = memory::look(BLOCK_AT + DELIVERY_BYTES, 2 * scans * CHIP_BYTES, |bytes| {
            let (first, second) = bytes.as_chunks().0.split_at(scans);
            reader.take([first, second], || delivery.moment, block)
        });
        match taken {
            Ok((delivered, None)) => {
                self.last_report = None;
                delivered
            }
            Ok((delivered, Some(trouble))) => {
                self.report(trouble);
                delivered
            }
            Err(trouble) => {
                self.report(trouble);
                self.reader.nothing(delivery.periods)
            }
        }
    }
}

/// The coil of the simulated hammer, which itself ends any pulse at the cap.
pub struct Coil;

impl board::Coil for Coil {
    fn cap_us(&self) -> u32 {
        COIL_PULSE_CAP_US
    }

    fn pulse(&mut self, width_us: u32) {
        port::turn(Op::Pulse, width_us.min(COIL_PULSE_CAP_US));
    }

    fn off(&mut self) {
        port::turn(Op::Off, 0);
    }
}

/// The drive of the simulated shaker.
pub struct Drive;

impl board::Drive for Drive {
    fn full_scale_v(&self) -> f32 {
        DRIVE_FULL_SCALE_V
    }

    fn play(&mut self, codes: &[i16]) -> Result<(), RanDry> {
        for (place, code) in codes.iter().take(BLOCK_SAMPLE_BYTES / 2).enumerate() {
            memory::write(DRIVE_AT + 2 * place, &code.to_le_bytes());
        }
        match port::turn(Op::Play, codes.len() as u32).ran_dry {
            0 => Ok(()),
            _ => Err(RanDry),
        }
    }

    fn rest(&mut self) {
        port::turn(Op::Rest, 0);
    }
}

/// Guard and emergency stop of the simulated rig, as of the last reading of the guard.
#[derive(Default)]
pub struct Inputs(u32);

impl board::Inputs for Inputs {
    fn interlock_closed(&mut self) -> bool {
        self.0 = port::with(|port| {
            let inputs = port.reply.inputs;
            // a turn of the key is reported once, and so are slow values
            port.reply.inputs &= !(LOCAL_RESET | SLOW_MEASURED);
            inputs
        });
        self.0 & INTERLOCK_CLOSED != 0
    }

    fn slow(&mut self) -> Option<Slow> {
        if self.0 & SLOW_MEASURED == 0 {
            return None;
        }
        let mut length = [0; 4];
        memory::read(SLOW_AT, &mut length);
        let used = (u32::from_le_bytes(length) as usize).min(SLOW_BYTES);
        memory::look(SLOW_AT + length.len(), used, |bytes| from_text(bytes))
    }

    fn emergency_stop(&mut self) -> bool {
        self.0 & EMERGENCY_STOP != 0
    }

    fn local_reset(&mut self) -> bool {
        self.0 & LOCAL_RESET != 0
    }
}

/// Bytes from the host.
#[derive(Default)]
pub struct Source {
    /// Number of link cuts reported to the firmware.
    cuts: u32,
}

impl board::ByteSource for Source {
    async fn read(&mut self, buffer: &mut [u8]) -> usize {
        poll_fn(|context| {
            port::with(|port| {
                if uart::is_link() {
                    // polled again after every turn
                    port.bytes.register(context.waker());
                    return match uart::take(buffer) {
                        0 => Poll::Pending,
                        count => Poll::Ready(count),
                    };
                }
                if port.reply.cuts != self.cuts {
                    self.cuts = port.reply.cuts;
                    return Poll::Ready(0);
                }
                let tail = port.ask.to_device_tail;
                let waiting = port.reply.to_device_head.wrapping_sub(tail);
                if waiting == 0 {
                    port.bytes.register(context.waker());
                    return Poll::Pending;
                }
                let count = buffer.len().min(waiting as usize);
                memory::read_ring(TO_DEVICE_AT, tail, &mut buffer[..count]);
                port.ask.to_device_tail = tail.wrapping_add(count as u32);
                Poll::Ready(count)
            })
        })
        .await
    }
}

/// Bytes to the host.
pub struct Sink;

impl board::ByteSink for Sink {
    async fn write(&mut self, frame: &[u8]) {
        if uart::is_link() {
            let mut given = 0;
            poll_fn(|context| {
                given += uart::give(&frame[given..]);
                if given < frame.len() {
                    port::with(|port| port.room.register(context.waker()));
                    return Poll::Pending;
                }
                Poll::Ready(())
            })
            .await;
            return;
        }
        poll_fn(|context| {
            port::with(|port| {
                let head = port.ask.to_host_head;
                let room = RING_BYTES - head.wrapping_sub(port.reply.to_host_tail);
                port.ask.to_host_full = u32::from((room as usize) < frame.len());
                if port.ask.to_host_full != 0 {
                    port.room.register(context.waker());
                    return Poll::Pending;
                }
                memory::write_ring(TO_HOST_AT, head, frame);
                port.ask.to_host_head = head.wrapping_add(frame.len() as u32);
                Poll::Ready(())
            })
        })
        .await;
    }
}

/// The simulator positions hammer and laser.
pub struct Stage;

impl board::Stage for Stage {
    const PRESENT: bool = true;

    fn go(&mut self, place: &Place) -> Result<(), Refusal> {
        let mut text = [0; TEXT_BYTES];
        let Some(order) = to_text(place, &mut text) else {
            return Err(refusal("the stage order does not fit"));
        };
        let length = memory::write_text(order);
        let reply = port::turn(Op::Stage, length);
        if reply.length == 0 {
            return Ok(());
        }
        let used = (reply.length as usize).min(text.len());
        memory::read(TEXT_AT, &mut text[..used]);
        Err(from_text(&text[..used]).unwrap_or_else(|| refusal("the stage's refusal is unreadable")))
    }
}

fn refusal(sentence: &str) -> Refusal {
    // the messages used here fit
    Refusal::Stage(String::try_from(sentence).unwrap_or_default())
}

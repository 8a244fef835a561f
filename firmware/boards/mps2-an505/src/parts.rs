//! The board's parts, as the firmware's contract asks for them, through the shared memory.

use core::future::poll_fn;
use core::task::Poll;

use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use heapless::String;
use jointrig_firmware::ad7606b::trouble::Trouble;
use jointrig_firmware::board::{self, Delivered, RanDry};
use jointrig_firmware::lockstep::{
    BLOCK_AT, DELIVERY_BYTES, DRIVE_AT, DRIVE_FULL_SCALE_V, Delivery, EMERGENCY_STOP, HELD, INTERLOCK_CLOSED,
    LOCAL_RESET, MUST_FAULT, MUST_OVERFLOW, MUST_PANIC, NEVER, Op, RING_BYTES, TEXT_AT, TEXT_BYTES,
    TO_DEVICE_AT, TO_HOST_AT, from_text, to_text,
};
use jointrig_protocol::answer::Refusal;
use jointrig_protocol::limits::{BLOCK_SAMPLE_BYTES, COIL_PULSE_CAP_US};
use jointrig_protocol::request::Stage as Place;

use crate::device::Shared;
use crate::{fault, memory, port, uart};

/// The emulated board: a name for its parts.
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

/// Converters whose blocks the simulator delivers.
pub struct Scans {
    core: &'static Shared,
    per_block: u64,
    rate_hz: u64,
    taken: u64,
    blocks: u32,
    last_report: Option<Trouble>,
}

impl Scans {
    /// Converters that deliver so many scans a block.
    pub fn new(core: &'static Shared, per_block: usize, rate_hz: u32) -> Self {
        let (per_block, rate_hz) = (per_block as u64, u64::from(rate_hz));
        Self { core, per_block, rate_hz, taken: 0, blocks: 0, last_report: None }
    }
}

impl board::Scans for Scans {
    fn can_be_held(&self) -> bool {
        port::with(|port| port.reply.inputs & HELD != 0)
    }

    async fn next(&mut self, block: &mut [u8; BLOCK_SAMPLE_BYTES]) -> Delivered {
        self.taken += self.per_block;
        // the instant of the block's last scan, rounded up to the clock's microsecond
        let at_us = (self.taken * 1_000_000).div_ceil(self.rate_hz);
        poll_fn(|context| {
            port::with(|port| {
                if port.reply.blocks != self.blocks {
                    port.ask.block_us = NEVER;
                    return Poll::Ready(());
                }
                port.ask.block_us = at_us;
                port.block.register(context.waker());
                Poll::Pending
            })
        })
        .await;
        self.blocks = self.blocks.wrapping_add(1);
        let inputs = port::with(|port| port.reply.inputs);
        assert!(inputs & MUST_PANIC == 0, "the simulator asked for a panic");
        if inputs & MUST_FAULT != 0 {
            fault::read_nowhere();
        }
        if inputs & MUST_OVERFLOW != 0 {
            fault::recurse(inputs);
        }
        let mut head = [0; DELIVERY_BYTES];
        memory::read(BLOCK_AT, &mut head);
        let delivery = Delivery::from_bytes(&head);
        memory::read(BLOCK_AT + DELIVERY_BYTES, block);
        if self.last_report != delivery.trouble {
            self.last_report = delivery.trouble;
            if let Some(trouble) = delivery.trouble {
                self.core.report_fault(trouble);
            }
        }
        // the clock of the conversions went on while some were lost
        self.taken = self.taken - self.per_block + u64::from(delivery.scans) + u64::from(delivery.missed);
        Delivered { scans: delivery.scans as u8, missed: delivery.missed }
    }
}

/// The coil of the simulated hammer, which ends any pulse at the cap by itself.
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

/// Guard and emergency stop of the simulated rig.
pub struct Inputs;

impl Inputs {
    fn bit(bit: u32) -> bool {
        port::with(|port| port.reply.inputs & bit != 0)
    }
}

impl board::Inputs for Inputs {
    fn interlock_closed(&mut self) -> bool {
        Self::bit(INTERLOCK_CLOSED)
    }

    fn emergency_stop(&mut self) -> bool {
        Self::bit(EMERGENCY_STOP)
    }

    fn local_reset(&mut self) -> bool {
        port::with(|port| {
            let turned = port.reply.inputs & LOCAL_RESET != 0;
            port.reply.inputs &= !LOCAL_RESET;
            turned
        })
    }
}

/// Bytes from the host.
#[derive(Default)]
pub struct Source {
    /// How often the link was cut, as far as the firmware was told.
    cuts: u32,
}

impl board::ByteSource for Source {
    async fn read(&mut self, buffer: &mut [u8]) -> usize {
        poll_fn(|context| {
            port::with(|port| {
                if uart::is_link() {
                    // looked at again after every turn
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

/// The simulator moves hammer and laser.
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
    // the sentences here are shorter than what fits
    Refusal::Stage(String::try_from(sentence).unwrap_or_default())
}

//! The simulator's side of the turns: the rig, the clock and the link.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::pin::pin;
use std::rc::Rc;
use std::sync::Arc;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use jointrig_firmware::board::{ByteSink, ByteSource, Coil, Drive, Inputs, Stage};
use jointrig_firmware::lockstep::{
    Ask, BLOCK_AT, DELIVERY_BYTES, DRIVE_AT, Delivery, EMERGENCY_STOP, HELD, INTERLOCK_CLOSED, LOCAL_RESET,
    LOG_AT, MUST_FAULT, MUST_OVERFLOW, MUST_PANIC, NEVER, Op, RING_BYTES, Reply, SEEN_AT, SLOW_AT,
    SLOW_BYTES, SLOW_MEASURED, Setup, TEXT_AT, TEXT_BYTES, TO_DEVICE_AT, TO_HOST_AT, from_text,
    seen_to_words, to_text,
};
use jointrig_logs::Table;
use jointrig_protocol::limits::{BLOCK_SAMPLE_BYTES, scans_per_block};
use jointrig_protocol::sync::{Clock, ClockFault};
use jointrig_protocol::{request, schema};
use serde::Serialize;

use super::Faults;
use super::faults::Happening;
use super::front_end::FrontEnd;
use super::process::Pipes;
use super::shared_ram::SharedRam;
use crate::board::parts::VirtualDrive;
use crate::board::parts::{VirtualCoil, VirtualInputs, VirtualStage, describe, fill};
use crate::board::sync::SyncPort;
use crate::board::{Controls, Options, name, ring_slots};
use crate::executor::Woken;
use crate::link::DeviceEnd;
use crate::rig::Rig;

/// How often a board whose link is its UART is polled while it is idle.
const UART_LOOK: Duration = Duration::from_micros(200);

/// Number of the newest log lines that are kept.
const SAID: usize = 16;

/// Why serving ended, as a message.
type Ended = String;

/// Result of a request.
enum Next {
    Answer,
    End,
}

/// The simulator's state of one emulated board.
pub struct Server {
    rig: Rc<RefCell<Rig>>,
    coil: VirtualCoil,
    drive: VirtualDrive,
    inputs: VirtualInputs,
    stage: VirtualStage,
    faults: Arc<Faults>,
    controls: Arc<Controls>,
    link: DeviceEnd,
    woken: Arc<Woken>,
    waker: Waker,
    pipes: Pipes,
    ram: SharedRam,
    setup: Setup,
    per_block: usize,
    front_end: FrontEnd,
    free_running: bool,
    reply: Reply,
    port: SyncPort,
    /// Scans since the start, including lost ones.
    produced: u64,
    /// The image's log strings, if it has any.
    strings: Option<Table>,
    /// The newest log lines.
    said: VecDeque<String>,
}

impl Server {
    /// A server that has not started yet.
    pub fn new(
        rig: Rig,
        options: &Options,
        link: &DeviceEnd,
        controls: &Arc<Controls>,
        faults: &Arc<Faults>,
        pipes: Pipes,
        ram: SharedRam,
    ) -> Self {
        // checked by the caller: the emulated converters have 16 bits, so a channel is one word
        let channels = describe(rig.channels());
        let per_block = scans_per_block(channels.len()).expect("the rig has ten channels");
        let setup = Setup {
            serial: name(&format!("qemu-{:016x}", options.seed)),
            scan_rate_hz: rig.scan_rate_hz(),
            boot: options.boot,
            slots: ring_slots(rig.scan_rate_hz(), per_block) as u32,
            channels: channels.iter().cloned().collect(),
        };
        let rig = Rc::new(RefCell::new(rig));
        let woken = Arc::new(Woken::default());
        Self {
            coil: VirtualCoil::new(&rig, controls),
            drive: VirtualDrive::default(),
            inputs: VirtualInputs::new(controls, &rig),
            stage: VirtualStage::new(&rig),
            faults: Arc::clone(faults),
            controls: Arc::clone(controls),
            link: link.clone(),
            waker: Waker::from(Arc::clone(&woken)),
            woken,
            pipes,
            ram,
            setup,
            per_block,
            front_end: FrontEnd::new(per_block, channels.len()),
            free_running: options.free_running,
            port: SyncPort::default(),
            reply: Reply { inputs: INTERLOCK_CLOSED, ..Reply::default() },
            produced: 0,
            strings: None,
            said: VecDeque::new(),
            rig,
        }
    }

    /// Sets the strings with which the image's log lines are decoded.
    pub fn with_strings(mut self, strings: Option<Table>) -> Self {
        self.strings = strings;
        self
    }

    /// The first turn: the board introduces itself and receives its configuration.
    pub fn start(&mut self) -> Result<(), Ended> {
        let ask = self.wait()?;
        self.ram.forget_name();
        if Op::from_word(ask.op) != Some(Op::Start) {
            return Err("it does not begin as this simulator's firmware does: rebuild both".into());
        }
        if ask.argument != schema::HASH as u32 {
            return Err("its protocol differs from this simulator's: rebuild both".into());
        }
        self.put_text(&self.setup.clone())?;
        self.set_inputs();
        self.put_slow()?;
        self.answer()
    }

    /// Takes turns until the link is closed or the board breaks down.
    pub fn serve(&mut self) -> Result<(), Ended> {
        loop {
            let ask = self.wait()?;
            self.hear_log(&ask).map_err(|error| broken(&error))?;
            (self.reply.length, self.reply.ran_dry) = (0, 0);
            match Op::from_word(ask.op) {
                Some(Op::Idle) => match self.idle(&ask).map_err(|error| broken(&error))? {
                    Next::Answer => {}
                    Next::End => return Ok(()),
                },
                Some(Op::Pulse) => self.coil.pulse(ask.argument),
                Some(Op::Off) => self.coil.off(),
                Some(Op::Play) => self.play(ask.argument).map_err(|error| broken(&error))?,
                Some(Op::Rest) => self.drive.rest(),
                Some(Op::Join) => {
                    self.front_end.join(self.produced);
                    self.reply.length = self.produced as u32;
                }
                Some(Op::Clock) => {
                    let rate_hz = self.setup.scan_rate_hz;
                    let clock = if ask.argument == 0 { Clock::Internal } else { Clock::External { rate_hz } };
                    self.reply.length = match self.port.clock(self.controls.wires(), self.produced, clock) {
                        Ok(()) => 0,
                        Err(ClockFault::Absent) => 1,
                        Err(_) => 2,
                    };
                }
                Some(Op::Mark) => {
                    self.reply.length = SyncPort::mark(self.controls.wires(), self.produced).part.into();
                }
                Some(Op::Stage) => self.go(ask.argument)?,
                Some(Op::Panic) => {
                    let text = self.ram.text(ask.argument).map_err(|error| broken(&error))?;
                    return Err(format!("the firmware failed: {}", String::from_utf8_lossy(&text)));
                }
                Some(Op::Start) | None => {
                    return Err(format!("the firmware asks for something unknown ({})", ask.op));
                }
            }
            self.answer()?;
        }
    }

    /// Waits for this side's turn.
    fn wait(&mut self) -> Result<Ask, Ended> {
        let mut byte = [0];
        match self.pipes.ring.read(&mut byte) {
            Ok(1) => self.ram.ask().map_err(|error| broken(&error)),
            Ok(_) => Err("QEMU ended by itself".into()),
            Err(error) => Err(broken(&error)),
        }
    }

    fn answer(&mut self) -> Result<(), Ended> {
        self.ram
            .reply(&self.reply)
            .and_then(|()| self.pipes.answer.write_all(&[1]))
            .map_err(|error| broken(&error))
    }

    /// Called when all of the board's tasks wait: passes on what has arrived, or lets time advance.
    fn idle(&mut self, ask: &Ask) -> io::Result<Next> {
        loop {
            if self.link.is_closed() {
                return Ok(Next::End);
            }
            self.woken.take();
            let stalled = self.faults.stalled(self.produced);
            if !stalled {
                let room_made = self.move_out(ask)? && ask.to_host_full != 0;
                if self.move_in(ask)? || room_made {
                    return Ok(Next::Answer);
                }
            }
            if stalled || self.free_running || ask.block_us != NEVER {
                self.go_on(ask)?;
                return Ok(Next::Answer);
            }
            if ask.argument == 1 {
                std::thread::sleep(UART_LOOK);
                return Ok(Next::Answer);
            }
            self.link.sleep(&self.woken);
        }
    }

    /// Jumps to the next alarm or to the end of the awaited block.
    fn go_on(&mut self, ask: &Ask) -> io::Result<()> {
        let block_us = self.faults.delivered_at(ask.block_us, self.setup.scan_rate_hz, self.per_block);
        let next = ask.alarm_us.min(block_us);
        if next == NEVER {
            return Err(io::Error::other("the board waits forever: no alarm is set"));
        }
        self.reply.now_us = self.reply.now_us.max(next);
        if block_us <= self.reply.now_us {
            let first = self.produced;
            let (mut delivery, words) = match self.faults.of_block(first, self.per_block) {
                Happening::Sent(slip, at) => {
                    let codes = self.convert(self.front_end.blocks_for(&slip));
                    self.front_end.deliver(first, &codes, &slip, at)
                }
                Happening::StoodStill(blocks) => {
                    // the rig advances during lost blocks too
                    self.convert(blocks as usize);
                    self.front_end.stood_still(first, self.produced - first)
                }
                Happening::Noticed(trouble) => {
                    self.convert(1);
                    let periods = self.produced as u32;
                    (Delivery { trouble: Some(trouble), periods, ..Delivery::default() }, Vec::new())
                }
            };
            if let Some(seen) = self.port.seen(self.controls.wires(), first, self.produced) {
                let words = seen_to_words(&seen).map(u32::to_le_bytes);
                self.ram.write(SEEN_AT, words.as_flattened())?;
                delivery.seen = true;
            }
            self.ram.write(BLOCK_AT, &delivery.to_bytes())?;
            self.ram.write(BLOCK_AT + DELIVERY_BYTES, &words)?;
            self.reply.blocks += 1;
            self.set_inputs();
            self.put_slow().map_err(io::Error::other)?;
        }
        Ok(())
    }

    /// Advances the rig by `blocks` blocks; returns their codes, scan by scan.
    fn convert(&mut self, blocks: usize) -> Vec<i16> {
        let (channels, per_block) = (self.setup.channels.len(), self.per_block);
        let mut codes = Vec::with_capacity(blocks * per_block * channels);
        for _ in 0..blocks {
            let mut samples = [0; BLOCK_SAMPLE_BYTES];
            let mut rig = self.rig.borrow_mut();
            fill(&mut rig, &self.drive, &self.controls, channels, per_block, &mut samples);
            let pairs = &samples.as_chunks().0[..per_block * channels];
            codes.extend(pairs.iter().map(|pair| i16::from_le_bytes(*pair)));
        }
        self.produced += (blocks * per_block) as u64;
        codes
    }

    /// Writes the slow values to the board's memory, if new ones were measured.
    fn put_slow(&mut self) -> Result<(), Ended> {
        let Some(slow) = self.inputs.slow() else { return Ok(()) };
        let mut buffer = [0; SLOW_BYTES];
        let text = to_text(&slow, &mut buffer).ok_or("slow values do not fit the shared memory")?;
        let length = (text.len() as u32).to_le_bytes();
        self.ram
            .write(SLOW_AT, &length)
            .and_then(|()| self.ram.write(SLOW_AT + length.len(), text))
            .map_err(|error| broken(&error))?;
        self.reply.inputs |= SLOW_MEASURED;
        Ok(())
    }

    fn set_inputs(&mut self) {
        let bit = |on: bool, bit: u32| if on { bit } else { 0 };
        self.reply.inputs = bit(self.inputs.interlock_closed(), INTERLOCK_CLOSED)
            | bit(self.inputs.emergency_stop(), EMERGENCY_STOP)
            | bit(self.inputs.local_reset(), LOCAL_RESET)
            | bit(!self.free_running && !self.faults.let_run(self.produced, self.per_block), HELD)
            | bit(self.faults.must_panic(), MUST_PANIC)
            | bit(self.faults.must_fault(), MUST_FAULT)
            | bit(self.faults.must_overflow(), MUST_OVERFLOW);
    }

    /// Moves bytes from the board to the host; returns whether any could be moved.
    fn move_out(&mut self, ask: &Ask) -> io::Result<bool> {
        let tail = self.reply.to_host_tail;
        let count = ask.to_host_head.wrapping_sub(tail).min(RING_BYTES);
        if count == 0 {
            return Ok(false);
        }
        let mut bytes = vec![0; count as usize];
        self.ram.read_ring(TO_HOST_AT, tail, &mut bytes)?;
        let taken = once(self.link.write(&bytes), &self.waker).is_ready();
        if taken {
            self.reply.to_host_tail = tail.wrapping_add(count);
        }
        Ok(taken)
    }

    /// Moves bytes from the host to the board; returns whether there were any.
    fn move_in(&mut self, ask: &Ask) -> io::Result<bool> {
        let head = self.reply.to_device_head;
        let room = RING_BYTES - head.wrapping_sub(ask.to_device_tail);
        let mut bytes = [0; 4096];
        let room = bytes.len().min(room as usize);
        if room == 0 {
            return Ok(true);
        }
        let Poll::Ready(count) = once(self.link.read(&mut bytes[..room]), &self.waker) else {
            return Ok(false);
        };
        if count == 0 {
            self.reply.cuts += 1;
            return Ok(true);
        }
        self.ram.write_ring(TO_DEVICE_AT, head, &bytes[..count])?;
        self.reply.to_device_head = head.wrapping_add(count as u32);
        Ok(true)
    }

    /// Reads codes for the drive.
    fn play(&mut self, count: u32) -> io::Result<()> {
        let mut bytes = [0; BLOCK_SAMPLE_BYTES];
        let length = (2 * count as usize).min(bytes.len());
        self.ram.read(DRIVE_AT, &mut bytes[..length])?;
        let codes: Vec<i16> =
            bytes[..length].as_chunks().0.iter().map(|pair| i16::from_le_bytes(*pair)).collect();
        self.reply.ran_dry = u32::from(self.drive.play(&codes).is_err());
        Ok(())
    }

    /// Moves hammer and laser.
    fn go(&mut self, length: u32) -> Result<(), Ended> {
        let text = self.ram.text(length).map_err(|error| broken(&error))?;
        let place: request::Stage = from_text(&text)
            .ok_or("the firmware's stage order is unreadable: rebuild image and simulator")?;
        if let Err(refusal) = self.stage.go(&place) {
            self.put_text(&refusal)?;
        }
        Ok(())
    }

    fn put_text<T: Serialize>(&mut self, message: &T) -> Result<(), Ended> {
        let mut buffer = [0; TEXT_BYTES];
        let text = to_text(message, &mut buffer).ok_or("a message does not fit the shared memory")?;
        self.reply.length = text.len() as u32;
        self.ram.write(TEXT_AT, text).map_err(|error| broken(&error))
    }

    /// Reads the board's log lines as they are written. The host receives the same lines over the
    /// link; here they are for debugging, and for the report of a board that broke down.
    fn hear_log(&mut self, ask: &Ask) -> io::Result<()> {
        // a board that breaks down reports that by other means
        let count = ask.log_head.wrapping_sub(self.reply.log_tail);
        if count == 0 || count > RING_BYTES {
            return Ok(());
        }
        let mut bytes = vec![0; count as usize];
        self.ram.read_ring(LOG_AT, self.reply.log_tail, &mut bytes)?;
        self.reply.log_tail = ask.log_head;
        let (said, Some(strings)) = (&mut self.said, &self.strings) else { return Ok(()) };
        // each turn transfers whole lines
        strings.lines(&bytes, |line| {
            log::debug!(target: "qemu", "{} {}", line.level, line.text);
            if said.len() == SAID {
                said.pop_front();
            }
            said.push_back(format!("{} {}", line.level, line.text));
        });
        Ok(())
    }

    /// The newest log lines, oldest first.
    pub fn last_lines(&self) -> impl Iterator<Item = &str> {
        self.said.iter().map(String::as_str)
    }
}

/// Polls once: the link's futures either complete immediately or store the waker.
fn once<F: Future>(future: F, waker: &Waker) -> Poll<F::Output> {
    pin!(future).poll(&mut Context::from_waker(waker))
}

fn broken(error: &io::Error) -> Ended {
    format!("the emulated board's memory or pipe failed: {error}")
}

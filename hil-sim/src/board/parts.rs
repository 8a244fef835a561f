//! The virtual board's parts, which implement the firmware's board traits.
//!
//! The shaker's drive of a virtual board: codes that are given after one block are played during
//! the next.

use super::sync::{PERIOD, SyncPort, Wires};
use crate::link::DeviceEnd;
use crate::rig;
use crate::rig::config::Cable;
use crate::rig::{Configuration, JointState, Measured, Rig, RigError, config};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Instant, Timer};
use jointrig_firmware::board;
use jointrig_firmware::board::{Board, Coil, Delivered, Drive, Inputs, RanDry, Scans, Stage};
use jointrig_firmware::lockstep::DRIVE_FULL_SCALE_V;
use jointrig_firmware::ruler::Ago;
use jointrig_protocol::answer::Refusal;
use jointrig_protocol::channel::{Axis, Channel, Quantity, Role};
use jointrig_protocol::limits::{BLOCK_SAMPLE_BYTES, COIL_PULSE_CAP_US};
use jointrig_protocol::request;
use jointrig_protocol::slow::{Slow, Supply};
use jointrig_protocol::sync::{Clock, ClockFault};
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The native virtual board.
pub struct Virtual;

impl Board for Virtual {
    type Mutex = NoopRawMutex;
    type Scans = VirtualScans;
    type Coil = VirtualCoil;
    type Drive = VirtualDrive;
    type Inputs = VirtualInputs;
    type Source = DeviceEnd;
    type Sink = DeviceEnd;
    type Stage = VirtualStage;
}

/// Controls and observations on the rig's side, usable from any thread.
#[derive(Debug, Default)]
pub struct Controls {
    guard_open: AtomicBool,
    pressed: AtomicBool,
    reset: AtomicBool,
    pulses_us: Mutex<Vec<u32>>,
    /// A new normal load that has not been passed to the rig yet (N).
    normal_load_n: Mutex<Option<f64>>,
    watches_joint: AtomicBool,
    /// Scans that the converters will lose: the first, and how many.
    lost: Mutex<(u64, u64)>,
    /// Cables changed since the start: the hammer's force cell, the shaker's.
    cables: Mutex<[Option<Cable>; 2]>,
    seen: Mutex<Seen>,
    wires: Wires,
}

/// State of the rig at the end of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Scans since the start, including lost ones.
    pub scans: u64,
    /// The scan after the last one in which the shaker was driven; 0 when it was never driven.
    pub driven_until: u64,
    /// The drive in the last scan, V.
    pub drive_v: f64,
    /// The joint, while it is watched ([`Controls::watch_joint`]); `None` outside the assembly.
    pub joint: Option<JointState>,
}

impl Controls {
    /// The wires from the sync port to another recorder.
    pub fn wires(&self) -> &Wires {
        &self.wires
    }

    /// Opens or closes the guard over the hammer.
    pub fn open_guard(&self, open: bool) {
        self.guard_open.store(open, Ordering::Release);
    }

    /// Presses or releases the emergency stop.
    pub fn press_emergency_stop(&self, pressed: bool) {
        self.pressed.store(pressed, Ordering::Release);
    }

    /// Turns the key that resets a released emergency stop.
    pub fn reset(&self) {
        self.reset.store(true, Ordering::Release);
    }

    /// The durations of all coil pulses, µs, as they acted on the rig.
    pub fn coil_pulses_us(&self) -> Vec<u32> {
        self.pulses_us.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Sets the normal load, N, from the next block on.
    ///
    /// # Errors
    /// [`RigError::Field`] for a load that is negative or not a number.
    pub fn set_normal_load(&self, normal_load_n: f64) -> Result<(), RigError> {
        config::normal_load(normal_load_n)?;
        *self.normal_load_n.lock().unwrap_or_else(PoisonError::into_inner) = Some(normal_load_n);
        Ok(())
    }

    /// Makes the native board's converters lose the blocks that contain these scans and deliver
    /// nothing meanwhile. An emulated board has its own faults.
    pub fn lose_scans(&self, from_scan: u64, scans: u64) {
        *self.lost.lock().unwrap_or_else(PoisonError::into_inner) = (from_scan, scans);
    }

    /// Changes what the supply of the hammer's force cell detects.
    pub fn set_force_cable(&self, cable: Cable) {
        self.cables.lock().unwrap_or_else(PoisonError::into_inner)[0] = Some(cable);
    }

    /// Changes what the supply of the shaker's force cell detects.
    pub fn set_excitation_cable(&self, cable: Cable) {
        self.cables.lock().unwrap_or_else(PoisonError::into_inner)[1] = Some(cable);
    }

    /// Number of blocks lost if the next one begins with `scan`.
    fn lost_blocks(&self, scan: u64, per_block: u64) -> u64 {
        let (from, scans) = *self.lost.lock().unwrap_or_else(PoisonError::into_inner);
        if scan < from || scan >= from + scans { 0 } else { (from + scans - scan).div_ceil(per_block) }
    }

    /// Observes the joint from the next block on, which costs more time than the block itself.
    pub fn watch_joint(&self) {
        self.watches_joint.store(true, Ordering::Release);
    }

    /// State of the rig at the end of the last block.
    pub fn seen(&self) -> Seen {
        *self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The rig's channels as protocol types. They are leaked: a firmware's channel table is constant,
/// and a program creates only a few boards.
pub(crate) fn describe(channels: &[rig::Channel]) -> &'static [Channel] {
    let cell_or_other = |channel: &rig::Channel| match channel.name.as_str() {
        "force" => Role::HammerForce,
        "ldv_a" => Role::SpecimenA,
        "ldv_b" => Role::SpecimenB,
        "excitation" => Role::Excitation,
        name if name.starts_with("lc_") => Role::LoadCell,
        "vib_x" => Role::Response(Axis::X),
        "vib_y" => Role::Response(Axis::Y),
        "vib_z" => Role::Response(Axis::Z),
        _ => Role::Auxiliary,
    };
    let described = channels.iter().map(|channel| Channel {
        name: super::name(&channel.name),
        role: cell_or_other(channel),
        quantity: match channel.quantity {
            Measured::Force => Quantity::Force,
            Measured::Velocity => Quantity::Velocity,
            Measured::Acceleration => Quantity::Acceleration,
        },
        units_per_volt: (channel.units_per_volt * f64::from(channel.polarity)) as f32,
        range_v: channel.range_v as f32,
        delay_ns: (channel.delay_s * 1e9).round() as u32,
        bits: channel.bits,
    });
    Box::leak(described.collect::<Vec<_>>().into_boxed_slice())
}

/// Converters that sample the simulated rig.
pub struct VirtualScans {
    rig: Rc<RefCell<Rig>>,
    drive: VirtualDrive,
    controls: Arc<Controls>,
    /// 16-bit words per scan.
    words: usize,
    per_block: usize,
    rate_hz: u64,
    scans: u64,
    /// The sync port has been read up to this scan.
    looked_at: u64,
    port: SyncPort,
    held: bool,
    sampling: Rc<Cell<bool>>,
}

impl VirtualScans {
    pub(super) fn new(
        rig: &Rc<RefCell<Rig>>,
        drive: &VirtualDrive,
        controls: &Arc<Controls>,
        [words, per_block]: [usize; 2],
        held: bool,
    ) -> Self {
        let rate_hz = u64::from(rig.borrow().scan_rate_hz());
        let (rig, drive, controls) = (Rc::clone(rig), drive.clone(), Arc::clone(controls));
        Self {
            rig,
            drive,
            controls,
            words,
            per_block,
            rate_hz,
            scans: 0,
            looked_at: 0,
            port: SyncPort::default(),
            held,
            sampling: Rc::default(),
        }
    }

    /// True while the converters run, that is while virtual time may advance.
    pub(super) fn sampling(&self) -> Rc<Cell<bool>> {
        Rc::clone(&self.sampling)
    }
}

impl Scans for VirtualScans {
    const PERIOD: u32 = PERIOD;

    fn seen(&mut self) -> Option<board::Seen> {
        let from = std::mem::replace(&mut self.looked_at, self.scans);
        self.port.seen(self.controls.wires(), from, self.scans)
    }

    fn clock(&mut self, clock: Clock) -> Result<(), ClockFault> {
        self.port.clock(self.controls.wires(), self.scans, clock)
    }

    fn mark(&mut self) -> Option<Ago> {
        Some(SyncPort::mark(self.controls.wires(), self.scans))
    }

    fn can_be_held(&self) -> bool {
        self.held
    }

    async fn next(&mut self, block: &mut [u8; BLOCK_SAMPLE_BYTES]) -> Delivered {
        let lost = self.controls.lost_blocks(self.scans, self.per_block as u64);
        self.scans += (lost + 1) * self.per_block as u64;
        self.sampling.set(true);
        // the time of the block's last scan, rounded up to the clock's microsecond
        Timer::at(Instant::from_micros((self.scans * 1_000_000).div_ceil(self.rate_hz))).await;
        self.sampling.set(false);
        // the rig advances during lost blocks too
        for _ in 0..=lost {
            fill(&mut self.rig.borrow_mut(), &self.drive, &self.controls, self.words, self.per_block, block);
        }
        Delivered { scans: self.per_block as u8, missed: (lost * self.per_block as u64) as u32, loud: true }
    }
}

/// Advances the rig by one block with the ordered drive, and writes its codes.
pub(super) fn fill(
    rig: &mut Rig,
    drive: &VirtualDrive,
    controls: &Controls,
    words: usize,
    per_block: usize,
    block: &mut [u8; BLOCK_SAMPLE_BYTES],
) {
    let mut codes = [0; jointrig_protocol::limits::MAX_WORDS];
    if let Some(load) = controls.normal_load_n.lock().unwrap_or_else(PoisonError::into_inner).take() {
        // Checked when it was ordered, except for a load that varies too steeply at that value:
        // then the old load stays.
        let _ = rig.set_normal_load(load);
    }
    let mut seen = controls.seen();
    for scan in block.chunks_exact_mut(2 * words).take(per_block) {
        seen.drive_v = drive.next_v();
        seen.scans += 1;
        if seen.drive_v != 0.0 {
            seen.driven_until = seen.scans;
        }
        rig.drive(seen.drive_v);
        rig.scan(&mut codes[..words]);
        for (bytes, code) in scan.as_chunks_mut::<2>().0.iter_mut().zip(codes) {
            *bytes = code.to_le_bytes();
        }
    }
    if controls.watches_joint.load(Ordering::Acquire) {
        seen.joint = rig.joint();
    }
    *controls.seen.lock().unwrap_or_else(PoisonError::into_inner) = seen;
}

/// The rig's coil behind a timer that ends every pulse at the upper limit.
pub struct VirtualCoil {
    rig: Rc<RefCell<Rig>>,
    controls: Arc<Controls>,
}

impl VirtualCoil {
    pub(super) fn new(rig: &Rc<RefCell<Rig>>, controls: &Arc<Controls>) -> Self {
        Self { rig: Rc::clone(rig), controls: Arc::clone(controls) }
    }
}

impl Coil for VirtualCoil {
    fn cap_us(&self) -> u32 {
        COIL_PULSE_CAP_US
    }

    fn pulse(&mut self, width_us: u32) {
        let width_us = width_us.min(COIL_PULSE_CAP_US);
        self.controls.pulses_us.lock().unwrap_or_else(PoisonError::into_inner).push(width_us);
        self.rig.borrow_mut().fire(f64::from(width_us) * 1e-6);
    }

    fn off(&mut self) {
        let mut rig = self.rig.borrow_mut();
        rig.coil_off();
        // the duration that acted on the rig: the last pulse may have been cut short
        if let (Some(felt), Some(told)) = (
            rig.coil_pulses_s().last(),
            self.controls.pulses_us.lock().unwrap_or_else(PoisonError::into_inner).last_mut(),
        ) {
            *told = (*told).min((felt * 1e6).round() as u32);
        }
    }
}

/// Guard, emergency stop, and slowly measured values.
pub struct VirtualInputs {
    controls: Arc<Controls>,
    rig: Rc<RefCell<Rig>>,
    /// Blocks until the slow values are measured again.
    blocks_left: u32,
}

/// Slow values are measured ten times a second, as on the wired board: every 213 blocks of 24 scans
/// at 51.2 kHz.
const SLOW_BLOCKS: u32 = 213;

impl VirtualInputs {
    pub(super) fn new(controls: &Arc<Controls>, rig: &Rc<RefCell<Rig>>) -> Self {
        Self { controls: Arc::clone(controls), rig: Rc::clone(rig), blocks_left: 0 }
    }

    /// The current slow values.
    pub(super) fn measured(&self) -> Slow {
        let (rig, seen) = (self.rig.borrow(), self.controls.seen());
        let around = &rig.config().surroundings;
        let seconds = seen.scans as f64 / f64::from(rig.scan_rate_hz());
        let changed = *self.controls.cables.lock().unwrap_or_else(PoisonError::into_inner);
        let cables = [("force", around.force_cable), ("excitation", around.excitation_cable)];
        let supplies = cables.into_iter().zip(changed).filter_map(|((name, cable), changed)| {
            let channel = rig.channels().iter().position(|channel| channel.name == name)? as u8;
            Some(Supply { channel, bias_v: changed.unwrap_or(cable).bias_v() })
        });
        Slow {
            temperature_c: Some((around.temperature_c + around.warming_k_per_s * seconds) as f32),
            supplies: supplies.collect(),
        }
    }
}

impl Inputs for VirtualInputs {
    fn slow(&mut self) -> Option<Slow> {
        if self.blocks_left > 0 {
            self.blocks_left -= 1;
            return None;
        }
        self.blocks_left = SLOW_BLOCKS;
        Some(self.measured())
    }

    fn interlock_closed(&mut self) -> bool {
        !self.controls.guard_open.load(Ordering::Acquire)
    }

    fn emergency_stop(&mut self) -> bool {
        self.controls.pressed.load(Ordering::Acquire)
    }

    fn local_reset(&mut self) -> bool {
        self.controls.reset.swap(false, Ordering::AcqRel)
    }
}

/// Moves the simulated hammer and laser.
pub struct VirtualStage(Rc<RefCell<Rig>>);

impl VirtualStage {
    pub(super) fn new(rig: &Rc<RefCell<Rig>>) -> Self {
        Self(Rc::clone(rig))
    }
}

impl Stage for VirtualStage {
    const PRESENT: bool = true;

    fn go(&mut self, place: &request::Stage) -> Result<(), Refusal> {
        let configuration = match place.configuration {
            request::Configuration::A => Configuration::A,
            request::Configuration::B => Configuration::B,
            request::Configuration::Ajb => Configuration::Ajb,
        };
        self.0
            .borrow_mut()
            .stage(configuration, &place.impact, &place.response, place.attempt)
            .map_err(|error| Refusal::Stage(super::text(&error.to_string())))
    }
}

/// Queue of drive codes from the firmware to the rig.
#[derive(Clone, Debug, Default)]
pub struct VirtualDrive(Rc<RefCell<Motion>>);

#[derive(Debug, Default)]
struct Motion {
    codes: VecDeque<i16>,
    /// More codes will follow.
    open: bool,
    /// A scan of an open motion found no code. The output stays at rest until the firmware has been
    /// notified.
    dry: bool,
}

impl VirtualDrive {
    /// The voltage of the next scan; 0 when nothing was given for it.
    pub fn next_v(&self) -> f64 {
        let mut motion = self.0.borrow_mut();
        let code = motion.codes.pop_front();
        motion.dry |= motion.open && code.is_none();
        f64::from(code.unwrap_or(0)) / f64::from(i16::MAX) * f64::from(DRIVE_FULL_SCALE_V)
    }
}

impl Drive for VirtualDrive {
    fn full_scale_v(&self) -> f32 {
        DRIVE_FULL_SCALE_V
    }

    fn play(&mut self, codes: &[i16]) -> Result<(), RanDry> {
        let mut motion = self.0.borrow_mut();
        if motion.dry {
            *motion = Motion::default();
            return Err(RanDry);
        }
        motion.open = !codes.is_empty();
        motion.codes.extend(codes);
        Ok(())
    }

    fn rest(&mut self) {
        *self.0.borrow_mut() = Motion::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn played(drive: &VirtualDrive, scans: usize) -> Vec<f64> {
        (0..scans).map(|_| drive.next_v()).collect()
    }

    #[test]
    fn a_motion_that_is_given_on_never_rests_and_one_that_is_not_runs_dry_once() {
        let mut drive = VirtualDrive::default();
        assert_eq!(played(&drive, 3), [0.0; 3], "nothing was begun");
        assert_eq!(drive.play(&[i16::MAX; 2]), Ok(()));
        assert_eq!(played(&drive, 2), [10.0; 2]);
        assert_eq!(drive.play(&[i16::MAX; 2]), Ok(()));
        assert_eq!(played(&drive, 4), [10.0, 10.0, 0.0, 0.0]);
        assert_eq!(drive.play(&[i16::MAX; 2]), Err(RanDry));
        assert_eq!(played(&drive, 2), [0.0; 2], "it took nothing");
        assert_eq!(drive.play(&[i16::MAX; 2]), Ok(()), "another motion");
    }

    #[test]
    fn a_motion_that_ends_does_not_run_dry() {
        let mut drive = VirtualDrive::default();
        for _ in 0..2 {
            assert_eq!(drive.play(&[i16::MAX]), Ok(()));
            assert_eq!(drive.play(&[]), Ok(()));
            assert_eq!(played(&drive, 3), [10.0, 0.0, 0.0]);
        }
        assert_eq!(drive.play(&[i16::MAX; 5]), Ok(()));
        drive.rest();
        assert_eq!(played(&drive, 3), [0.0; 3]);
        assert_eq!(drive.play(&[i16::MAX]), Ok(()));
    }
}

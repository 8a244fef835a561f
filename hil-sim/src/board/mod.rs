//! The native virtual board: the real firmware library over the simulated rig, in virtual time.
//!
//! One board is one thread. Its converters advance the rig scan by scan, its coil is the rig's, and
//! its link is a pair of byte queues. Virtual time stops while no stream is running, and when the
//! board is half a ring ahead of the host's acknowledgement; so a run is bit-for-bit repeatable,
//! however fast host and machine are.

mod parts;
#[cfg(unix)]
pub mod qemu;
mod sync;

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::thread::JoinHandle;

use heapless::String as Text;
use jointrig_firmware::board::Drive;
use jointrig_firmware::ring::Slot;
use jointrig_firmware::{Core, Facts};
use jointrig_protocol::answer::{Info, Reset};
use jointrig_protocol::channel::words_per_scan;
use jointrig_protocol::limits::{COIL_PULSE_CAP_US, scans_per_block};

use crate::executor::{Poller, Polling, Woken, jump};
use crate::link::{DeviceEnd, HostEnd, pair};
use crate::rig::{Rig, RigConfig, RigError};
use jointrig_native::tasks::{NativeCore, Parts};
use parts::VirtualDrive;
pub(crate) use parts::describe;
pub use parts::{Controls, Seen, Virtual};
use parts::{VirtualCoil, VirtualInputs, VirtualScans, VirtualStage};
pub use sync::Wires;

/// Minimum duration of the scans that the ring holds (s).
const RING_S: f64 = 1.0;

/// Options for running a board.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Seed of noise, scatter and every position error.
    pub seed: u64,
    /// The order in which the firmware's tasks are polled; results do not depend on it.
    pub polling: Polling,
    /// Whether time advances without the host: for tests of a lost link. Such a run is not
    /// repeatable.
    pub free_running: bool,
    /// The device's boot counter.
    pub boot: u32,
    /// For an emulated board: its link is UART 0, connected to this target (QEMU's `-serial`), and
    /// the returned host end is not used. Such a run is not repeatable.
    pub uart: Option<String>,
    /// Energy that the contact's friction has dissipated before, J; only a contact that wears
    /// depends on it.
    pub worn_j: f64,
}

/// Reason why a board could not start or has stopped.
#[derive(Debug, thiserror::Error)]
pub enum BoardError {
    /// The rig's description is invalid.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The thread could not be created.
    #[error("the simulated board could not start its thread: {0}")]
    Thread(#[from] std::io::Error),
}

/// A running board. Dropping it stops it.
pub struct VirtualBoard {
    link: DeviceEnd,
    controls: Arc<Controls>,
    thread: Option<JoinHandle<()>>,
}

impl VirtualBoard {
    /// Starts a board over the rig described by `rig_toml` (the built-in one if `None`).
    ///
    /// # Errors
    /// [`BoardError`] with the invalid line and field.
    pub fn start(rig_toml: Option<&str>, seed: u64) -> Result<(Self, HostEnd), BoardError> {
        let config = RigConfig::of_device(rig_toml)?;
        Self::start_with(&config, &Options { seed, ..Options::default() })
    }

    /// Starts a board over this rig.
    ///
    /// # Errors
    /// [`BoardError`].
    pub fn start_with(config: &RigConfig, options: &Options) -> Result<(Self, HostEnd), BoardError> {
        let rig = Rig::new(config, options.seed)?.after_wear(options.worn_j)?;
        let (host, device) = pair();
        let controls = Arc::new(Controls::default());
        let thread = std::thread::Builder::new().name("virtual board".into()).spawn({
            let (device, controls, options) = (device.clone(), Arc::clone(&controls), options.clone());
            move || run(rig, &options, &device, &controls)
        })?;
        Ok((Self { link: device, controls, thread: Some(thread) }, host))
    }

    /// Controls and observations on the rig's side.
    pub fn controls(&self) -> &Arc<Controls> {
        &self.controls
    }
}

impl Drop for VirtualBoard {
    fn drop(&mut self) {
        self.link.close();
        if let Some(thread) = self.thread.take() {
            // the board's own thread has already printed a panic
            let _ = thread.join();
        }
    }
}

/// The board's thread, which owns everything of the device.
fn run(rig: Rig, options: &Options, link: &DeviceEnd, controls: &Arc<Controls>) {
    let channels: &'static [_] = describe(rig.channels());
    let rate_hz = rig.scan_rate_hz();
    let words = words_per_scan(channels);
    let per_block = scans_per_block(words).expect("the rig has ten channels or more");
    let slots = ring_slots(rate_hz, per_block);
    let drive = VirtualDrive::default();
    let facts = Facts {
        board: name(Info::VIRTUAL_BOARD),
        serial: name(&format!("sim-{:016x}", options.seed)),
        target: text(jointrig_native::TARGET),
        build: 0,
        scan_rate_hz: rate_hz,
        channels,
        coil_cap_us: COIL_PULSE_CAP_US,
        stage: true,
        sync: true,
        drive_v: drive.full_scale_v(),
        reset: Reset::Power,
        boot: options.boot,
    };
    let core: Rc<NativeCore> =
        Rc::new(Core::new(facts, Box::leak(vec![Slot::EMPTY; slots].into_boxed_slice())));
    let rig = Rc::new(RefCell::new(rig));
    let scans = VirtualScans::new(&rig, &drive, controls, [words, per_block], !options.free_running);
    let sampling = scans.sampling();
    let woken = Arc::new(Woken::default());
    let parts = Parts {
        scans,
        coil: VirtualCoil::new(&rig, controls),
        inputs: VirtualInputs::new(controls, &rig),
        stage: VirtualStage::new(&rig),
        drive,
    };
    let mut poller = Poller::new(options.polling, parts.tasks(&core, link), &woken);
    while !link.is_closed() {
        while woken.take() {
            poller.poll();
        }
        if sampling.get() || options.free_running {
            assert!(jump(), "the simulated board waits forever: no alarm is set");
            // Polled whatever the flag is: embassy sets it for the first of several tasks only, and
            // the thread that woke that task may not have set it yet.
            poller.poll();
        } else {
            link.sleep(&woken);
        }
    }
}

/// Number of blocks that the ring must hold.
fn ring_slots(rate_hz: u32, per_block: usize) -> usize {
    (f64::from(rate_hz) * RING_S / per_block as f64).ceil() as usize
}

fn name(value: &str) -> jointrig_protocol::channel::Name {
    text(value)
}

/// Truncates `value` to N characters.
fn text<const N: usize>(value: &str) -> Text<N> {
    value.chars().take(N).collect()
}

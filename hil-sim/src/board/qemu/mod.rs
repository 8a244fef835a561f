//! The emulated board: the firmware's binary in QEMU, over the simulated rig, in lockstep.
//!
//! QEMU runs the same code as the rig's controller. Its converters, coil, inputs, stage and link
//! are memory shared with this process ([`shared_ram`]), and a byte through a pipe hands the turn
//! over ([`jointrig_firmware::lockstep`]). Only one side works at a time, so a run equals the
//! native board's, block for block, whatever the load of the machine. To the host it is a
//! [`HostEnd`] like any other.

mod faults;
mod front_end;
mod process;
mod server;
pub mod shared_ram;

use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::board::{Controls, Options};
use crate::link::{DeviceEnd, HostEnd, pair};
use crate::rig::{Rig, RigConfig, RigError};
pub use faults::{ConverterFault, Faults};
pub use front_end::Slip;
use jointrig_logs::Table;
use process::Emulator;
use server::Server;

/// Time limit for an image to introduce itself: a loaded machine starts QEMU in a second or two.
const START_LIMIT: Duration = Duration::from_mins(1);

/// Reason why an emulated board could not start.
#[derive(Debug, thiserror::Error)]
pub enum QemuError {
    /// The rig's description is invalid.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// The rig's converters are wider than the emulated ones.
    #[error("the emulated board has converters of 16 bits and the rig asks for {0}: use `sim:` for this rig")]
    Bits(u8),
    /// There is no image.
    #[error("there is no firmware image {0}: `cargo xtask firmware --board mps2-an505` builds it")]
    NoImage(PathBuf),
    /// There is no emulator.
    #[error("could not start qemu-system-arm: {0}; `cargo xtask setup` installs it")]
    NoEmulator(std::io::Error),
    /// The shared memory could not be created.
    #[error("could not make 16 MB of shared memory in {}: {source}", folder.display())]
    Memory {
        /// Its intended folder.
        folder: PathBuf,
        /// The I/O error.
        source: std::io::Error,
    },
    /// The thread could not be created.
    #[error("the emulated board could not start its thread: {0}")]
    Thread(std::io::Error),
    /// The image did not start as expected.
    #[error("the firmware image did not start: {0}")]
    Start(String),
}

/// A running emulated board. Dropping it stops QEMU.
pub struct QemuBoard {
    link: DeviceEnd,
    controls: Arc<Controls>,
    faults: Arc<Faults>,
    failure: Arc<Mutex<Option<String>>>,
    emulator: Arc<Emulator>,
    thread: Option<JoinHandle<()>>,
}

impl QemuBoard {
    /// Starts this image over the rig described by `rig_toml` (the built-in one if `None`).
    ///
    /// # Errors
    /// [`QemuError`], which states what to do.
    pub fn start(image: &Path, rig_toml: Option<&str>, seed: u64) -> Result<(Self, HostEnd), QemuError> {
        let config = RigConfig::of_device(rig_toml)?;
        Self::start_with(image, &config, &Options { seed, ..Options::default() })
    }

    /// Starts this image over this rig. The image determines the order of polling.
    ///
    /// # Errors
    /// [`QemuError`], which states what to do.
    pub fn start_with(
        image: &Path,
        config: &RigConfig,
        options: &Options,
    ) -> Result<(Self, HostEnd), QemuError> {
        let rig = Rig::new(config, options.seed)?.after_wear(options.worn_j)?;
        if config.sensors.bits != 16 {
            return Err(QemuError::Bits(config.sensors.bits));
        }
        if !image.is_file() {
            return Err(QemuError::NoImage(image.to_path_buf()));
        }
        let strings = Table::read(image).map_err(|error| log::warn!(target: "qemu", "{error}")).ok();
        let (emulator, pipes, ram) = Emulator::start(image, options.uart.as_deref())?;
        let emulator = Arc::new(emulator);
        let (host, device) = pair();
        let (controls, faults) = (Arc::new(Controls::default()), Arc::new(Faults::default()));
        let failure = Arc::new(Mutex::new(None));
        let (started, has_started) = sync_channel(1);
        let thread = std::thread::Builder::new().name("emulated board".into()).spawn({
            let (device, options, failure) = (device.clone(), options.clone(), Arc::clone(&failure));
            let (controls, faults) = (Arc::clone(&controls), Arc::clone(&faults));
            move || {
                let mut server =
                    Server::new(rig, &options, &device, &controls, &faults, pipes, ram).with_strings(strings);
                let outcome = server.start().and_then(|()| {
                    // the receiver is gone when starting took too long
                    let _ = started.send(());
                    server.serve()
                });
                if let Err(sentence) = outcome {
                    server.last_lines().for_each(|line| log::warn!(target: "qemu", "before the end: {line}"));
                    log::error!(target: "qemu", "{sentence}");
                    *failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(sentence);
                }
                device.close();
            }
        });
        let thread = thread.map_err(QemuError::Thread)?;
        let board = Self { link: device, controls, faults, failure, emulator, thread: Some(thread) };
        match has_started.recv_timeout(START_LIMIT) {
            Ok(()) => Ok((board, host)),
            Err(RecvTimeoutError::Timeout) => {
                board.emulator.kill();
                Err(QemuError::Start(format!("it sent nothing for {} s", START_LIMIT.as_secs())))
            }
            Err(RecvTimeoutError::Disconnected) => {
                let sentence = board.failure().unwrap_or_else(|| "its thread panicked".into());
                Err(QemuError::Start(board.emulator.explained(sentence)))
            }
        }
    }

    /// Controls and observations on the rig's side.
    pub fn controls(&self) -> &Arc<Controls> {
        &self.controls
    }

    /// Faults that can be injected.
    pub fn faults(&self) -> &Faults {
        &self.faults
    }

    /// Why the board stopped by itself, if it did: the firmware's last message, or that QEMU ended.
    pub fn failure(&self) -> Option<String> {
        self.failure.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// QEMU's process id.
    pub fn process_id(&self) -> u32 {
        self.emulator.id()
    }
}

impl Drop for QemuBoard {
    fn drop(&mut self) {
        self.link.close();
        // the thread ends at the board's next turn; a board that does not take a turn is stopped
        self.emulator.end(|| self.thread.as_ref().is_none_or(JoinHandle::is_finished));
        if let Some(thread) = self.thread.take() {
            // the thread has already printed its own panic
            let _ = thread.join();
        }
    }
}

//! `sim:` and `sim:RIG.toml`: the simulated rig in this process.
//!
//! The only place where the host depends on the simulator; it receives bytes as from any device. It
//! also receives the values that an ideal measurement would find for the rig's parameters. They go
//! into the campaign file, and no estimator reads them.

use super::error::DeviceError;
use super::transport::{Simulated, Transport};
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use jointrig_hil_sim::board::{Options, VirtualBoard};
use jointrig_hil_sim::link::HostEnd;
use jointrig_hil_sim::rig::RigConfig;
use sha2::{Digest, Sha256};

use std::io;
use std::path::Path;
use std::time::Duration;

/// A running virtual board.
pub struct Sim {
    link: HostEnd,
    simulated: Simulated,
    // declared after the link, so that it is dropped after it: its thread then ends
    _board: VirtualBoard,
}

impl Sim {
    /// Starts the rig described in the file, or the built-in one, after its contact's friction has
    /// dissipated the energy `worn_j` (J).
    ///
    /// # Errors
    /// [`DeviceError::Open`] with the error in the description, and where.
    pub fn open(rig: Option<&Path>, seed: u64, worn_j: f64) -> Result<Self, DeviceError> {
        let address = || rig.map_or_else(|| "sim:".into(), |path| format!("sim:{}", path.display()));
        let open = |why: String| DeviceError::Open { address: address(), why };
        let text = match rig {
            Some(path) => Some(
                crate::untrusted_input::text(path, crate::untrusted_input::SETTINGS).map_err(|error| {
                    open(format!(
                        "the rig's description {} cannot be read: {error}; {}",
                        path.display(),
                        crate::advice::reading(&error)
                    ))
                })?,
            ),
            None => None,
        };
        let config = RigConfig::of_device(text.as_deref()).map_err(|error| open(error.to_string()))?;
        let options = Options { seed, worn_j, ..Options::default() };
        let (board, link) =
            VirtualBoard::start_with(&config, &options).map_err(|error| open(error.to_string()))?;
        let truth =
            serde_json::to_value(config.truth_after(worn_j)).map_err(|error| open(error.to_string()))?;
        let parameters = BASE64_STANDARD.encode(Sha256::digest(config.to_toml().as_bytes()));
        let simulated = Simulated { rig: config.name, seed, parameters, truth };
        Ok(Self { link, simulated, _board: board })
    }
}

impl Transport for Sim {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.link.read(buf, timeout)
    }

    fn keeps_packets(&self) -> bool {
        true
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.link.write_all(bytes)
    }

    fn simulated(&self) -> Option<Simulated> {
        Some(self.simulated.clone())
    }
}

//! `sim:` and `sim:RIG.toml`: the simulated rig, in this process.
//!
//! The only place where the host knows of the simulator; what it gets is bytes, as from any device.

use std::io;
use std::path::Path;
use std::time::Duration;

use jointrig_hil_sim::board::VirtualBoard;
use jointrig_hil_sim::link::HostEnd;

use super::error::DeviceError;
use super::transport::Transport;

/// A running virtual board.
pub struct Sim {
    link: HostEnd,
    // dropped after the link: its thread ends then
    _board: VirtualBoard,
}

impl Sim {
    /// Starts the rig that the file describes, or the built-in one.
    ///
    /// # Errors
    /// [`DeviceError::Open`] with what is wrong with the description, and where.
    pub fn open(rig: Option<&Path>, seed: u64) -> Result<Self, DeviceError> {
        let address = || rig.map_or_else(|| "sim:".into(), |path| format!("sim:{}", path.display()));
        let open = |why: String| DeviceError::Open { address: address(), why };
        let text = match rig {
            Some(path) => Some(std::fs::read_to_string(path).map_err(|error| {
                open(format!("the rig's description {} cannot be read: {error}", path.display()))
            })?),
            None => None,
        };
        let (board, link) =
            VirtualBoard::start(text.as_deref(), seed).map_err(|error| open(error.to_string()))?;
        Ok(Self { link, _board: board })
    }
}

impl Transport for Sim {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.link.read(buf, timeout)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.link.write_all(bytes)
    }
}

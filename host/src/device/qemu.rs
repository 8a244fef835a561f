//! `qemu:` and `qemu:IMAGE`: the firmware as a Cortex-M33 binary in the emulator, with the
//! simulated rig.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use jointrig_hil_sim::board::qemu::QemuBoard;
use jointrig_hil_sim::link::HostEnd;

use super::error::DeviceError;
use super::transport::Transport;

/// Environment variable with the path of the image, used if the address has none.
pub const IMAGE_VARIABLE: &str = "JOINTRIG_MPS2_IMAGE";
/// Path of the image otherwise, relative to the folder above this program's; `cargo xtask firmware`
/// puts it there for a program built by cargo.
pub const BUILT: &str = "firmware/thumbv8m.main-none-eabihf/release/mps2-an505";

/// The image that `cargo xtask firmware` has built next to this program, if any.
fn built() -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    let image = program.parent()?.parent()?.join(BUILT);
    image.is_file().then_some(image)
}

/// A running emulator.
pub struct Qemu {
    image: PathBuf,
    link: HostEnd,
    // declared after the link, so that it is dropped after it: dropping it ends the emulator
    board: QemuBoard,
}

impl Qemu {
    /// Starts the emulator with this image, or the one named by [`IMAGE_VARIABLE`], or the one at
    /// [`BUILT`].
    ///
    /// # Errors
    /// [`DeviceError::Open`] when there is no image or the emulator does not start.
    pub fn open(image: Option<&Path>, seed: u64) -> Result<Self, DeviceError> {
        let address = || image.map_or_else(|| "qemu:".into(), |path| format!("qemu:{}", path.display()));
        let open = |why: String| DeviceError::Open { address: address(), why };
        let image = image
            .map(Path::to_path_buf)
            .or_else(|| std::env::var_os(IMAGE_VARIABLE).map(PathBuf::from))
            .or_else(built)
            .ok_or_else(|| {
                open(format!(
                    "there is no firmware image: build one with `cargo xtask firmware --board mps2-an505`; name one \
                     in another folder with qemu:IMAGE or {IMAGE_VARIABLE}"
                ))
            })?;
        let (board, link) = QemuBoard::start(&image, None, seed).map_err(|error| open(error.to_string()))?;
        Ok(Self { image, link, board })
    }

    /// Replaces a broken pipe by the reason why the emulator ended, where it is known.
    fn explained(&self, error: io::Error) -> io::Error {
        match self.board.failure() {
            Some(why) => io::Error::new(error.kind(), why),
            None => error,
        }
    }
}

impl Transport for Qemu {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.link.read(buf, timeout).map_err(|error| self.explained(error))
    }

    fn keeps_packets(&self) -> bool {
        true
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.link.write_all(bytes).map_err(|error| self.explained(error))
    }

    fn image(&self) -> Option<&Path> {
        Some(&self.image)
    }
}

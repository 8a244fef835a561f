//! `serial:PATH`: the controller's serial port, or a pseudo-terminal in its place.

use std::io::{self, Read, Write};
use std::path::Path;
use std::time::Duration;

use serialport::{ErrorKind, SerialPort};

use super::error::{DeviceError, INSTALL_UDEV_RULE};
use super::transport::Transport;

/// Any rate works: USB serial ports ignore it.
const BAUD: u32 = 921_600;

/// Longest wait of a write for a device that accepts no bytes.
const WRITE_PATIENCE: Duration = Duration::from_secs(5);

/// An open serial port.
pub struct Serial {
    port: Box<dyn SerialPort>,
    timeout: Duration,
}

impl Serial {
    /// Opens `path` and sets DTR, which tells the device that a host is listening.
    ///
    /// # Errors
    /// [`DeviceError::Open`]; "permission denied" names the udev rule.
    pub fn open(path: &Path) -> Result<Self, DeviceError> {
        let name = path.display().to_string();
        let timeout = Duration::from_millis(20);
        let mut port = serialport::new(name.clone(), BAUD).timeout(timeout).open().map_err(|error| {
            let why = match error.kind {
                ErrorKind::Io(io::ErrorKind::PermissionDenied) => format!(
                    "permission denied: {INSTALL_UDEV_RULE}, or add yourself to the group that owns {name}"
                ),
                ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::NotFound) => {
                    "there is no such port: is the controller plugged in? `jointrig devices` lists what is attached".into()
                }
                _ => format!("{error}: is another program using it?"),
            };
            DeviceError::Open { address: format!("serial:{name}"), why }
        })?;
        // A pseudo-terminal has no modem lines; a USB port only sends once DTR is set.
        if let Err(error) = port.write_data_terminal_ready(true) {
            log::debug!("serial:{name}: DTR cannot be set ({error}); treated as a pseudo-terminal");
        }
        Ok(Self { port, timeout })
    }

    fn set_timeout(&mut self, timeout: Duration) -> io::Result<()> {
        if self.timeout != timeout {
            self.port.set_timeout(timeout)?;
            self.timeout = timeout;
        }
        Ok(())
    }
}

/// Where Linux lists its serial ports.
const LINUX_PORTS: &str = "/sys/class/tty";

/// The serial ports of this PC.
///
/// # Errors
/// The system cannot list them. The list of `serialport` panics on a Linux without
/// [`LINUX_PORTS`], such as a chroot or a container.
pub(crate) fn ports() -> Result<Vec<serialport::SerialPortInfo>, serialport::Error> {
    listed(if cfg!(target_os = "linux") { Some(Path::new(LINUX_PORTS)) } else { None })
}

/// The same, where this folder must exist.
fn listed(needed: Option<&Path>) -> Result<Vec<serialport::SerialPortInfo>, serialport::Error> {
    if let Some(folder) = needed.filter(|folder| !folder.is_dir()) {
        let what =
            format!("there is no {}: mount /sys, or use a PC instead of a container", folder.display());
        return Err(serialport::Error::new(ErrorKind::Io(io::ErrorKind::NotFound), what));
    }
    serialport::available_ports()
}

impl Transport for Serial {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        self.set_timeout(timeout)?;
        match self.port.read(buf) {
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::Interrupted) => {
                Ok(0)
            }
            other => other,
        }
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.set_timeout(WRITE_PATIENCE)?;
        self.port.write_all(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_that_lists_no_ports_is_an_error_and_no_panic() {
        let folder = tempfile::tempdir().expect("a folder");
        let none = folder.path().join("none");
        let error = listed(Some(&none)).expect_err("no such folder").to_string();
        assert!(error.contains("none") && error.contains("mount /sys"), "{error}");
    }
}

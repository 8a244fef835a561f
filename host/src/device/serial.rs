//! `serial:PATH`: the controller's serial port, or a pseudo-terminal in its place.

use std::fs::File;
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

/// What the advice about a port depends on.
#[derive(Clone, Copy)]
enum System {
    Unix,
    Windows {
        /// The port exists, but access to it is denied.
        held: bool,
    },
}

/// Why a port could not be opened, and what to do.
fn why_not_open(name: &str, error: &serialport::Error, system: System) -> String {
    match (error.kind, system) {
        (_, System::Windows { held: true }) => format!(
            "{name} is in use by another program: close terminals, the Arduino IDE and other jointrig windows that have it \
             open. If none has, unplug the controller and plug it in again"
        ),
        (ErrorKind::Io(io::ErrorKind::PermissionDenied), System::Unix) => {
            format!("permission denied: {INSTALL_UDEV_RULE}, or add yourself to the group that owns {name}")
        }
        (ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::NotFound), System::Unix) => {
            "there is no such port: is the controller plugged in? `jointrig devices` lists what is attached".into()
        }
        (ErrorKind::NoDevice | ErrorKind::Io(io::ErrorKind::NotFound), System::Windows { .. }) => {
            "there is no such port: is the controller plugged in? `jointrig devices` lists what is attached, and the \
             Device Manager shows its number under \"Ports (COM & LPT)\""
                .into()
        }
        _ => format!("{error}: is another program using it?"),
    }
}

/// An open serial port.
pub struct Serial {
    port: Box<dyn SerialPort>,
    timeout: Duration,
}

impl Serial {
    /// Opens `path` and sets DTR, which tells the device that a host is listening.
    ///
    /// # Errors
    /// [`DeviceError::Open`]; where permission is denied it names the udev rule, on Windows another
    /// program as the cause.
    pub fn open(path: &Path) -> Result<Self, DeviceError> {
        let name = path.display().to_string();
        let timeout = Duration::from_millis(20);
        let mut port = serialport::new(name.clone(), BAUD).timeout(timeout).open().map_err(|error| {
            // The library reports a port of Windows that another program holds as missing: the
            // system is asked itself. Its ports have a file name in this folder of devices.
            let held = cfg!(windows)
                && File::options()
                    .read(true)
                    .write(true)
                    .open(format!(r"\\.\{name}"))
                    .is_err_and(|error| error.kind() == io::ErrorKind::PermissionDenied);
            let why = why_not_open(
                &name,
                &error,
                if cfg!(windows) { System::Windows { held } } else { System::Unix },
            );
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
    fn each_system_gets_its_own_advice() {
        let said =
            |kind, system| why_not_open("COM3", &serialport::Error::new(kind, "Access is denied."), system);
        let denied = ErrorKind::Io(io::ErrorKind::PermissionDenied);
        assert!(said(denied, System::Unix).contains("udev"));
        let (held, free) = (System::Windows { held: true }, System::Windows { held: false });
        // as the library reports it there
        let held = said(ErrorKind::NoDevice, held);
        assert!(held.starts_with("COM3 is in use by another program") && !held.contains("udev"), "{held}");
        for kind in [ErrorKind::NoDevice, denied, ErrorKind::InvalidInput] {
            assert!(!said(kind, free).contains("udev"));
        }
        assert!(said(ErrorKind::NoDevice, free).contains("Device Manager"));
        assert!(said(ErrorKind::NoDevice, System::Unix).contains("no such port"));
    }

    #[test]
    fn a_system_that_lists_no_ports_is_an_error_and_no_panic() {
        let folder = tempfile::tempdir().expect("a folder");
        let none = folder.path().join("none");
        let error = listed(Some(&none)).expect_err("no such folder").to_string();
        assert!(error.contains("none") && error.contains("mount /sys"), "{error}");
    }
}

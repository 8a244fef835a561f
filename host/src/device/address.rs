//! Device addresses: the location of an instrument in one word.
//!
//! | address | meaning |
//! |---|---|
//! | `sim:` or `sim:RIG.toml` | the simulated rig, built in or described in a file |
//! | `serial:PATH` | a serial port or pseudo-terminal |
//! | `tcp:HOST:PORT` | a socket |
//! | `qemu:` or `qemu:IMAGE` | the firmware in the emulator, with the built-in rig |
//! | `usb:` or `usb:SERIAL` | the controller's vendor interface: the only one, or by serial |
//! | `replay:` | known, but not supported by this version |
//!
//! `tcp:HOST:PORT`: a device connected by a socket (a virtual board, or a bridge).
//!
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
use std::io::{Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;
use std::{fmt, io};

/// The location of an instrument.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Address {
    /// The simulated rig: the built-in one, or one described in a file.
    Sim {
        /// The file with the rig's description; `None` for the built-in rig.
        rig: Option<PathBuf>,
    },
    /// A serial port.
    Serial(PathBuf),
    /// The vendor interface of an attached controller.
    Usb {
        /// Its serial number; `None` for the only one attached.
        serial: Option<String>,
    },
    /// A socket, as `host:port`.
    Tcp(String),
    /// The emulator.
    Qemu {
        /// The firmware image for the emulated board; `None` for the one named by the environment
        /// or built by cargo.
        image: Option<PathBuf>,
    },
}

impl FromStr for Address {
    type Err = DeviceError;

    fn from_str(given: &str) -> Result<Self, DeviceError> {
        let wrong = |why: &str| DeviceError::Address { given: given.into(), why: why.into() };
        let (scheme, rest) = given
            .split_once(':')
            .ok_or_else(|| wrong("write e.g. sim:, usb:, serial:/dev/ttyACM0 or tcp:127.0.0.1:4000"))?;
        match scheme {
            "sim" => Ok(Self::Sim { rig: (!rest.is_empty()).then(|| rest.into()) }),
            "serial" if rest.is_empty() => Err(wrong("name the port, e.g. serial:/dev/ttyACM0")),
            "serial" => Ok(Self::Serial(rest.into())),
            "usb" => Ok(Self::Usb { serial: (!rest.is_empty()).then(|| rest.into()) }),
            "tcp" => match rest.rsplit_once(':') {
                Some((host, port)) if !host.is_empty() && port.parse::<u16>().is_ok_and(|port| port > 0) => {
                    Ok(Self::Tcp(rest.into()))
                }
                _ => Err(wrong("name host and port (1 to 65535), e.g. tcp:127.0.0.1:4000")),
            },
            "qemu" => Ok(Self::Qemu { image: (!rest.is_empty()).then(|| rest.into()) }),
            "replay" => Err(DeviceError::NotBuilt { given: given.into(), scheme: scheme.into() }),
            _ => Err(wrong("known are sim:, serial:, usb:, tcp: and qemu:")),
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Sim { rig: None } => f.write_str("sim:"),
            Self::Sim { rig: Some(path) } => write!(f, "sim:{}", path.display()),
            Self::Serial(path) => write!(f, "serial:{}", path.display()),
            Self::Usb { serial } => write!(f, "usb:{}", serial.as_deref().unwrap_or_default()),
            Self::Tcp(place) => write!(f, "tcp:{place}"),
            Self::Qemu { image: None } => f.write_str("qemu:"),
            Self::Qemu { image: Some(path) } => write!(f, "qemu:{}", path.display()),
        }
    }
}

impl Address {
    /// Opens the connection to the device. `seed` sets the scatter of a simulated rig; other
    /// devices ignore it.
    ///
    /// # Errors
    /// [`DeviceError::Open`] with the cause and what to do.
    pub fn open(&self, seed: u64) -> Result<Box<dyn Transport>, DeviceError> {
        match self {
            Self::Sim { rig } => open_sim(rig.as_deref(), seed),
            Self::Serial(path) => Ok(Box::new(super::serial::Serial::open(path)?)),
            Self::Usb { serial } => Ok(Box::new(super::usb::Usb::open(serial.as_deref())?)),
            Self::Tcp(place) => Ok(Box::new(Tcp::open(place)?)),
            Self::Qemu { image } => open_qemu(image.as_deref(), seed),
        }
    }
}

#[cfg(feature = "sim")]
fn open_sim(rig: Option<&std::path::Path>, seed: u64) -> Result<Box<dyn Transport>, DeviceError> {
    Ok(Box::new(Sim::open(rig, seed)?))
}

#[cfg(feature = "sim")]
fn open_qemu(image: Option<&std::path::Path>, seed: u64) -> Result<Box<dyn Transport>, DeviceError> {
    Ok(Box::new(super::qemu::Qemu::open(image, seed)?))
}

#[cfg(not(feature = "sim"))]
fn open_qemu(image: Option<&std::path::Path>, _seed: u64) -> Result<Box<dyn Transport>, DeviceError> {
    Err(DeviceError::NotBuilt {
        given: Address::Qemu { image: image.map(Into::into) }.to_string(),
        scheme: "qemu".into(),
    })
}

#[cfg(not(feature = "sim"))]
fn open_sim(rig: Option<&std::path::Path>, _seed: u64) -> Result<Box<dyn Transport>, DeviceError> {
    Err(DeviceError::NotBuilt {
        given: Address::Sim { rig: rig.map(Into::into) }.to_string(),
        scheme: "sim".into(),
    })
}

impl<T: Transport + ?Sized> Transport for Box<T> {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        (**self).read(buf, timeout)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        (**self).write_all(bytes)
    }

    fn keeps_packets(&self) -> bool {
        (**self).keeps_packets()
    }

    fn image(&self) -> Option<&Path> {
        (**self).image()
    }

    fn simulated(&self) -> Option<Simulated> {
        (**self).simulated()
    }
}

const CONNECT_PATIENCE: Duration = Duration::from_secs(3);

/// An open socket.
pub struct Tcp {
    stream: TcpStream,
    timeout: Option<Duration>,
}

impl Tcp {
    /// Connects to `place`, given as `host:port`.
    ///
    /// # Errors
    /// [`DeviceError::Open`] with the cause and what to do.
    pub fn open(place: &str) -> Result<Self, DeviceError> {
        let open = |why: String| DeviceError::Open { address: format!("tcp:{place}"), why };
        let mut last = None;
        for address in place.to_socket_addrs().map_err(|error| open(error.to_string()))? {
            match TcpStream::connect_timeout(&address, CONNECT_PATIENCE) {
                Ok(stream) => {
                    stream.set_nodelay(true).map_err(|error| open(error.to_string()))?;
                    return Ok(Self { stream, timeout: None });
                }
                Err(error) => last = Some(error),
            }
        }
        let why = last.map_or_else(|| "the name has no address".into(), |error| error.to_string());
        Err(open(format!("{why}: is the device (or `jointrig-hil-sim serve --tcp`) running there?")))
    }
}

impl Transport for Tcp {
    fn read(&mut self, buf: &mut [u8], timeout: Duration) -> io::Result<usize> {
        if self.timeout != Some(timeout) {
            self.stream.set_read_timeout(Some(timeout))?;
            self.timeout = Some(timeout);
        }
        match self.stream.read(buf) {
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Err(error)
                if matches!(
                    error.kind(),
                    io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted
                ) =>
            {
                Ok(0)
            }
            other => other,
        }
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)
    }
}

/// A running virtual board.
pub struct Sim {
    link: HostEnd,
    simulated: Simulated,
    // declared after the link, so that it is dropped after it: its thread then ends
    _board: VirtualBoard,
}

impl Sim {
    /// Starts the rig described in the file, or the built-in one.
    ///
    /// # Errors
    /// [`DeviceError::Open`] with the error in the description, and where.
    pub fn open(rig: Option<&Path>, seed: u64) -> Result<Self, DeviceError> {
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
        let config = text.map_or_else(|| Ok(RigConfig::default()), |text| RigConfig::from_toml(&text));
        let config = config.map_err(|error| open(error.to_string()))?;
        let options = Options { seed, ..Options::default() };
        let (board, link) =
            VirtualBoard::start_with(&config, &options).map_err(|error| open(error.to_string()))?;
        let truth = serde_json::to_value(config.truth()).map_err(|error| open(error.to_string()))?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_form_is_read_and_written_alike() {
        for text in [
            "sim:",
            "sim:rigs/stiff.toml",
            "serial:/dev/ttyACM0",
            "usb:",
            "usb:0034001A3433510437363934",
            "tcp:127.0.0.1:4000",
            "tcp:[::1]:9",
            "qemu:",
            "qemu:x.elf",
        ] {
            let address: Address = text.parse().expect(text);
            assert_eq!(address.to_string(), text);
        }
    }

    #[test]
    fn what_is_wrong_is_said_with_what_to_write() {
        for (text, word) in [
            ("/dev/ttyACM0", "serial:/dev/ttyACM0"),
            ("serial:", "name the port"),
            ("tcp:localhost", "host and port"),
            ("tcp:localhost:0", "host and port"),
            ("bluetooth:x", "known are"),
            ("replay:x.bin", "not built into this version"),
        ] {
            let said = text.parse::<Address>().expect_err(text).to_string();
            assert!(said.contains(word), "{text}: {said}");
        }
    }
}

//! Device addresses: the location of an instrument in one word.
//!
//! | address | meaning |
//! |---|---|
//! | `sim:` or `sim:RIG.toml` | the simulated rig, built in or described in a file |
//! | `serial:PATH` | a serial port or pseudo-terminal |
//! | `tcp:HOST:PORT` | a socket |
//! | `qemu:` or `qemu:IMAGE` | the firmware in the emulator, with the built-in rig |
//! | `usb:` or `usb:SERIAL` | the controller's vendor interface: the only one, or by serial |
//! | `bridge:COMMAND` | a program that writes a recorder's samples to its standard output |
//! | `bridge:tcp:HOST:PORT` | such a program on another computer |
//! | `replay:` | known, but not supported by this version |

use super::error::DeviceError;
#[cfg(feature = "sim")]
use super::sim::Sim;
use super::tcp::Tcp;
use super::transport::{Recorder, Simulated, Transport};
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
    /// A recorder's blocks of samples.
    Bridge(BridgeSource),
    /// The emulator.
    Qemu {
        /// The firmware image for the emulated board; `None` for the one named by the environment
        /// or built by cargo.
        image: Option<PathBuf>,
    },
}

/// Where a recorder's blocks of samples come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BridgeSource {
    /// The standard output of a program, started with this command line.
    Command(String),
    /// A socket, as `host:port`.
    Tcp(String),
}

/// Whether `place` is `host:port`.
fn is_place(place: &str) -> bool {
    place
        .rsplit_once(':')
        .is_some_and(|(host, port)| !host.is_empty() && port.parse::<u16>().is_ok_and(|port| port > 0))
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
            "tcp" if is_place(rest) => Ok(Self::Tcp(rest.into())),
            "tcp" => Err(wrong("name host and port (1 to 65535), e.g. tcp:127.0.0.1:4000")),
            "bridge" => match rest.strip_prefix("tcp:") {
                Some(place) if is_place(place) => Ok(Self::Bridge(BridgeSource::Tcp(place.into()))),
                Some(_) => Err(wrong("name host and port (1 to 65535), e.g. bridge:tcp:192.168.1.7:4001")),
                None if rest.trim().is_empty() => {
                    Err(wrong("name the program that writes the samples, e.g. \"bridge:python my_daq.py\""))
                }
                None => Ok(Self::Bridge(BridgeSource::Command(rest.into()))),
            },
            "qemu" => Ok(Self::Qemu { image: (!rest.is_empty()).then(|| rest.into()) }),
            "replay" => Err(DeviceError::NotBuilt { given: given.into(), scheme: scheme.into() }),
            _ => Err(wrong("known are sim:, serial:, usb:, tcp:, bridge: and qemu:")),
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
            Self::Bridge(BridgeSource::Command(command)) => write!(f, "bridge:{command}"),
            Self::Bridge(BridgeSource::Tcp(place)) => write!(f, "bridge:tcp:{place}"),
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
        self.open_worn(seed, 0.0)
    }

    /// As [`Address::open`], for a contact whose friction has dissipated the energy `worn_j` (J) in
    /// the wear runs of a campaign. Only a simulated rig in this process that wears depends on it;
    /// every other rig has its contact's history in itself.
    ///
    /// # Errors
    /// As [`Address::open`].
    pub fn open_worn(&self, seed: u64, worn_j: f64) -> Result<Box<dyn Transport>, DeviceError> {
        match self {
            Self::Sim { rig } => open_sim(rig.as_deref(), seed, worn_j),
            Self::Serial(path) => Ok(Box::new(super::serial::Serial::open(path)?)),
            Self::Usb { serial } => Ok(Box::new(super::usb::Usb::open(serial.as_deref())?)),
            Self::Tcp(place) => Ok(Box::new(Tcp::open(place)?)),
            Self::Bridge(source) => open_bridge(source),
            Self::Qemu { image } => open_qemu(image.as_deref(), seed),
        }
    }
}

#[cfg(feature = "bridge")]
fn open_bridge(source: &BridgeSource) -> Result<Box<dyn Transport>, DeviceError> {
    use super::bridge::BridgedRecorder;
    Ok(Box::new(match source {
        BridgeSource::Command(command) => BridgedRecorder::start(command)?,
        BridgeSource::Tcp(place) => BridgedRecorder::connect(place)?,
    }))
}

#[cfg(not(feature = "bridge"))]
fn open_bridge(source: &BridgeSource) -> Result<Box<dyn Transport>, DeviceError> {
    let given = Address::Bridge(source.clone()).to_string();
    Err(DeviceError::NotBuilt { given, scheme: "bridge".into() })
}

#[cfg(feature = "sim")]
fn open_sim(
    rig: Option<&std::path::Path>,
    seed: u64,
    worn_j: f64,
) -> Result<Box<dyn Transport>, DeviceError> {
    Ok(Box::new(Sim::open(rig, seed, worn_j)?))
}

#[cfg(all(feature = "sim", unix))]
fn open_qemu(image: Option<&std::path::Path>, seed: u64) -> Result<Box<dyn Transport>, DeviceError> {
    Ok(Box::new(super::qemu::Qemu::open(image, seed)?))
}

#[cfg(all(feature = "sim", not(unix)))]
fn open_qemu(image: Option<&std::path::Path>, _seed: u64) -> Result<Box<dyn Transport>, DeviceError> {
    Err(DeviceError::Open {
        address: Address::Qemu { image: image.map(Into::into) }.to_string(),
        why: "the emulator shares its memory with jointrig in a way that only Linux and macOS have; use sim:, which \
              measures the same rig with the same firmware"
            .into(),
    })
}

#[cfg(not(feature = "sim"))]
fn open_qemu(image: Option<&std::path::Path>, _seed: u64) -> Result<Box<dyn Transport>, DeviceError> {
    Err(DeviceError::NotBuilt {
        given: Address::Qemu { image: image.map(Into::into) }.to_string(),
        scheme: "qemu".into(),
    })
}

#[cfg(not(feature = "sim"))]
fn open_sim(
    rig: Option<&std::path::Path>,
    _seed: u64,
    _worn_j: f64,
) -> Result<Box<dyn Transport>, DeviceError> {
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

    fn recorder(&self) -> Option<Recorder> {
        (**self).recorder()
    }

    fn take_remarks(&mut self) -> Vec<String> {
        (**self).take_remarks()
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
            "bridge:python my_daq.py --rate 25600",
            "bridge:tcp:192.168.1.7:4001",
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
            ("bridge:", "bridge:python my_daq.py"),
            ("bridge:tcp:localhost", "bridge:tcp:192.168.1.7:4001"),
            ("bluetooth:x", "known are"),
            ("replay:x.bin", "not built into this version"),
        ] {
            let said = text.parse::<Address>().expect_err(text).to_string();
            assert!(said.contains(word), "{text}: {said}");
        }
    }
}

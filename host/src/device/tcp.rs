//! `tcp:HOST:PORT`: a device behind a socket that carries the protocol's bytes, such as a virtual
//! board. (A recorder's blocks of samples over a socket are `bridge:tcp:HOST:PORT`.)

use super::error::DeviceError;
use super::transport::Transport;
use std::io;
use std::io::{Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// Wait for a connection to one address.
const CONNECT_PATIENCE: Duration = Duration::from_secs(3);

/// Connects to `place`, given as `host:port`.
///
/// # Errors
/// Why no address of that name could be reached.
pub(super) fn connect(place: &str) -> Result<TcpStream, String> {
    let mut last = None;
    for address in place.to_socket_addrs().map_err(|error| error.to_string())? {
        match TcpStream::connect_timeout(&address, CONNECT_PATIENCE) {
            Ok(stream) => {
                stream.set_nodelay(true).map_err(|error| error.to_string())?;
                return Ok(stream);
            }
            Err(error) => last = Some(error),
        }
    }
    Err(last.map_or_else(|| "the name has no address".into(), |error| error.to_string()))
}

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
        let stream = connect(place).map_err(|why| DeviceError::Open {
            address: format!("tcp:{place}"),
            why: format!("{why}: is the device (or `jointrig-hil-sim serve --tcp`) running there?"),
        })?;
        Ok(Self { stream, timeout: None })
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

//! `tcp:HOST:PORT`: a device connected by a socket (a virtual board, or a bridge).

use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use super::error::DeviceError;
use super::transport::Transport;

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

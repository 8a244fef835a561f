//! Connects a virtual board to a pseudo-terminal or a TCP socket, byte for byte.
//!
//! The board's time stops while its data is not acknowledged, so a peer may connect and disconnect;
//! each new peer starts with its own handshake. A TCP peer may be any program: one that does not
//! shake hands is disconnected, and a silent one is disconnected when another waits. Whatever a
//! peer sends or fails to read affects only that peer; only the end of the board ends the service.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use jointrig_protocol::frame::{Accumulator, Kind};
use jointrig_protocol::hello::Hello;

use crate::link::HostEnd;

/// How long the bridge waits for one side before it polls the other.
const POLL: Duration = Duration::from_millis(20);

/// A peer's first frame must be a valid Hello within this time; a host sends it immediately, and
/// again after 0.2 s.
const HANDSHAKE: Duration = Duration::from_secs(5);
/// The same limit while others wait.
const HANDSHAKE_BEFORE_OTHERS: Duration = Duration::from_secs(1);
/// A peer that is silent for this long is disconnected if another one waits. A host may be silent
/// while an operator moves hammer and laser.
const SILENCE: Duration = Duration::from_mins(1);

/// Maximum number of waiting peers; further ones are refused.
const QUEUE: usize = 16;

/// Why a connection to a peer ended.
#[derive(Debug, PartialEq, Eq)]
enum End {
    /// It disconnected.
    Went,
    /// It did not shake hands.
    Stranger,
    /// It was silent, and another peer waits.
    Silent,
}

/// Returns whether other peers wait; `None` for a peer with exclusive use of the line.
type Waiting<'w> = Option<&'w mut dyn FnMut() -> bool>;

/// Carries bytes both ways until the peer disconnects or is disconnected.
///
/// # Errors
/// The board has stopped.
fn bridge(
    board: &mut HostEnd,
    mut from_peer: impl Read + Send,
    mut to_peer: impl Write,
    mut others_wait: Waiting<'_>,
) -> io::Result<End> {
    let (sender, receiver) = sync_channel::<Vec<u8>>(64);
    let gone = AtomicBool::new(false);
    let outcome = std::thread::scope(|scope| {
        let gone = &gone;
        // dropped with this closure, so that a blocked sender gets an error
        let receiver = receiver;
        scope.spawn(move || {
            let mut bytes = [0; 4096];
            while !gone.load(Ordering::Acquire) {
                match from_peer.read(&mut bytes) {
                    Ok(0) => break,
                    Ok(count) => {
                        if sender.send(bytes[..count].to_vec()).is_err() {
                            break;
                        }
                    }
                    Err(error) if is_pause(&error) => {}
                    // a pseudo-terminal without a peer reads EIO; the caller waits for the next one
                    Err(_) => break,
                }
            }
            gone.store(true, Ordering::Release);
        });
        let outcome = carry(board, &receiver, &mut to_peer, gone, &mut others_wait);
        gone.store(true, Ordering::Release);
        outcome
    });
    // the next peer starts with an empty link
    board.cut();
    outcome
}

fn carry(
    board: &mut HostEnd,
    receiver: &Receiver<Vec<u8>>,
    to_peer: &mut impl Write,
    gone: &AtomicBool,
    others_wait: &mut Waiting<'_>,
) -> io::Result<End> {
    let mut handshake = Handshake::default();
    let begun = Instant::now();
    let (mut heard_at, mut to_board) = (begun, None::<Vec<u8>>);
    let (mut bytes, mut from, mut to) = (vec![0; 64 << 10], 0, 0);
    loop {
        let mut heard = false;
        while let Some(chunk) = to_board.take().or_else(|| receiver.try_recv().ok()) {
            handshake.hear(&chunk);
            match board.write_all(&chunk) {
                Ok(()) => (heard, heard_at) = (true, Instant::now()),
                // the board's queue is full; the peer waits until the board reads
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    to_board = Some(chunk);
                    break;
                }
                Err(error) => return Err(error),
            }
        }
        if from == to {
            // bytes from the peer come first; while there were some, do not block on the board
            let wait = if heard { Duration::ZERO } else { Duration::from_millis(1) };
            (from, to) = (0, board.read(&mut bytes, wait)?);
        }
        if from < to {
            match to_peer.write(&bytes[from..to]) {
                Ok(0) => return Ok(End::Went),
                Ok(count) => from += count,
                // a peer that does not read stalls the link, as a real one would; the board's time
                // then stops
                Err(error) if is_pause(&error) => {}
                Err(_) => return Ok(End::Went),
            }
        } else if to_board.is_none() && !heard && gone.load(Ordering::Acquire) {
            return Ok(End::Went);
        }
        if let Some(others_wait) = others_wait {
            let patience = match (handshake.done, others_wait()) {
                (true, true) if heard_at.elapsed() > SILENCE => return Ok(End::Silent),
                (true, _) => continue,
                (false, false) => HANDSHAKE,
                (false, true) => HANDSHAKE_BEFORE_OTHERS,
            };
            if begun.elapsed() > patience {
                return Ok(End::Stranger);
            }
        }
    }
}

/// Whether a peer has introduced itself.
#[derive(Default)]
struct Handshake {
    done: bool,
    accumulator: Accumulator,
}

impl Handshake {
    fn hear(&mut self, mut bytes: &[u8]) {
        while !self.done && !bytes.is_empty() {
            let (used, found) = self.accumulator.feed(bytes);
            self.done = matches!(found, Some(Ok(frame))
                if frame.kind == Kind::Hello && Hello::from_bytes(frame.payload).is_ok());
            bytes = &bytes[used..];
        }
    }
}

/// Whether there is no data at present, or no space.
fn is_pause(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock)
}

/// Writes a line to stderr; errors of stderr are ignored.
fn tell(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Serves one TCP peer after the other, indefinitely.
///
/// # Errors
/// When the board has stopped, or listening fails.
pub fn tcp(board: &mut HostEnd, listener: &TcpListener) -> io::Result<()> {
    let door = listener.try_clone()?;
    let (sender, peers) = sync_channel::<(TcpStream, SocketAddr)>(QUEUE);
    // it ends with the process, or when no peer is served any more
    std::thread::spawn(move || {
        loop {
            match door.accept() {
                Ok(came) => match sender.try_send(came) {
                    Err(TrySendError::Disconnected(_)) => return,
                    Err(TrySendError::Full((_, peer))) => {
                        tell(&format!("{peer} was rejected: {QUEUE} connections are waiting"));
                    }
                    Ok(()) => {}
                },
                // the peer disconnected before it was accepted, or the process has no free file
                // descriptor at present
                Err(error) => {
                    tell(&format!("a connection could not be accepted: {error}"));
                    std::thread::sleep(POLL);
                }
            }
        }
    });
    let mut next = None;
    loop {
        let came = next.take().or_else(|| peers.recv().ok());
        let Some((stream, peer)) = came else {
            return Err(io::Error::new(ErrorKind::NotConnected, "no more connections are accepted"));
        };
        tell(&format!("{peer} connected"));
        let mut others_wait = || {
            next = next.take().or_else(|| peers.try_recv().ok());
            next.is_some()
        };
        let why = match halves(stream) {
            Ok((reader, writer)) => match bridge(board, reader, writer, Some(&mut others_wait))? {
                End::Went => "has gone",
                End::Stranger => "was disconnected: it did not complete the handshake",
                End::Silent => "was disconnected: it was silent, and another connection is waiting",
            },
            Err(_) => "has gone",
        };
        tell(&format!("{peer} {why}"));
    }
}

/// Both halves of a connection, with short timeouts.
fn halves(stream: TcpStream) -> io::Result<(TcpStream, TcpStream)> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(POLL))?;
    stream.set_write_timeout(Some(POLL))?;
    Ok((stream.try_clone()?, stream))
}

/// Serves a pseudo-terminal, indefinitely. `name` is called with the path to open.
///
/// # Errors
/// When no pseudo-terminal can be created or the board has stopped.
#[cfg(unix)]
pub fn pseudo_terminal(board: &mut HostEnd, name: impl FnOnce(&str)) -> io::Result<()> {
    use std::fs::File;

    use serialport::{SerialPort, TTYPort};

    let (master, slave) = TTYPort::pair()?;
    let path = slave.name().unwrap_or_default();
    // while open here, the slave is locked to this process; the peer must be able to open it by
    // name
    drop(slave);
    // held open as a plain, non-exclusive file: a terminal that is not open anywhere returns an
    // error on reading, and a peer that disconnects must not end the service
    let keeper = File::options().read(true).write(true).open(&path)?;
    let mut reader = master.try_clone_native()?;
    reader.set_timeout(POLL)?;
    let mut writer = master;
    writer.set_timeout(POLL)?;
    name(&path);
    let outcome = bridge(board, reader, writer, None);
    drop(keeper);
    outcome.map(|_| ())
}

//! Puts a virtual board behind a pseudo-terminal or a TCP socket, byte for byte.
//!
//! The board's time stands still while nobody acknowledges, so a peer may come and go; each new peer starts
//! with a handshake of its own. Whoever comes by TCP may be anybody: who does not shake hands is let go, and who is silent makes room for the
//! next. Whatever a peer sends, or does not read, is its own loss; only the end of the board ends the service.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TrySendError, sync_channel};
use std::time::{Duration, Instant};

use jointrig_protocol::frame::{Accumulator, Kind};
use jointrig_protocol::hello::Hello;

use crate::link::HostEnd;

/// How long the bridge waits for either side before it looks at the other.
const POLL: Duration = Duration::from_millis(20);

/// A peer's first frame must be a good Hello within this time; a host sends it at once, and again after a fifth of a second.
const HANDSHAKE: Duration = Duration::from_secs(5);
/// … and within this while others wait.
const HANDSHAKE_BEFORE_OTHERS: Duration = Duration::from_secs(1);
/// A peer that is silent for so long makes room when another one waits. A host may be silent while somebody moves hammer and laser.
const SILENCE: Duration = Duration::from_mins(1);

/// Peers that may wait for their turn; further ones are turned away.
const QUEUE: usize = 16;

/// Why a peer is served no longer.
#[derive(Debug, PartialEq, Eq)]
enum End {
    /// It went away.
    Went,
    /// It did not shake hands.
    Stranger,
    /// It was silent, and somebody else waits.
    Silent,
}

/// How long peers are waited for; `None` for one that has the line to itself.
type Waiting<'w> = Option<&'w mut dyn FnMut() -> bool>;

/// Carries bytes both ways until the peer goes away, or has to.
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
        // dropped with this closure: a sender that waits for room hears of it
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
    // whoever comes next begins anew
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
                // the board reads when it has time; until then the peer waits
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    to_board = Some(chunk);
                    break;
                }
                Err(error) => return Err(error),
            }
        }
        if from == to {
            // bytes from the peer come first; while there were some, do not sleep on the board
            let wait = if heard { Duration::ZERO } else { Duration::from_millis(1) };
            (from, to) = (0, board.read(&mut bytes, wait)?);
        }
        if from < to {
            match to_peer.write(&bytes[from..to]) {
                Ok(0) => return Ok(End::Went),
                Ok(count) => from += count,
                // a peer that does not read stalls the link, as a real one would; the board's time then stands still
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

/// Whether there is nothing just now, or no room.
fn is_pause(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted | ErrorKind::WouldBlock)
}

/// A line on stderr; nobody listening there ends no service.
fn tell(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Serves one TCP peer after the other, for ever.
///
/// # Errors
/// When the board has stopped, or nobody can be listened for.
pub fn tcp(board: &mut HostEnd, listener: &TcpListener) -> io::Result<()> {
    let door = listener.try_clone()?;
    let (sender, peers) = sync_channel::<(TcpStream, SocketAddr)>(QUEUE);
    // it ends with the process, or when nobody is served any more
    std::thread::spawn(move || {
        loop {
            match door.accept() {
                Ok(came) => match sender.try_send(came) {
                    Err(TrySendError::Disconnected(_)) => return,
                    Err(TrySendError::Full((_, peer))) => {
                        tell(&format!("{peer} was turned away: {QUEUE} wait"));
                    }
                    Ok(()) => {}
                },
                // a peer that went before it was let in, or no more files just now
                Err(error) => {
                    tell(&format!("a peer could not be let in: {error}"));
                    std::thread::sleep(POLL);
                }
            }
        }
    });
    let mut next = None;
    loop {
        let came = next.take().or_else(|| peers.recv().ok());
        let Some((stream, peer)) = came else {
            return Err(io::Error::new(ErrorKind::NotConnected, "nobody listens for peers any more"));
        };
        tell(&format!("{peer} has come"));
        let mut others_wait = || {
            next = next.take().or_else(|| peers.try_recv().ok());
            next.is_some()
        };
        let why = match halves(stream) {
            Ok((reader, writer)) => match bridge(board, reader, writer, Some(&mut others_wait))? {
                End::Went => "has gone",
                End::Stranger => "was let go: it did not shake hands",
                End::Silent => "was let go: it was silent, and another one waits",
            },
            Err(_) => "has gone",
        };
        tell(&format!("{peer} {why}"));
    }
}

/// Both halves of a connection, neither of which waits for long.
fn halves(stream: TcpStream) -> io::Result<(TcpStream, TcpStream)> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(POLL))?;
    stream.set_write_timeout(Some(POLL))?;
    Ok((stream.try_clone()?, stream))
}

/// Serves a pseudo-terminal, for ever. `name` hears the path to open.
///
/// # Errors
/// When no pseudo-terminal can be made or the board has stopped.
#[cfg(unix)]
pub fn pseudo_terminal(board: &mut HostEnd, name: impl FnOnce(&str)) -> io::Result<()> {
    use std::fs::File;

    use serialport::{SerialPort, TTYPort};

    let (master, slave) = TTYPort::pair()?;
    let path = slave.name().unwrap_or_default();
    // while open here the slave is locked to this process; the peer must be able to open it by name
    drop(slave);
    // held open as a plain file, exclusive to nobody: a terminal without any opener reads as an error, and
    // a peer that goes must not end the service
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

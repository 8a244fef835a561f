//! Puts a virtual board behind a pseudo-terminal or a TCP socket, byte for byte.
//!
//! The board's time stands still while nobody acknowledges, so a peer may come and go; each new peer starts
//! with a handshake of its own.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::link::HostEnd;

/// How long the bridge waits for the board before it looks whether the peer is still there.
const POLL: Duration = Duration::from_millis(20);

/// Carries bytes both ways until the peer goes away.
///
/// # Errors
/// What the peer's reading or writing failed with, except that it went away.
fn bridge(board: &mut HostEnd, mut from_peer: impl Read + Send, mut to_peer: impl Write) -> io::Result<()> {
    let (sender, receiver) = std::sync::mpsc::sync_channel::<Vec<u8>>(64);
    let gone = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let gone = &gone;
        scope.spawn(move || {
            let mut bytes = [0; 4096];
            loop {
                match from_peer.read(&mut bytes) {
                    Ok(0) => break,
                    Ok(count) => {
                        if sender.send(bytes[..count].to_vec()).is_err() {
                            break;
                        }
                    }
                    Err(error)
                        if matches!(
                            error.kind(),
                            io::ErrorKind::TimedOut | io::ErrorKind::Interrupted | io::ErrorKind::WouldBlock
                        ) =>
                    {
                        if gone.load(Ordering::Acquire) {
                            break;
                        }
                    }
                    // a pseudo-terminal without a peer reads EIO; the caller waits for the next one
                    Err(_) => break,
                }
            }
            gone.store(true, Ordering::Release);
        });
        let mut bytes = vec![0; 64 << 10];
        let outcome = loop {
            let mut heard = false;
            for chunk in receiver.try_iter() {
                heard = true;
                board.write_all(&chunk)?;
            }
            // bytes from the peer come first; while there were some, do not sleep on the board
            let count =
                board.read(&mut bytes, if heard { Duration::ZERO } else { Duration::from_millis(1) })?;
            if count > 0 {
                if let Err(error) = to_peer.write_all(&bytes[..count]) {
                    break if went_away(&error) { Ok(()) } else { Err(error) };
                }
            } else if gone.load(Ordering::Acquire) {
                break Ok(());
            }
        };
        gone.store(true, Ordering::Release);
        // whoever comes next begins anew
        board.cut();
        outcome
    })
}

fn went_away(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        io::ErrorKind::BrokenPipe | io::ErrorKind::ConnectionReset | io::ErrorKind::ConnectionAborted
    )
}

/// Serves one TCP peer after the other, for ever.
///
/// # Errors
/// When the board has stopped or the listener fails.
pub fn tcp(board: &mut HostEnd, listener: &TcpListener) -> io::Result<()> {
    loop {
        let (stream, peer) = listener.accept()?;
        eprintln!("{peer} has come");
        serve_stream(board, stream)?;
        eprintln!("{peer} has gone");
    }
}

fn serve_stream(board: &mut HostEnd, stream: TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    // so that the reading half notices when the writing half has failed
    stream.set_read_timeout(Some(POLL))?;
    let reader = stream.try_clone()?;
    bridge(board, reader, stream)
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
    // a peer that does not read stalls the link, as a real one would; the board's time then stands still
    writer.set_timeout(Duration::from_hours(365 * 24))?;
    name(&path);
    let outcome = bridge(board, reader, writer);
    drop(keeper);
    outcome
}

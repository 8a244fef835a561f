//! The board served over a socket survives any peer.
#![allow(clippy::unwrap_used)]

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use jointrig_hil_sim::board::VirtualBoard;
use jointrig_hil_sim::serve;
use jointrig_protocol::frame::{Accumulator, Kind, Writer, encode};
use jointrig_protocol::hello::Hello;
use jointrig_protocol::limits::MAX_WIRE;
use jointrig_protocol::request::{Numbered, Request};

/// A served board, which ends with the test's process.
fn served() -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        let (_board, mut host) = VirtualBoard::start(None, 1).unwrap();
        let ended = serve::tcp(&mut host, &listener);
        panic!("the service ended: {ended:?}");
    });
    address
}

/// Waits until a frame of this kind comes.
fn frame(stream: &mut TcpStream, kind: Kind, patience: Duration) -> bool {
    let until = Instant::now() + patience;
    let (mut accumulator, mut bytes) = (Accumulator::new(), [0; 4096]);
    stream.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
    while Instant::now() < until {
        let Ok(count @ 1..) = stream.read(&mut bytes) else { continue };
        let mut rest = &bytes[..count];
        while !rest.is_empty() {
            let (used, found) = accumulator.feed(rest);
            if matches!(found, Some(Ok(frame)) if frame.kind == kind) {
                return true;
            }
            rest = &rest[used..];
        }
    }
    false
}

fn hello(session: u32) -> Vec<u8> {
    let mut wire = [0; MAX_WIRE];
    // a zero first: it ends any incomplete frame before it
    let frame = encode(Kind::Hello, &Hello::host(session).to_bytes(), &mut wire).unwrap();
    [&[0], frame].concat()
}

/// A host that shakes hands receives a reply.
fn shakes_hands(at: SocketAddr, session: u32) -> TcpStream {
    let mut stream = TcpStream::connect(at).unwrap();
    stream.write_all(&hello(session)).unwrap();
    assert!(frame(&mut stream, Kind::Hello, Duration::from_secs(10)), "session {session} was not answered");
    stream
}

#[test]
fn noise_silence_and_haste_end_no_service_and_lock_nobody_out() {
    let at = served();
    let noise: Vec<u8> = (0..4_000_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 23) as u8).collect();
    for client in 0..5 {
        let mut stream = TcpStream::connect(at).unwrap();
        stream.set_write_timeout(Some(Duration::from_millis(200))).unwrap();
        // the server may disconnect it in the middle
        let _ = stream.write_all(&noise[client * 1000..]);
    }
    // far more than the board reads, after a valid start
    for client in 0..3 {
        let mut stream = TcpStream::connect(at).unwrap();
        stream.set_write_timeout(Some(Duration::from_millis(200))).unwrap();
        let _ = stream.write_all(&[hello(100 + client), noise.clone()].concat());
    }
    // disconnects immediately, with bytes unread
    for _ in 0..5 {
        drop(TcpStream::connect(at).unwrap());
    }
    drop(shakes_hands(at, 1));
    // two peers that send nothing, and one that completes the handshake
    let silent = [TcpStream::connect(at).unwrap(), TcpStream::connect(at).unwrap()];
    let mut host = shakes_hands(at, 2);
    let ask = Writer::new(Kind::Request)
        .seal_value(&Numbered { number: 1, request: Request::Info })
        .unwrap()
        .to_vec();
    host.write_all(&ask).unwrap();
    assert!(frame(&mut host, Kind::Answer, Duration::from_secs(5)));
    drop(silent);
}

//! Taking turns with the server of this board; holds the last messages of both sides, and the log
//! lines for the simulator.
//!
//! The lines are encoded, in a ring of the shared memory; one that does not fit is dropped as a
//! whole. The simulator receives them at the next turn, independently of the link, including lines
//! from before a host connects and before a panic.

use crate::memory;
use core::cell::{Cell, RefCell};
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::waitqueue::WakerRegistration;
use jointrig_firmware::lockstep::{
    Ask, LOG_AT, Op, RING_BYTES, Reply, Setup, TEXT_AT, TEXT_BYTES, from_text,
};
use jointrig_protocol::schema;
use semihosting::io::{Read, Stdin, Stdout, Write, stdin, stdout};
use semihosting::{eprintln, process};

/// The board's side of the port.
pub struct Port {
    /// The message for the next turn.
    pub ask: Ask,
    /// The last reply.
    pub reply: Reply,
    /// Waker of the acquisition task.
    pub block: WakerRegistration,
    /// Waker of the receiving task.
    pub bytes: WakerRegistration,
    /// Waker of the transmitting task.
    pub room: WakerRegistration,
}

/// A server of the board: takes an ask, returns a reply.
pub type Server = fn(&Ask) -> Reply;

static PORT: Mutex<CriticalSectionRawMutex, RefCell<Port>> = Mutex::new(RefCell::new(Port {
    ask: Ask::NOTHING,
    reply: Reply {
        now_us: 0,
        inputs: 0,
        blocks: 0,
        to_device_head: 0,
        to_host_tail: 0,
        log_tail: 0,
        length: 0,
        ran_dry: 0,
        cuts: 0,
    },
    block: WakerRegistration::new(),
    bytes: WakerRegistration::new(),
    room: WakerRegistration::new(),
}));

static SERVER: Mutex<CriticalSectionRawMutex, Cell<Server>> = Mutex::new(Cell::new(simulator));

/// Selects the server of the board.
pub fn serve_by(server: Server) {
    SERVER.lock(|cell| cell.set(server));
}

/// Gives access to the port within a critical section.
pub fn with<R>(f: impl FnOnce(&mut Port) -> R) -> R {
    PORT.lock(|port| f(&mut port.borrow_mut()))
}

/// One turn: requests an operation, and returns when it is this side's turn again.
pub fn turn(op: Op, argument: u32) -> Reply {
    let server = SERVER.lock(Cell::get);
    with(|port| {
        port.ask.op = op as u32;
        port.ask.argument = argument;
        port.reply = server(&port.ask);
        port.reply
    })
}

/// All tasks wait: passes the turn, and wakes the tasks whose event has occurred.
pub fn idle(alarm_us: u64) {
    let server = SERVER.lock(Cell::get);
    let by_uart = crate::uart::is_link();
    let now_us = with(|port| {
        let (blocks, cuts, to_host_tail) = (port.reply.blocks, port.reply.cuts, port.reply.to_host_tail);
        port.ask.alarm_us = alarm_us;
        (port.ask.op, port.ask.argument) = (Op::Idle as u32, u32::from(by_uart));
        port.reply = server(&port.ask);
        if port.reply.blocks != blocks {
            port.block.wake();
        }
        if by_uart || port.reply.to_device_head != port.ask.to_device_tail || port.reply.cuts != cuts {
            port.bytes.wake();
        }
        if by_uart || port.reply.to_host_tail != to_host_tail {
            port.room.wake();
        }
        port.reply.now_us
    });
    crate::time::set(now_us);
}

/// Uses the simulator as the server: a byte on the standard output passes the turn, a byte on the
/// standard input returns it.
pub fn simulator(ask: &Ask) -> Reply {
    static PIPES: Mutex<CriticalSectionRawMutex, RefCell<Option<(Stdin, Stdout)>>> =
        Mutex::new(RefCell::new(None));
    memory::write_ask(&ask.to_words());
    let answered = PIPES.lock(|pipes| {
        let mut pipes = pipes.borrow_mut();
        if pipes.is_none() {
            *pipes = stdin().ok().zip(stdout().ok());
        }
        let (input, output) = pipes.as_mut()?;
        output.write_all(&[1]).ok()?;
        let mut byte = [0];
        input.read(&mut byte).ok().filter(|count| *count == 1)
    });
    if answered.is_none() {
        // the simulator has exited, so the board does too
        process::exit(0)
    }
    Reply::from_words(&memory::read_reply())
}

/// Announces the board and returns its set-up.
pub fn set_up() -> Setup {
    let reply = turn(Op::Start, schema::HASH as u32);
    let mut text = [0; TEXT_BYTES];
    let used = (reply.length as usize).min(text.len());
    memory::read(TEXT_AT, &mut text[..used]);
    if let Some(setup) = from_text(&text[..used]) {
        return setup;
    }
    eprintln!("the simulator's set-up cannot be read: image and simulator are of different sources");
    process::exit(2)
}

/// Sends log lines to the simulator from now on.
pub fn start_log() {
    jointrig_board_log::also_to(put);
}

fn put(line: &[u8]) {
    with(|port| {
        let head = port.ask.log_head;
        let room = RING_BYTES - head.wrapping_sub(port.reply.log_tail);
        if line.len() <= room as usize {
            memory::write_ring(LOG_AT, head, line);
            port.ask.log_head = head.wrapping_add(line.len() as u32);
        }
    });
}

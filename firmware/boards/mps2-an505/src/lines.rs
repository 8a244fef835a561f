//! Log lines: text in a ring of the shared memory, dropped whole when it is full.

use core::fmt::Write;

use heapless::String;
use jointrig_firmware::lockstep::{LOG_AT, RING_BYTES};
use log::{LevelFilter, Log, Metadata, Record};

use crate::{memory, port};

struct Lines;

impl Log for Lines {
    fn enabled(&self, _metadata: &Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &Record<'_>) {
        let mut line = String::<240>::new();
        // the level's first letter, then the text; what does not fit is left out
        let _ = write!(line, "{:.1}{}", record.level().as_str(), record.args());
        if line.push('\n').is_err() {
            line.pop();
            let _ = line.push('\n');
        }
        port::with(|port| {
            let head = port.ask.log_head;
            let room = RING_BYTES - head.wrapping_sub(port.reply.log_tail);
            if line.len() <= room as usize {
                memory::write_ring(LOG_AT, head, line.as_bytes());
                port.ask.log_head = head.wrapping_add(line.len() as u32);
            }
        });
    }

    fn flush(&self) {}
}

/// From here on, log lines reach the simulator.
pub fn start() {
    static LINES: Lines = Lines;
    // fails only when there is a logger already
    if log::set_logger(&LINES).is_ok() {
        log::set_max_level(LevelFilter::Info);
    }
}

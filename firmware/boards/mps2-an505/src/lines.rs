//! Log lines for the simulator: encoded, in a ring of the shared memory; a line that does not fit
//! is dropped as a whole.
//!
//! The simulator receives them at the next turn, independently of the link, including lines from
//! before a host connects and before a panic.

use jointrig_firmware::lockstep::{LOG_AT, RING_BYTES};

use crate::{memory, port};

/// Sends log lines to the simulator from now on.
pub fn start() {
    jointrig_board_log::also_to(put);
}

fn put(line: &[u8]) {
    port::with(|port| {
        let head = port.ask.log_head;
        let room = RING_BYTES - head.wrapping_sub(port.reply.log_tail);
        if line.len() <= room as usize {
            memory::write_ring(LOG_AT, head, line);
            port.ask.log_head = head.wrapping_add(line.len() as u32);
        }
    });
}

//! Log lines for a debug probe over RTT, shown by `cargo xtask flash`.
//!
//! Without a probe, or with one that is too slow, a line that does not fit is dropped as a whole. A
//! probe's program may request a blocking mode by a word in the channel's memory; this is reverted
//! before each line, because the controller would wait with interrupts disabled.

use core::cell::RefCell;

use critical_section::Mutex;
use rtt_target::ChannelMode::NoBlockSkip;
use rtt_target::{UpChannel, rtt_init};

static CHANNEL: Mutex<RefCell<Option<UpChannel>>> = Mutex::new(RefCell::new(None));

/// Sends log lines to the probe from now on. probe-rs recognises the content by the channel's name.
pub fn start() {
    let channels = rtt_init! { up: { 0: { size: 1024, mode: NoBlockSkip, name: "defmt" } } };
    critical_section::with(|free| CHANNEL.borrow_ref_mut(free).replace(channels.up.0));
    jointrig_board_log::also_to(put);
}

fn put(line: &[u8]) {
    critical_section::with(|free| {
        if let Some(channel) = CHANNEL.borrow_ref_mut(free).as_mut() {
            channel.set_mode(NoBlockSkip);
            channel.write(line);
        }
    });
}

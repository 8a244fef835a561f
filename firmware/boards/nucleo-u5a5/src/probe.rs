//! Log lines for a debug probe, over RTT: what `cargo xtask flash` shows.
//!
//! Without a probe, and with one that is too slow, a line that finds no room is left out whole. A
//! probe's program may ask the controller to wait instead, by a word in the channel's memory: that
//! is undone before each line, because the wait would be one with interrupts off.

use core::cell::RefCell;

use critical_section::Mutex;
use rtt_target::ChannelMode::NoBlockSkip;
use rtt_target::{UpChannel, rtt_init};

static CHANNEL: Mutex<RefCell<Option<UpChannel>>> = Mutex::new(RefCell::new(None));

/// From here on, log lines reach the probe. The channel's name is how probe-rs knows what it
/// carries.
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

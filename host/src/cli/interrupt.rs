//! Ctrl-C: the first one ends the work after the current shot, the second one ends the program.

use crate::outside::tell_line;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Returns a flag that Ctrl-C (or a termination signal) sets.
pub fn flag() -> Arc<AtomicBool> {
    let stop = Arc::default();
    catch(&stop);
    stop
}

/// Makes Ctrl-C (or a termination signal) set this flag.
pub fn catch(stop: &Arc<AtomicBool>) {
    let raised = stop.clone();
    let set = ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::Relaxed) {
            // everything accepted is already in the file
            std::process::exit(1);
        }
        tell_line!("\nstopping after the shot in hand; Ctrl-C again ends at once");
    });
    if let Err(error) = set {
        log::warn!("Ctrl-C cannot be caught ({error}): it will end the program at once");
    }
}

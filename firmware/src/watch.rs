//! Watchdog of link and front end: a silent host or a silent front end disarms the hammer and stops
//! the shaker. Also counts dropped log lines and reports the counters once a second.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Timer};
use jointrig_protocol::event::Event;

use crate::Core;

/// Interval of the checks.
const PERIOD: Duration = Duration::from_millis(100);
/// Check intervals between two reports of the counters.
const REPORT_EVERY: u32 = 10;

/// Runs forever.
pub async fn watch<M: RawMutex>(core: &Core<'_, M>) -> ! {
    let mut periods = 0_u32;
    loop {
        Timer::after(PERIOD).await;
        periods = periods.wrapping_add(1);
        core.with(|state| {
            state.safety().check_silence();
            if let Some(tap) = core.logs {
                state.note_dropped_logs(tap.dropped());
            }
            if state.safety().is_streaming() && periods.is_multiple_of(REPORT_EVERY) {
                let counters = state.counters();
                state.safety().say(Event::Counters(counters));
            }
        });
        core.to_send.signal(());
    }
}

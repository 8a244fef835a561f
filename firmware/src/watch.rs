//! Watchdog of link and front end: a silent host or a silent front end disarms the hammer and stops
//! the shaker. Also counts dropped log lines and reports the counters once a second.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};
use jointrig_protocol::answer::{Hammer, Shaker};
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::limits::{LINK_SILENCE_MS, SCAN_SILENCE_MS};

use crate::Core;
use crate::fmt::warning;

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
            let silent = Instant::now().saturating_duration_since(state.last_heard).as_millis();
            let armed = matches!(state.hammer.state(), Hammer::Armed | Hammer::Waiting | Hammer::Firing);
            let shakes = matches!(state.shaker.state(), Shaker::Slewing | Shaker::Steady);
            if (armed || shakes) && silent >= u64::from(LINK_SILENCE_MS) {
                warning!("the host is silent: everything comes to rest");
                state.bring_to_rest(Reason::LinkLost);
            }
            let blind = Instant::now().saturating_duration_since(state.last_block).as_millis();
            if (armed || shakes) && blind >= u64::from(SCAN_SILENCE_MS) {
                warning!("no scans: everything comes to rest");
                // the ramp needs the next block for its codes; without blocks the drive is already
                // at rest
                state.bring_to_rest(Reason::FrontEnd);
            }
            if let Some(tap) = core.logs {
                state.counters.logs_dropped = tap.dropped();
            }
            if state.streaming && periods.is_multiple_of(REPORT_EVERY) {
                let counters = state.counters;
                state.say(Event::Counters(counters));
            }
        });
        core.to_send.signal(());
    }
}

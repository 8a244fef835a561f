//! Watching: a silent host disarms the hammer and stops the shaker, as does a silent front end;
//! dropped log lines are counted, and the counters are told once a second.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};
use jointrig_protocol::answer::{Hammer, Shaker};
use jointrig_protocol::event::{Event, Reason};
use jointrig_protocol::limits::{LINK_SILENCE_MS, SCAN_SILENCE_MS};

use crate::Core;
use crate::fmt::warning;

/// How often the host's silence is checked.
const PERIOD: Duration = Duration::from_millis(100);
/// Periods between two reports of the counters.
const REPORT_EVERY: u32 = 10;

/// Runs for ever.
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
                // its ramp waits for the next block, as its codes do: without blocks the drive
                // rests already
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

//! The independent watchdog: fed only while acquisition and link are alive.
//!
//! Each of the two beats from where it does its work: acquisition with every block (or every failed
//! try to get one), the link from the executor that runs USB while the bus moves or has no host. A
//! host that is not there, or converters that are broken, are not reasons for a reset; a task that
//! hangs is. The watchdog runs from its own oscillator, and nothing stops it but a reset, which
//! drops the coil.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::Peri;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Timer};

/// Unfed for this long, it resets: µs.
const TIMEOUT_US: u32 = 500_000;
/// How often both are looked at. Three looks without a beat still fit the timeout.
const PERIOD: Duration = Duration::from_millis(125);

/// One part's signs of life.
pub struct Beats(AtomicU32);

/// Of acquisition.
pub static ACQUISITION: Beats = Beats(AtomicU32::new(0));
/// Of the link.
pub static LINK: Beats = Beats(AtomicU32::new(0));

impl Beats {
    /// Still here.
    pub fn beat(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    fn count(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}

/// Starts it; from now on it must be fed.
pub fn start(peripheral: Peri<'static, IWDG>) -> IndependentWatchdog<'static, IWDG> {
    let mut dog = IndependentWatchdog::new(peripheral, TIMEOUT_US);
    dog.unleash();
    dog
}

/// Feeds it while both are alive. Runs for ever.
#[embassy_executor::task]
pub async fn task(mut dog: IndependentWatchdog<'static, IWDG>) {
    let mut before = None;
    loop {
        let now = (ACQUISITION.count(), LINK.count());
        if before.is_none_or(|(acquisition, link)| now.0 != acquisition && now.1 != link) {
            dog.pet();
        }
        before = Some(now);
        Timer::after(PERIOD).await;
    }
}

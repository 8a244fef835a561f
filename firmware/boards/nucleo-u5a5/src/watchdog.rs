//! The independent watchdog: fed only while acquisition and link are alive.
//!
//! Each signals life from where it does its work: acquisition with every block (or every failed
//! attempt to get one), the link from the executor that runs USB, while the bus makes progress or
//! has no host. A missing host or faulty converters are not reasons for a reset; a task that hangs
//! is. The watchdog runs from its own oscillator and can only be stopped by a reset, which switches
//! the coil off.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::Peri;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Timer};

/// Timeout without feeding, µs.
const TIMEOUT_US: u32 = 500_000;
/// Interval between checks of both. Three checks without a sign of life still fit the timeout.
const PERIOD: Duration = Duration::from_millis(125);

/// Signs of life of one part.
pub struct Beats(AtomicU32);

/// Signs of life of acquisition.
pub static ACQUISITION: Beats = Beats(AtomicU32::new(0));
/// Signs of life of the link.
pub static LINK: Beats = Beats(AtomicU32::new(0));

impl Beats {
    /// Signals life.
    pub fn beat(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    fn count(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}

/// Starts the watchdog; it must be fed from now on.
pub fn start(peripheral: Peri<'static, IWDG>) -> IndependentWatchdog<'static, IWDG> {
    let mut dog = IndependentWatchdog::new(peripheral, TIMEOUT_US);
    dog.unleash();
    dog
}

/// Feeds the watchdog while both parts are alive. Runs forever.
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

//! Three lights on the board: green beats while the program runs, blue while scans come, red after
//! a fault.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::peripherals::{PB7, PC7, PG2};
use embassy_time::Timer;

/// Scans come.
pub static SCANNING: AtomicBool = AtomicBool::new(false);
/// A part reported a fault, and no block has come whole since.
pub static FAULT: AtomicBool = AtomicBool::new(false);

/// Runs for ever.
#[embassy_executor::task]
pub async fn task(green: Peri<'static, PC7>, blue: Peri<'static, PB7>, red: Peri<'static, PG2>) {
    let mut green = Output::new(green, Level::Low, Speed::Low);
    let mut blue = Output::new(blue, Level::Low, Speed::Low);
    let mut red = Output::new(red, Level::Low, Speed::Low);
    loop {
        green.toggle();
        blue.set_level(SCANNING.load(Ordering::Relaxed).into());
        red.set_level(FAULT.load(Ordering::Relaxed).into());
        Timer::after_millis(250).await;
    }
}

//! Three lights on the board: green blinks while the program runs, blue is on while scans arrive,
//! red after a fault.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::peripherals::{PB7, PC7, PG2};
use embassy_time::Timer;

/// Scans are arriving.
pub static SCANNING: AtomicBool = AtomicBool::new(false);
/// A part has reported a fault, and no complete block has arrived since.
pub static FAULT: AtomicBool = AtomicBool::new(false);

/// Runs forever.
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

//! The board: the firmware for a simulator, which starts QEMU itself. The image's arguments are
//! `serve` and, for a link over UART 0, `uart`.
#![no_std]
#![no_main]

use mps2_an505::{device, memory, port, uart};
use semihosting::experimental::env::args;
use semihosting::{eprintln, process};

#[cortex_m_rt::entry]
fn main() -> ! {
    jointrig_board_fault::limit_stack();
    // an unreadable command line is treated as empty
    let words = args::<256>().ok();
    let mut words = words.as_ref().into_iter().flatten();
    if words.next() != Some(Ok("serve")) {
        eprintln!("this image takes the argument serve, and is started by a simulator");
        process::exit(2)
    }
    if words.next() == Some(Ok("uart")) {
        uart::start();
    }
    if !memory::is_served() {
        eprintln!("nobody serves this board's front end: use the device address qemu:, which starts both");
        process::exit(2)
    }
    port::start_log();
    device::run(&port::set_up())
}

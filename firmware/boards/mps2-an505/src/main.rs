//! The emulated target: the controller's firmware as a binary for the Cortex-M33, under QEMU's mps2-an505.
//!
//! What a wired board does with its peripherals, this one does through memory that it shares with the
//! simulator, in turns ([`jointrig_firmware::lockstep`]): converters, coil, inputs, stage and link are the
//! parts in [`parts`], and [`port`] is where turns are taken. Time is what the simulator says ([`time`]), so
//! the machine's speed enters nothing.
//!
//! The image's first argument chooses what it does:
//!
//! | argument | what |
//! |---|---|
//! | `serve` | runs the firmware for a simulator, which starts QEMU itself |
//! | `golden` | compares all golden vectors of the wire with this build's frames |
//! | `bench` | counts instructions; QEMU must run with `-icount shift=10,sleep=off` |
#![no_std]
#![no_main]

mod bench;
mod counter;
mod device;
mod executor;
mod fault;
mod lines;
mod memory;
mod parts;
mod port;
mod stack;
mod time;

// brings the critical section of a single core
use cortex_m as _;
use jointrig_protocol::golden;
use semihosting::experimental::env::args;
use semihosting::{eprintln, println, process};

#[cortex_m_rt::entry]
fn main() -> ! {
    // a command line that cannot be read is treated as none
    match args::<256>().ok().as_ref().and_then(|mut words| words.next()) {
        Some(Ok("serve")) => serve(),
        Some(Ok("golden")) => vectors(),
        Some(Ok("bench")) => bench::run(),
        _ => {
            eprintln!("this image takes one argument: serve (for the simulator), golden, or bench");
            process::exit(2)
        }
    }
}

fn serve() -> ! {
    if !memory::is_served() {
        eprintln!("nobody serves this board's front end: use the device address qemu:, which starts both");
        process::exit(2)
    }
    lines::start();
    device::run(&port::set_up())
}

fn vectors() -> ! {
    match golden::check() {
        Ok(count) => {
            println!("golden {count} vectors agree");
            process::exit(0)
        }
        Err(name) => {
            eprintln!("golden vector {name} differs");
            process::exit(1)
        }
    }
}

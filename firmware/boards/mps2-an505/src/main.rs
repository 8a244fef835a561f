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
//! | `serve` | runs the firmware for a simulator, which starts QEMU itself; with the further argument `uart`, the link is UART 0 |
//! | `golden` | compares all golden vectors of the wire with this build's frames, and copies of memory with their originals |
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
mod uart;

use core::hint::black_box;

// the critical section of a single core
use cortex_m as _;
// memcpy
use jointrig_copy as _;
use jointrig_protocol::golden;
use semihosting::experimental::env::args;
use semihosting::{eprintln, println, process};

#[cortex_m_rt::entry]
fn main() -> ! {
    jointrig_board_fault::limit_stack();
    // a command line that cannot be read is treated as none
    let words = args::<256>().ok();
    let mut words = words.as_ref().into_iter().flatten();
    match words.next() {
        Some(Ok("serve")) => {
            if words.next() == Some(Ok("uart")) {
                uart::start();
            }
            serve()
        }
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
    if !copies_agree() {
        eprintln!("memcpy does not copy");
        process::exit(1)
    }
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

/// Copies of every length up to a hundred bytes, from and to every alignment.
fn copies_agree() -> bool {
    let original: [u8; 112] = core::array::from_fn(|i| i as u8 + 1);
    (0..=100).all(|length| {
        (0..64).all(|alignments| {
            let (from, to) = (alignments % 8, alignments / 8);
            let mut copy = [0; 112];
            black_box(&mut copy)[to..to + length].copy_from_slice(&black_box(&original)[from..from + length]);
            copy.iter().enumerate().all(|(i, byte)| {
                *byte == if (to..to + length).contains(&i) { original[i - to + from] } else { 0 }
            })
        })
    })
}

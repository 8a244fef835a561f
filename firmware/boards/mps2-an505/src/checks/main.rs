//! Checks of the board for its developers. The image's first argument selects one:
//!
//! - `golden` compares all golden vectors of the protocol with this build's frames, and checks
//!   copies of memory against their originals.
//! - `bench` counts instructions; QEMU must run with `-icount shift=10,sleep=off`.
#![no_std]
#![no_main]

mod bench;

use core::hint::black_box;

use jointrig_protocol::golden;
use semihosting::experimental::env::args;
use semihosting::{eprintln, println, process};

#[cortex_m_rt::entry]
fn main() -> ! {
    jointrig_board_fault::limit_stack();
    // an unreadable command line is treated as empty
    let words = args::<256>().ok();
    match words.as_ref().into_iter().flatten().next() {
        Some(Ok("golden")) => vectors(),
        Some(Ok("bench")) => bench::run(),
        _ => {
            eprintln!("this image takes one argument: golden, or bench");
            process::exit(2)
        }
    }
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

//! The ends that are not meant to happen: a panic or a processor fault is reported, and QEMU ends with 101.

use core::fmt::Write;
use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use heapless::String;
use jointrig_firmware::lockstep::{Ask, Op};
use semihosting::io::Write as _;
use semihosting::{eprintln, process};

use crate::memory;

/// The exit code of a firmware that broke down.
const BROKEN: i32 = 101;

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    let mut sentence = String::<512>::new();
    // what does not fit is left out
    let _ = write!(sentence, "{info}");
    report(&sentence)
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    let mut sentence = String::<512>::new();
    let _ = write!(sentence, "processor fault at {:#010x}, called from {:#010x}", frame.pc(), frame.lr());
    report(&sentence)
}

/// The port itself may be what broke, so this goes straight to the memory and the pipe.
fn report(sentence: &str) -> ! {
    if memory::is_served() {
        let length = memory::write_text(sentence.as_bytes());
        let last = Ask { op: Op::Panic as u32, argument: length, ..Ask::NOTHING };
        memory::write_ask(&last.to_words());
        if let Ok(mut pipe) = semihosting::io::stdout() {
            // the simulator hears of the end in any case, by the pipe's
            let _ = pipe.write_all(&[1]);
        }
    } else {
        eprintln!("{sentence}");
    }
    process::exit(BROKEN)
}

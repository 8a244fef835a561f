//! Abnormal ends: a panic or a processor fault is reported, and QEMU exits with code 101.

use core::fmt::Write;
use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, exception};
use heapless::String;
use jointrig_firmware::lockstep::{Ask, Op};
use semihosting::io::Write as _;
use semihosting::{eprintln, process};

use crate::memory;

/// The exit code after a failure of the firmware.
const BROKEN: i32 = 101;

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    let mut sentence = String::<512>::new();
    // text that does not fit is dropped
    let _ = write!(sentence, "{info}");
    report(&sentence)
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    let mut sentence = String::<512>::new();
    let _ = write!(
        sentence,
        "processor fault at {:#010x}, called from {:#010x}: {}",
        frame.pc(),
        frame.lr(),
        jointrig_board_fault::status()
    );
    report(&sentence)
}

/// For tests: ends with a processor fault, by stack overflow or by an invalid read.
#[cold]
#[inline(never)]
pub fn end_by(overflow: bool) {
    if overflow {
        recurse(1);
    } else {
        read_nowhere();
    }
}

/// For tests: reads an address without memory.
fn read_nowhere() {
    // SAFETY: no memory is affected; the read causes the intended fault.
    let _ = unsafe { core::ptr::read_volatile(0x7000_0000 as *const u32) };
}

/// For tests: recurses until little stack is left, then calls a function that needs more.
#[inline(never)]
fn recurse(depth: u32) -> u32 {
    /// More than the frame of a fault, so that the handler can start; less than what [`greedy`]
    /// uses.
    const LEFT: usize = 6 * 1024;
    let frame = core::hint::black_box([depth; 256]);
    let here = (&raw const frame).addr();
    let limit = cortex_m::register::msplim::read() as usize;
    let deeper = if here - limit < LEFT { greedy(depth) } else { recurse(depth.wrapping_add(1)) };
    core::hint::black_box(deeper) ^ frame[255]
}

#[inline(never)]
fn greedy(seed: u32) -> u32 {
    core::hint::black_box([seed; 4096])[4095]
}

/// Reports the message. The port itself may have failed, so this accesses the memory and the pipe
/// directly.
fn report(sentence: &str) -> ! {
    if memory::is_served() {
        let length = memory::write_text(sentence.as_bytes());
        let last = Ask { op: Op::Panic as u32, argument: length, ..Ask::NOTHING };
        memory::write_ask(&last.to_words());
        if let Ok(mut pipe) = semihosting::io::stdout() {
            // the simulator detects the end in any case, by the closed pipe
            let _ = pipe.write_all(&[1]);
        }
    } else {
        eprintln!("{sentence}");
    }
    process::exit(BROKEN)
}

//! Guard and emergency stop, told when they change instead of once a block.
//!
//! EXTI lines 13 and 14 wake a task on an executor of its own, above acquisition: it runs within
//! some microseconds, also when no blocks come and when acquisition never returns. It takes coil
//! and drive away by itself and tells the core, which disarms and lets the host hear of it. A core
//! that is locked for ever, or interrupts that stay off, stop this task too: then TIM1's break has
//! already ended the pulse in hardware, and the watchdog resets.
//!
//! These lines' pending bits are cleared here and no other's: embassy's own EXTI handler would
//! clear those of BUSY as well.

use core::future::poll_fn;
use core::sync::atomic::{AtomicBool, Ordering};
use core::task::Poll;

use embassy_stm32::interrupt::{self, InterruptExt};
use embassy_stm32::pac::EXTI;
use embassy_sync::waitqueue::AtomicWaker;

use crate::{Shared, coil, drive, inputs};

/// EXTI lines, which are pin numbers, of PF13 and PF14.
const LINES: [usize; 2] = [13, 14];
/// Port F in EXTICR.
const PORT_F: u8 = 5;

static CHANGED: AtomicBool = AtomicBool::new(false);
static WAKER: AtomicWaker = AtomicWaker::new();

fn on_edge(line: usize) {
    EXTI.rpr(0).write(|w| w.set_line(line, true));
    EXTI.fpr(0).write(|w| w.set_line(line, true));
    CHANGED.store(true, Ordering::Release);
    WAKER.wake();
}

#[embassy_stm32::interrupt]
fn EXTI13() {
    on_edge(13);
}

#[embassy_stm32::interrupt]
fn EXTI14() {
    on_edge(14);
}

/// Lets the edges through. The pins are inputs already.
fn listen() {
    critical_section::with(|_| {
        for line in LINES {
            EXTI.exticr(line / 4).modify(|w| w.set_exti(line % 4, PORT_F));
            EXTI.rtsr(0).modify(|w| w.set_line(line, true));
            EXTI.ftsr(0).modify(|w| w.set_line(line, true));
            EXTI.imr(0).modify(|w| w.set_line(line, true));
        }
    });
    for number in [interrupt::EXTI13, interrupt::EXTI14] {
        // SAFETY: their handlers stand above and touch nothing but their own lines, an atomic and a
        // waker.
        unsafe { number.enable() };
    }
}

async fn edge() {
    poll_fn(|context| {
        WAKER.register(context.waker());
        if CHANGED.swap(false, Ordering::Acquire) { Poll::Ready(()) } else { Poll::Pending }
    })
    .await;
}

/// Runs for ever.
#[embassy_executor::task]
pub async fn task(core: &'static Shared) {
    listen();
    loop {
        let (closed, pressed) = (inputs::may_move(), inputs::stop_is_pressed());
        // first the hardware, then the words
        if !closed || pressed {
            coil::veto();
        }
        if pressed {
            drive::mute();
        }
        if core.see_inputs(closed, pressed) {
            defmt::info!("guard closed: {}, emergency stop: {}", closed, pressed);
        }
        edge().await;
    }
}

//! Guard and emergency stop, handled when they change instead of once per block.
//!
//! EXTI lines 13 and 14 wake a task on a separate executor with a higher priority than acquisition:
//! it runs within some microseconds, also when no blocks arrive and when acquisition never returns.
//! It disables coil and drive directly and informs the core, which disarms the hammer and reports
//! to the host. A core that is locked up forever, or interrupts that stay disabled, also stop this
//! task: TIM1's break has then already ended the pulse in hardware, and the watchdog resets.
//!
//! Only the pending bits of these lines are cleared here: embassy's own EXTI handler would also
//! clear those of BUSY.

use core::future::poll_fn;
use core::sync::atomic::{AtomicBool, Ordering};
use core::task::Poll;

use embassy_stm32::interrupt::{self, InterruptExt};
use embassy_stm32::pac::EXTI;
use embassy_sync::waitqueue::AtomicWaker;

use crate::{Shared, coil, drive, inputs};

/// EXTI lines of PF13 and PF14, equal to the pin numbers.
const LINES: [usize; 2] = [13, 14];
/// Code of port F in EXTICR.
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

/// Enables the edge interrupts. The pins are already inputs.
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
        // SAFETY: their handlers are defined above and access only their own lines, an atomic and a
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

/// Runs forever.
#[embassy_executor::task]
pub async fn task(core: &'static Shared) {
    listen();
    loop {
        let (closed, pressed) = (inputs::may_move(), inputs::stop_is_pressed());
        // first the hardware, then the report
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

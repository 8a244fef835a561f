//! Guard, emergency stop, the reset key of the latter, and the monitoring contact of relay K1.
//!
//! The firmware reads them once per block (every 0.3 ms) and handles guard and stop when they
//! change, instead of once per block. The coil does not wait for either: guard and stop also act on
//! TIM1's break and on the coil driver's gate. Each input is high when all is well and pulled down,
//! so that a broken wire reads as an open guard and a pressed stop.
//!
//! EXTI lines 13 and 14 wake a task on a separate executor with a higher priority than acquisition:
//! it runs within some microseconds, also when no blocks arrive and when acquisition never returns.
//! It disables coil and drive directly and informs the core, which disarms the hammer and reports
//! to the host. A core that is locked up forever, or interrupts that stay disabled, also stop this
//! task: TIM1's break has then already ended the pulse in hardware, and the watchdog resets.
//!
//! Only the pending bits of these lines are cleared here: embassy's own EXTI handler would also
//! clear those of BUSY.

use crate::{Shared, coil, drive};
use core::future::poll_fn;
use core::sync::atomic::{AtomicBool, Ordering};
use core::task::Poll;
use embassy_stm32::Peri;
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::interrupt::{self, InterruptExt};
use embassy_stm32::pac::gpio::vals::Idr;
use embassy_stm32::pac::{EXTI, GPIOF};
use embassy_stm32::peripherals::{PF12, PF13, PF14, PF15};
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::Instant;
use jointrig_firmware::board::Inputs;
use jointrig_firmware::safety::{Relay, RelayFault};
use jointrig_protocol::slow::Slow;

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
        let (closed, pressed) = (may_move(), stop_is_pressed());
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

/// Whether K1 was seen to follow its coil; must be checked together with the guard's pin.
static RELAY_IS_SOUND: AtomicBool = AtomicBool::new(false);

/// Whether the guard is closed and K1 can be relied on to open.
pub fn may_move() -> bool {
    guard_is_closed() && RELAY_IS_SOUND.load(Ordering::Relaxed)
}

/// Whether the guard is closed, for code that does not own the pin.
pub fn guard_is_closed() -> bool {
    GPIOF.idr().read().idr(13) == Idr::HIGH
}

/// Whether the emergency stop is pressed.
pub fn stop_is_pressed() -> bool {
    GPIOF.idr().read().idr(14) == Idr::LOW
}

/// The four inputs.
pub struct Switches {
    _guard: Input<'static>,
    _stop_released: Input<'static>,
    key: Input<'static>,
    key_was_on: bool,
    dropped: Input<'static>,
    relay: Relay,
    told: Option<RelayFault>,
    to_tell: Option<RelayFault>,
}

impl Switches {
    /// Parameters: guard, stop, key, and K1's normally closed contact.
    pub fn new(
        guard: Peri<'static, PF13>,
        stop: Peri<'static, PF14>,
        key: Peri<'static, PF15>,
        dropped: Peri<'static, PF12>,
    ) -> Self {
        Self {
            _guard: Input::new(guard, Pull::Down),
            _stop_released: Input::new(stop, Pull::Down),
            key: Input::new(key, Pull::Down),
            // initially true: a key that is stuck or was left turned must not reset anything
            key_was_on: true,
            dropped: Input::new(dropped, Pull::Down),
            relay: Relay::new(),
            told: None,
            to_tell: None,
        }
    }
}

impl Inputs for Switches {
    fn interlock_closed(&mut self) -> bool {
        // stop and guard are in series with K1's coil
        let chain_closed = guard_is_closed() && !stop_is_pressed();
        let seen = self.relay.see(chain_closed, self.dropped.is_high(), Instant::now().as_micros());
        RELAY_IS_SOUND.store(seen.is_ok(), Ordering::Relaxed);
        if seen.err() != self.told {
            self.told = seen.err();
            self.to_tell = seen.err();
        }
        may_move()
    }

    fn fault(&mut self) -> Option<&'static str> {
        self.to_tell.take().map(RelayFault::sentence)
    }

    fn slow(&mut self) -> Option<Slow> {
        crate::slow::take()
    }

    fn emergency_stop(&mut self) -> bool {
        stop_is_pressed()
    }

    fn local_reset(&mut self) -> bool {
        let on = self.key.is_high();
        let turned = on && !self.key_was_on;
        self.key_was_on = on;
        turned
    }
}

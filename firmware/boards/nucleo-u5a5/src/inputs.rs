//! Guard, emergency stop, the reset key of the latter, and the monitoring contact of relay K1.
//!
//! The firmware reads them once per block (every 0.3 ms) and when guard or stop change
//! ([`crate::guard`]). The coil does not wait for either: guard and stop also act on TIM1's break
//! and on the coil driver's gate. Each input is high when all is well and pulled down, so that a
//! broken wire reads as an open guard and a pressed stop.

use core::sync::atomic::{AtomicBool, Ordering};
use embassy_stm32::Peri;
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::pac::GPIOF;
use embassy_stm32::pac::gpio::vals::Idr;

use embassy_stm32::peripherals::{PF12, PF13, PF14, PF15};
use embassy_time::Instant;
use jointrig_firmware::board::Inputs;
use jointrig_firmware::safety::{Relay, RelayFault};
use jointrig_protocol::slow::Slow;

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

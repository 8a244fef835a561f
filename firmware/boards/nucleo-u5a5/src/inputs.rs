//! Guard, emergency stop, and the key that resets it.
//!
//! The firmware looks at them once a block (every 0.3 ms) and when guard or stop change ([`crate::guard`]); the coil
//! does not wait for either: guard and stop also act on TIM1's break and on the coil driver's gate. Each input is high when all is well, and pulled down, so
//! that a broken wire is an open guard and a pressed stop.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::pac::GPIOF;
use embassy_stm32::pac::gpio::vals::Idr;
use embassy_stm32::peripherals::{PF13, PF14, PF15};
use jointrig_firmware::board::Inputs;

/// Whether the guard is closed, for whoever may not own the pin.
pub fn guard_is_closed() -> bool {
    GPIOF.idr().read().idr(13) == Idr::HIGH
}

/// Whether the emergency stop is pressed.
pub fn stop_is_pressed() -> bool {
    GPIOF.idr().read().idr(14) == Idr::LOW
}

/// The three inputs.
pub struct Switches {
    _guard: Input<'static>,
    _stop_released: Input<'static>,
    key: Input<'static>,
    key_was_on: bool,
}

impl Switches {
    /// Guard, stop, key.
    pub fn new(guard: Peri<'static, PF13>, stop: Peri<'static, PF14>, key: Peri<'static, PF15>) -> Self {
        Self {
            _guard: Input::new(guard, Pull::Down),
            _stop_released: Input::new(stop, Pull::Down),
            key: Input::new(key, Pull::Down),
            // a key that is stuck, or was left turned, resets nothing
            key_was_on: true,
        }
    }
}

impl Inputs for Switches {
    fn interlock_closed(&mut self) -> bool {
        guard_is_closed()
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

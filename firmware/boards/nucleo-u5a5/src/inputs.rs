//! Guard, emergency stop, and the key that resets it.
//!
//! The firmware looks at them once a block (every 0.3 ms); the coil does not wait for that: guard and stop also
//! act on TIM1's break and on the coil driver's gate. Each input is high when all is well, and pulled down, so
//! that a broken wire is an open guard and a pressed stop.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::peripherals::{PF13, PF14, PF15};
use jointrig_firmware::board::Inputs;

/// The three inputs.
pub struct Switches {
    guard: Input<'static>,
    stop_released: Input<'static>,
    key: Input<'static>,
    key_was_on: bool,
}

impl Switches {
    /// Guard, stop, key.
    pub fn new(guard: Peri<'static, PF13>, stop: Peri<'static, PF14>, key: Peri<'static, PF15>) -> Self {
        Self {
            guard: Input::new(guard, Pull::Down),
            stop_released: Input::new(stop, Pull::Down),
            key: Input::new(key, Pull::Down),
            // a key that is stuck, or was left turned, resets nothing
            key_was_on: true,
        }
    }
}

impl Inputs for Switches {
    fn interlock_closed(&mut self) -> bool {
        self.guard.is_high()
    }

    fn emergency_stop(&mut self) -> bool {
        self.stop_released.is_low()
    }

    fn local_reset(&mut self) -> bool {
        let on = self.key.is_high();
        let turned = on && !self.key_was_on;
        self.key_was_on = on;
        turned
    }
}

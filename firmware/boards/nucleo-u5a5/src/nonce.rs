//! A number that no earlier start had: from the RNG, with its settings of reset.
//!
//! embassy's driver is not used: a source that fails makes it try again without end, and a
//! controller must start without one.

use embassy_stm32::pac::{RCC, RNG};

/// Looks before the source is given up: some ms; the first number takes 0.2 ms.
const LOOKS: u32 = 100_000;

/// Draws it; `None` when the source reports an error or stays silent. The RNG runs from HSI48,
/// which `embassy_stm32::init` has started.
pub fn draw() -> Option<u32> {
    RCC.ahb2enr1().modify(|w| w.set_rngen(true));
    // the clock arrives two cycles after the write (RM0456, "Peripheral clock enabling"): this
    // waits for it
    let _ = RCC.ahb2enr1().read();
    RNG.cr().modify(|w| w.set_rngen(true));
    let mut drawn = None;
    for _ in 0..LOOKS {
        let status = RNG.sr().read();
        if status.seis() || status.ceis() {
            break;
        }
        if status.drdy() {
            // a zero is an error that came between the two reads (RM0456, "RNG operation")
            drawn = Some(RNG.dr().read()).filter(|number| *number != 0);
            break;
        }
    }
    RNG.cr().modify(|w| w.set_rngen(false));
    RCC.ahb2enr1().modify(|w| w.set_rngen(false));
    drawn
}

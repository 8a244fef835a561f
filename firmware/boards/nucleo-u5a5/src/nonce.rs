//! A number not used by any earlier start: from the RNG, with its reset settings.
//!
//! embassy's driver is not used: it retries endlessly when the source fails, and a controller must
//! start without a random number too.

use embassy_stm32::pac::{RCC, RNG};

/// Number of polls before the source is considered failed: some ms; the first number takes 0.2 ms.
const LOOKS: u32 = 100_000;

/// Draws a number; `None` when the source reports an error or does not respond. The RNG is clocked
/// by HSI48, which `embassy_stm32::init` has started.
pub fn draw() -> Option<u32> {
    RCC.ahb2enr1().modify(|w| w.set_rngen(true));
    // the clock is active two cycles after the write (RM0456, "Peripheral clock enabling"); this
    // read waits for it
    let _ = RCC.ahb2enr1().read();
    RNG.cr().modify(|w| w.set_rngen(true));
    let mut drawn = None;
    for _ in 0..LOOKS {
        let status = RNG.sr().read();
        if status.seis() || status.ceis() {
            break;
        }
        if status.drdy() {
            // zero indicates an error that occurred between the two reads (RM0456, "RNG operation")
            drawn = Some(RNG.dr().read()).filter(|number| *number != 0);
            break;
        }
    }
    RNG.cr().modify(|w| w.set_rngen(false));
    RCC.ahb2enr1().modify(|w| w.set_rngen(false));
    drawn
}

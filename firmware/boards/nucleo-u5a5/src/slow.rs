//! Values measured ten times a second by the chip's ADC1: the bias of the two constant-current
//! supplies, the specimen's temperature, and the presence of the USB's 5 V.
//!
//! Circuits and pins: docs/WIRING.md. A conversion takes a few µs; only this task waits for it, in
//! thread mode.

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};

use critical_section::Mutex;
use embassy_stm32::Peri;
use embassy_stm32::peripherals::{ADC1, PC0, PC1, PC2, PC3};
use embassy_time::Timer;
use jointrig_firmware::supplies::pt1000_c;
use jointrig_protocol::slow::{Slow, Supply};

use crate::adc::Adc;
use crate::channels;

/// Steps of the converter: 14 bits (RM0456, "ADC main features").
const STEPS: f32 = 16_384.0;
/// Reference voltage, V: the board's 3.3 V.
const REFERENCE_V: f32 = 3.3;
/// Divider from a supply's socket to the pin: 100 kΩ and 10 kΩ.
const BIAS_DIVIDER: f32 = 11.0;
/// Divider from the USB's 5 V to the pin: 330 kΩ and 49.9 kΩ on the Nucleo (not checked against its
/// schematic: measure it once).
const VBUS_DIVIDER: f32 = 7.61;
/// Threshold above which the bus has power, V: behind a hub without its own supply a device still
/// gets 4.35 V (USB 2.0, 7.2.2), briefly less; no port supplies as little as about half of that.
const VBUS_VALID_V: f32 = 2.5;
const EVERY_MS: u64 = 100;

/// The pins: analog after a reset, and used only here. PC0 is ADC1_IN1 and so on (the STM32U5A5's
/// data sheet, "Pin description"; the same numbers in embassy-stm32's tables).
pub type Pins = (Peri<'static, PC0>, Peri<'static, PC1>, Peri<'static, PC2>, Peri<'static, PC3>);
/// PC0: the Pt1000.
const THERMOMETER: u8 = 1;
/// PC1: the hammer's force cell.
const FORCE: u8 = 2;
/// PC2: the USB's 5 V.
const VBUS_SENSE: u8 = 3;
/// PC3: the shaker's force cell.
const EXCITATION: u8 = 4;

static MEASURED: AtomicBool = AtomicBool::new(false);
static LATEST: Mutex<RefCell<Option<Slow>>> = Mutex::new(RefCell::new(None));
/// Counts as present until it has been measured.
static VBUS: AtomicBool = AtomicBool::new(true);

/// Slow values, if measured since the last call.
pub fn take() -> Option<Slow> {
    if !MEASURED.swap(false, Ordering::Acquire) {
        return None;
    }
    critical_section::with(|section| LATEST.borrow_ref_mut(section).take())
}

/// Whether the USB's 5 V are present.
pub fn has_vbus() -> bool {
    VBUS.load(Ordering::Relaxed)
}

/// Runs forever.
#[embassy_executor::task]
pub async fn task(adc: Peri<'static, ADC1>, pins: Pins) {
    let mut adc = Adc::new(adc, pins, &[THERMOMETER, FORCE, VBUS_SENSE, EXCITATION]).await;
    loop {
        // fraction of the reference
        let mut part = |input| f32::from(adc.read(input)) / STEPS;
        let mut slow = Slow { temperature_c: pt1000_c(part(THERMOMETER)), ..Slow::default() };
        for (channel, input) in [(channels::FORCE, FORCE), (channels::EXCITATION, EXCITATION)] {
            // capacity for two supplies
            let _ =
                slow.supplies.push(Supply { channel, bias_v: part(input) * (BIAS_DIVIDER * REFERENCE_V) });
        }
        let bus_v = part(VBUS_SENSE) * (VBUS_DIVIDER * REFERENCE_V);
        VBUS.store(bus_v > VBUS_VALID_V, Ordering::Relaxed);
        critical_section::with(|section| *LATEST.borrow_ref_mut(section) = Some(slow));
        MEASURED.store(true, Ordering::Release);
        Timer::after_millis(EVERY_MS).await;
    }
}

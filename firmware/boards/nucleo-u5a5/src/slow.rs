//! Values measured ten times a second by the chip's ADC1: the bias of the two constant-current
//! supplies, the specimen's temperature, and the presence of the USB's 5 V.
//!
//! Circuits and pins: docs/WIRING.md. A conversion takes a few µs and is started by software; only
//! this task waits for it, in thread mode. The converter's registers are accessed directly (RM0456,
//! "Analog-to-digital converter (ADC1 and ADC2)"), in the same order as embassy-stm32's driver,
//! which would take 2 kB of flash here.

use crate::channels;
use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};
use critical_section::Mutex;
use embassy_stm32::pac::adc::vals::{Pcsel, SampleTime};
use embassy_stm32::pac::adccommon::vals::Presc;
use embassy_stm32::pac::{ADC1, ADC12_COMMON, RCC};
use embassy_stm32::peripherals::{PC0, PC1, PC2, PC3};
use embassy_stm32::{Peri, peripherals};
use embassy_time::Timer;
use jointrig_firmware::supplies::pt1000_c;
use jointrig_protocol::slow::{Slow, Supply};

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
pub async fn task(adc: Peri<'static, peripherals::ADC1>, pins: Pins) {
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

/// Start-up time of the regulator, µs: 10 in embassy-stm32; the data sheet's value was not checked,
/// and this is not time-critical.
const REGULATOR_US: u64 = 100;

/// The initialised converter and its pins.
struct Adc<P> {
    _adc: Peri<'static, peripherals::ADC1>,
    _pins: P,
}

impl<P> Adc<P> {
    /// Starts and calibrates the converter for these inputs (numbers of ADC1_IN…, whose pins are
    /// analog after a reset).
    async fn new(adc: Peri<'static, peripherals::ADC1>, pins: P, inputs: &[u8]) -> Self {
        critical_section::with(|_| RCC.ahb2enr1().modify(|w| w.set_adc12en(true)));
        // from the bus's 160 MHz; at most 55 MHz are allowed
        ADC12_COMMON.ccr().modify(|w| w.set_presc(Presc::DIV4));
        ADC1.cr().modify(|w| {
            w.set_deeppwd(false);
            w.set_advregen(true);
        });
        Timer::after_micros(REGULATOR_US).await;
        ADC1.cr().modify(|w| w.set_adcallin(true));
        ADC1.cr().modify(|w| w.set_adcal(true));
        while ADC1.cr().read().adcal() {}
        Timer::after_micros(1).await;
        ADC1.isr().write(|w| w.set_adrdy(true));
        ADC1.cr().modify(|w| w.set_aden(true));
        while !ADC1.isr().read().adrdy() {}
        for input in inputs {
            ADC1.pcsel().modify(|w| w.set_pcsel(usize::from(*input), Pcsel::PRESELECTED));
            // 2 µs to charge the converter's capacitor from the 100 nF at the pin
            ADC1.smpr(0).modify(|w| w.set_smp(usize::from(*input), SampleTime::CYCLES79_5));
        }
        Self { _adc: adc, _pins: pins }
    }

    /// One conversion of 14 bits, about 3 µs.
    #[expect(clippy::unused_self, reason = "only the owner of the converter may start it")]
    fn read(&mut self, input: u8) -> u16 {
        ADC1.sqr1().write(|w| w.set_sq(0, input));
        ADC1.cr().modify(|w| w.set_adstart(true));
        // reading the data register clears the flag
        while !ADC1.isr().read().eoc() {}
        ADC1.dr().read().rdata() as u16
    }
}

//! ADC1 for a few slow values: one software-triggered conversion at a time, with a blocking wait.
//!
//! Accesses the registers directly (RM0456, "Analog-to-digital converter (ADC1 and ADC2)"), in the
//! same order as embassy-stm32's driver, which would take 2 kB of flash here.

use embassy_stm32::Peri;
use embassy_stm32::pac::adc::vals::{Pcsel, SampleTime};
use embassy_stm32::pac::adccommon::vals::Presc;
use embassy_stm32::pac::{ADC1, ADC12_COMMON, RCC};
use embassy_stm32::peripherals;
use embassy_time::Timer;

/// Start-up time of the regulator, µs: 10 in embassy-stm32; the data sheet's value was not checked,
/// and this is not time-critical.
const REGULATOR_US: u64 = 100;

/// The initialised converter and its pins.
pub struct Adc<P> {
    _adc: Peri<'static, peripherals::ADC1>,
    _pins: P,
}

impl<P> Adc<P> {
    /// Starts and calibrates the converter for these inputs (numbers of ADC1_IN…, whose pins are
    /// analog after a reset).
    pub async fn new(adc: Peri<'static, peripherals::ADC1>, pins: P, inputs: &[u8]) -> Self {
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
    pub fn read(&mut self, input: u8) -> u16 {
        ADC1.sqr1().write(|w| w.set_sq(0, input));
        ADC1.cr().modify(|w| w.set_adstart(true));
        // reading the data register clears the flag
        while !ADC1.isr().read().eoc() {}
        ADC1.dr().read().rdata() as u16
    }
}

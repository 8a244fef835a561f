//! Clocks: everything from the 16 MHz crystal, so that scans are timed by it.

use embassy_stm32::Config;
use embassy_stm32::pac;
use embassy_stm32::rcc::{
    Hse, HseMode, LsConfig, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk, VoltageScale, mux,
};
use embassy_stm32::time::Hertz;

/// 160 MHz for core, buses and timers: 16 / 2 × 60 / 3. The USB's PHY takes the crystal as it is,
/// because its own PLL wants 16 MHz and nothing derived from PLL1 has been seen to work.
pub fn config() -> Config {
    let mut config = Config::default();
    config.rcc.hse = Some(Hse { freq: Hertz(16_000_000), mode: HseMode::Oscillator });
    config.rcc.pll1 = Some(Pll {
        source: PllSource::HSE,
        prediv: PllPreDiv::DIV2,
        mul: PllMul::MUL60,
        divp: None,
        divq: Some(PllDiv::DIV10),
        divr: Some(PllDiv::DIV3),
    });
    config.rcc.sys = Sysclk::PLL1_R;
    config.rcc.voltage_range = VoltageScale::RANGE1;
    config.rcc.ls = LsConfig::default_lsi();
    config.rcc.mux.otghssel = mux::Otghssel::HSE;
    config
}

/// Turns on the instruction cache and the flash's prefetch: both are off after a reset (RM0456,
/// "ICACHE control register" and "FLASH access control register"), and at 160 MHz the flash makes
/// the core wait four cycles for each line.
///
/// The chip's number must have been read before: it lies in the flash's read-only area, which the
/// cache must not fetch (RM0456, "ICACHE": accesses to OTP and read-only area through the cache end
/// in a bus error).
pub fn cache() {
    // invalidated by hardware after a reset; turning it on while that lasts only delays it (RM0456,
    // "ICACHE initialization")
    pac::ICACHE.cr().modify(|w| w.set_en(true));
    pac::FLASH.acr().modify(|w| w.set_prften(true));
}

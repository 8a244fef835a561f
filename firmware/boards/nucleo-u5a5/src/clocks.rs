//! Clocks: all derived from the 16 MHz crystal, so that it determines the scan timing; and the
//! counts of the timers that the converters, the coil and the sync input share.

use embassy_stm32::Config;
use embassy_stm32::pac;
use embassy_stm32::rcc::{
    Hse, HseMode, LsConfig, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk, VoltageScale, mux,
};
use embassy_stm32::time::Hertz;

/// Counts of the timers per second.
pub const TIMER_HZ: u32 = 160_000_000;
/// CONVST is low for the first µs of each period and then rises: counts of TIM2.
pub const CONVST_LOW: u32 = TIMER_HZ / 1_000_000;
/// TIM5 receives TIM2's update through a synchroniser of some cycles (RM0456, "Timer
/// synchronization"): counts after which TIM5 is up to date.
pub const SETTLED: u32 = 32;

/// 160 MHz for core, buses and timers: 16 / 2 × 60 / 3. The USB PHY uses the crystal directly,
/// because its own PLL needs 16 MHz and no clock derived from PLL1 has been found to work.
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

/// Enables the instruction cache and the flash prefetch: both are disabled after a reset (RM0456,
/// "ICACHE control register" and "FLASH access control register"), and at 160 MHz the core waits
/// four cycles for each flash line.
///
/// The chip's unique id must be read before this: it is in the flash's read-only area, which must
/// not be accessed through the cache (RM0456, "ICACHE": accesses to the OTP and read-only area
/// through the cache end in a bus error).
pub fn cache() {
    // hardware invalidates the cache after a reset; enabling it during the invalidation only delays
    // it (RM0456, "ICACHE initialization")
    pac::ICACHE.cr().modify(|w| w.set_en(true));
    pac::FLASH.acr().modify(|w| w.set_prften(true));
}

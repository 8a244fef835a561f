//! Clocks: everything from the 16 MHz crystal, so that scans are timed by it.

use embassy_stm32::Config;
use embassy_stm32::rcc::{
    Hse, HseMode, LsConfig, Pll, PllDiv, PllMul, PllPreDiv, PllSource, Sysclk, VoltageScale, mux,
};
use embassy_stm32::time::Hertz;

/// 160 MHz for core, buses and timers: 16 / 2 × 60 / 3. The USB's PHY takes the crystal as it is, because its own
/// PLL wants 16 MHz and nothing derived from PLL1 has been seen to work.
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

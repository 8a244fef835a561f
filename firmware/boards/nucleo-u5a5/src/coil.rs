//! The hammer's coil: TIM1 in one-pulse mode, started by the scans' own timer.
//!
//! A pulse is one period of the counter, which stops by itself at its end. The counter has 16 bits
//! and runs at 8 MHz, so that no period it can be told is longer than 8.2 ms: that is the cap,
//! whatever software does. The break input (guard and emergency stop in series, low when either is
//! open or the wire is broken) takes the output away at once and without software, and it stays
//! away until the next order. The settings of the break and of the pin's idle level are locked
//! until the next reset. Behind all of it the coil driver has a one-shot of its own
//! (docs/WIRING.md).
//!
//! TIM2's update, which begins a scan's period, starts the counter (slave mode "trigger"); the
//! output rises when it has counted 1 µs, with CONVST's edge. The trigger comes with every scan, so
//! it must be heard once only: an order holds interrupts off until the next update (19.5 µs at
//! most), sees the counter run, and stops listening. Should the core die between the two, pulses
//! would follow each other: the driver's second one-shot allows none within half a second.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull};
use embassy_stm32::pac;
use embassy_stm32::pac::timer::vals::{Bkp, FilterValue, Lock, Ossi, Urs};
use embassy_stm32::peripherals::{PE9, PE15, TIM1};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::{
    CountingMode, OutputCompareMode, OutputPolarity, SlaveMode, Timer, TriggerSource,
};
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::timer::{Ch1, Channel};
use jointrig_firmware::board::Coil;
use jointrig_protocol::limits::COIL_PULSE_CAP_US;

use crate::scans::{CONVST_LOW, TIMER_HZ};

/// Counts per µs.
const COUNTS_PER_US: u32 = 8;
/// Counts from the update to CONVST's edge.
const BEFORE_EDGE: u32 = CONVST_LOW * COUNTS_PER_US / (TIMER_HZ / 1_000_000);
const _: () = assert!(BEFORE_EDGE >= 1, "at 0 the output must be low");
const _: () = assert!(
    BEFORE_EDGE - 1 + COIL_PULSE_CAP_US * COUNTS_PER_US <= u16::MAX as u32,
    "the counter's width is the cap"
);
/// TIM1_BKIN on PE15.
const BREAK_FUNCTION: u8 = 1;

/// Whoever saw danger has taken the output away; only [`Coil::off`] lets a pulse begin again. An
/// order that was on its way at that moment comes to nothing.
static VETOED: AtomicBool = AtomicBool::new(false);

/// Takes the output away from whatever runs. For a task above acquisition, which may be stuck.
pub fn veto() {
    critical_section::with(|_| {
        VETOED.store(true, Ordering::Relaxed);
        pac::TIM1.bdtr().modify(|w| w.set_moe(false));
    });
}

/// The timer that makes the pulse.
pub struct PulseTimer {
    timer: Timer<'static, TIM1>,
    _output: PwmPin<'static, TIM1, Ch1>,
    _break_input: Flex<'static>,
}

impl PulseTimer {
    /// Output off, break on.
    pub fn new(
        timer: Peri<'static, TIM1>,
        output: Peri<'static, PE9>,
        break_input: Peri<'static, PE15>,
    ) -> Self {
        let output = PwmPin::new(output, OutputType::PushPull);
        let mut break_input = Flex::new(break_input);
        // pulled down: an open wire is a break
        break_input.set_as_af_unchecked(BREAK_FUNCTION, AfType::input(Pull::Down));

        let mut timer = Timer::new(timer);
        timer.set_tick_freq(Hertz(COUNTS_PER_US * 1_000_000));
        timer.set_counting_mode(CountingMode::EdgeAlignedUp);
        timer.set_autoreload_preload(false);
        timer.regs_core().cr1().modify(|w| {
            w.set_opm(true);
            w.set_urs(Urs::COUNTER_ONLY);
        });
        // RM0456, "TIM1 internal trigger connection": ITR1 is TIM2's TRGO
        timer.set_trigger_source(TriggerSource::ITR1);
        // low from 0 to CONVST's edge, high to the end of the period, low again when the counter
        // has stopped at 0
        timer.set_output_compare_mode(Channel::Ch1, OutputCompareMode::PwmMode2);
        timer.set_output_compare_preload(Channel::Ch1, false);
        timer.set_output_polarity(Channel::Ch1, OutputPolarity::ActiveHigh);
        timer.set_compare_value(Channel::Ch1, BEFORE_EDGE as u16);
        timer.set_max_compare_value(1);
        // a core that has locked up breaks the pulse too, until the next reset (RM0456, "SYSCFG
        // configuration register 2", CLL)
        pac::SYSCFG.cfgr2().modify(|w| w.set_cll(true));
        timer.set_break_polarity(Bkp::ACTIVE_LOW);
        timer.set_break_filter(FilterValue::FDTS_DIV8_N6);
        timer.set_break_input_pin_enable(true);
        timer.set_break_enable(true);
        timer.set_automatic_output_enable(false);
        // without permission the pin is driven low, not left floating
        timer.set_ossi(Ossi::IDLE_LEVEL);
        timer.enable_channel(Channel::Ch1, true);
        timer.regs_1ch_cmp().bdtr().modify(|w| w.set_lock(Lock::LEVEL2));
        Self { timer, _output: output, _break_input: break_input }
    }

    fn runs(&self) -> bool {
        self.timer.regs_core().cr1().read().cen()
    }

    /// Lets the next update of TIM2 start the counter, and no other. False when none came within
    /// two periods.
    fn start_with_next_scan(&self) -> bool {
        let scans = || pac::TIM5.cnt().read();
        self.timer.set_slave_mode(SlaveMode::TRIGGER_MODE);
        let before = scans();
        while !self.runs() && scans().wrapping_sub(before) < 2 {}
        self.timer.set_slave_mode(SlaveMode::DISABLED);
        self.runs()
    }
}

impl Coil for PulseTimer {
    fn cap_us(&self) -> u32 {
        COIL_PULSE_CAP_US
    }

    fn pulse(&mut self, width_us: u32) {
        if self.runs() {
            // the pulse before this one has not ended: it will, and this one is not for adding to
            // it
            return;
        }
        let counts = width_us.clamp(1, COIL_PULSE_CAP_US) * COUNTS_PER_US;
        self.timer.set_max_compare_value((BEFORE_EDGE - 1 + counts) as u16);
        self.timer.generate_update_event();
        critical_section::with(|_| {
            if VETOED.load(Ordering::Relaxed) {
                return;
            }
            // a break that is over is forgotten, one that lasts keeps the output away
            self.timer.regs_1ch_cmp().sr().modify(|w| w.set_bif(0, false));
            self.timer.set_moe(true);
            if self.timer.get_moe() && !self.start_with_next_scan() {
                self.timer.set_moe(false);
            }
        });
    }

    fn off(&mut self) {
        critical_section::with(|_| {
            self.timer.set_moe(false);
            self.timer.stop();
            self.timer.reset();
            VETOED.store(false, Ordering::Relaxed);
        });
    }
}

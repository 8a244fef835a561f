//! The hammer's coil: TIM1 in one-pulse mode, started by the scan timer.
//!
//! A pulse is one period of the counter, which stops by itself at its end. The counter has 16 bits
//! and runs at 8 MHz, so that no period can be longer than 8.2 ms: this is the cap, whatever the
//! software does. The break input (guard and emergency stop in series, low when either is open or
//! the wire is broken) disables the output immediately and without software, and it stays disabled
//! until the next order. The settings of the break and of the pin's idle level are locked until the
//! next reset. In addition, the coil driver has its own one-shot (docs/WIRING.md).
//!
//! TIM2's update, which begins a scan's period, starts the counter (slave mode "trigger"); the
//! output rises after 1 µs, on CONVST's edge. The trigger occurs with every scan, so it must take
//! effect only once: an order disables interrupts until the next update (at most 19.5 µs), confirms
//! that the counter runs, and disables the trigger. If the core failed in between, pulses would
//! repeat; the driver's second one-shot then allows none within half a second.

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

use crate::clocks::{CONVST_LOW, TIMER_HZ};

/// Counts per µs.
const COUNTS_PER_US: u32 = 8;
/// Counts from the update to CONVST's edge.
const BEFORE_EDGE: u32 = CONVST_LOW * COUNTS_PER_US / (TIMER_HZ / 1_000_000);
const _: () = assert!(BEFORE_EDGE >= 1, "at 0 the output must be low");
const _: () = assert!(
    BEFORE_EDGE - 1 + COIL_PULSE_CAP_US * COUNTS_PER_US <= u16::MAX as u32,
    "the counter's width is the cap"
);
/// Alternate function of TIM1_BKIN on PE15.
const BREAK_FUNCTION: u8 = 1;

/// Set by code that detected danger and disabled the output; only [`Coil::off`] allows pulses
/// again. An order that was being processed at that moment has no effect.
static VETOED: AtomicBool = AtomicBool::new(false);

/// Disables the output, whatever else is running. For a task with a higher priority than
/// acquisition, which may be stuck.
pub fn veto() {
    critical_section::with(|_| {
        VETOED.store(true, Ordering::Relaxed);
        pac::TIM1.bdtr().modify(|w| w.set_moe(false));
    });
}

/// The timer that generates the pulse.
pub struct PulseTimer {
    timer: Timer<'static, TIM1>,
    _output: PwmPin<'static, TIM1, Ch1>,
    _break_input: Flex<'static>,
}

impl PulseTimer {
    /// Initialises with the output off and the break enabled.
    pub fn new(
        timer: Peri<'static, TIM1>,
        output: Peri<'static, PE9>,
        break_input: Peri<'static, PE15>,
    ) -> Self {
        let output = PwmPin::new(output, OutputType::PushPull);
        let mut break_input = Flex::new(break_input);
        // pulled down: an open wire triggers the break
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
        // a core lock-up also triggers the break, until the next reset (RM0456, "SYSCFG
        // configuration register 2", CLL)
        pac::SYSCFG.cfgr2().modify(|w| w.set_cll(true));
        timer.set_break_polarity(Bkp::ACTIVE_LOW);
        timer.set_break_filter(FilterValue::FDTS_DIV8_N6);
        timer.set_break_input_pin_enable(true);
        timer.set_break_enable(true);
        timer.set_automatic_output_enable(false);
        // while the output is disabled, the pin is driven low instead of floating
        timer.set_ossi(Ossi::IDLE_LEVEL);
        timer.enable_channel(Channel::Ch1, true);
        timer.regs_1ch_cmp().bdtr().modify(|w| w.set_lock(Lock::LEVEL2));
        Self { timer, _output: output, _break_input: break_input }
    }

    fn runs(&self) -> bool {
        self.timer.regs_core().cr1().read().cen()
    }

    /// Lets only the next update of TIM2 start the counter. Returns false when none occurred within
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
            // the previous pulse has not ended; it will end as set, and this order must not extend
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
            // a past break is cleared; an active one keeps the output disabled
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

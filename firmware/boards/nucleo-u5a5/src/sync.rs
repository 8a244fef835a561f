//! Sync input, sync output and clock input, with TIM3.
//!
//! TIM3 counts the board's 160 MHz and never stops. Its channel 1 captures the count at each edge
//! of the external clock and triggers TIM2, whose period restarts with it; channel 3 captures the
//! edges of the sync input. It uses no interrupt and no DMA: acquisition reads it once per block,
//! so that signals at these pins, however fast, take no processing time.
//!
//! With the external clock, TIM2's own period is longer by [`FLYWHEEL`]: if an edge is missing,
//! TIM2 continues by itself, late, so that no converter, drive or coil ever waits for a pin. The
//! delay is visible in the counts of a block's scans.

use core::mem::forget;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, Level, Output, Pull, Speed};
use embassy_stm32::pac::timer::vals::{CcmrInputCcs, Mms, Sms, Ts};
use embassy_stm32::pac::{TIM2, TIM3, TIM5};
use embassy_stm32::peripherals;
use embassy_stm32::timer::low_level::Timer;
use jointrig_firmware::board::Seen;
use jointrig_firmware::ruler::{Ago, Ruler, Span};
use jointrig_protocol::sync::{Clock, ClockFault};

use crate::SCAN_RATE_HZ;
use crate::clocks::{CONVST_LOW, SETTLED, TIMER_HZ};

/// Counts per scan.
pub const PERIOD: u32 = TIMER_HZ / SCAN_RATE_HZ;
/// Counts by which a scan is longer if its edge of the external clock is missing: one per cent.
const FLYWHEEL: u32 = PERIOD / 100;
const RULER: Ruler = Ruler { period: PERIOD, taken_at: CONVST_LOW };
/// Alternate function of TIM3_CH1 on PC6 and TIM3_CH3 on PC8 (the data sheet's "Alternate
/// functions"; the same number in embassy-stm32's tables).
const TIM3_FUNCTION: u8 = 2;
/// Indices of the two channels in TIM3's registers.
const CLOCK: usize = 0;
const INPUT: usize = 2;

/// The two inputs and the output.
pub struct Port {
    output: Output<'static>,
    raised: bool,
    external: bool,
    /// Period and TIM3's count at the last reading of a monitored clock.
    looked: Option<(u32, u32)>,
}

impl Port {
    /// Initialises: inputs enabled, output low, scans timed by the board's own clock.
    pub fn new(
        timer: Peri<'static, peripherals::TIM3>,
        clock: Peri<'static, peripherals::PC6>,
        input: Peri<'static, peripherals::PC8>,
        output: Peri<'static, peripherals::PD15>,
    ) -> Self {
        for mut pin in [Flex::new(clock), Flex::new(input)] {
            // pulled down: an open cable gives no edge
            pin.set_as_af_unchecked(TIM3_FUNCTION, AfType::input(Pull::Down));
            forget(pin);
        }
        let timer = Timer::new(timer);
        timer.set_max_compare_value(u32::MAX);
        for channel in [CLOCK, INPUT] {
            // their own inputs, rising edges, no filter
            TIM3.ccmr_input(channel / 2).modify(|w| w.set_ccs(channel % 2, CcmrInputCcs::TI4));
            TIM3.ccer().modify(|w| w.set_cce(channel, true));
        }
        // each capture of channel 1 is a trigger (RM0456, "TIMx control register 2", MMS: compare
        // pulse)
        TIM3.cr2().modify(|w| w.set_mms(Mms::COMPARE_PULSE));
        timer.start();
        forget(timer);
        // a new period length takes effect with the next period: TIM2's count must never be beyond
        // its end
        TIM2.cr1().modify(|w| w.set_arpe(true));
        Self {
            output: Output::new(output, Level::Low, Speed::Medium),
            raised: false,
            external: false,
            looked: None,
        }
    }

    /// Events since the last reading; `next` is the period of the next scan to be delivered.
    pub fn seen(&mut self, next: u32) -> Option<Seen> {
        if core::mem::take(&mut self.raised) {
            self.output.set_low();
        }
        let status = TIM3.sr().read();
        let (caught, lost) = (status.ccif(INPUT), status.ccof(INPUT));
        if !(caught | lost | self.external) {
            return None;
        }
        let (now, phase, count) = look();
        let mut seen = Seen { lost: u32::from(lost), ..Seen::default() };
        if lost {
            // flags are cleared by writing 0; this clears no other
            let mut others = embassy_stm32::pac::timer::regs::SrGp16(u32::MAX);
            others.set_ccof(INPUT, false);
            TIM3.sr().write_value(others);
        }
        if caught {
            // reading the count clears its flag
            let since = count.wrapping_sub(TIM3.ccr(INPUT).read());
            seen.edge = Some(RULER.place(now, phase, since, next));
        }
        if self.external {
            let begun = count.wrapping_sub(phase);
            if let Some((before, at)) = self.looked.replace((now, begun)) {
                let (scans, counts) = (now.wrapping_sub(before), begun.wrapping_sub(at));
                seen.span = Some(Span { scans, counts });
            }
        }
        Some(seen)
    }

    /// See [`jointrig_firmware::board::Scans::clock`].
    pub fn clock(&mut self, clock: Clock) -> Result<(), ClockFault> {
        let external = clock != Clock::Internal;
        if external {
            let period = period().ok_or(ClockFault::Absent)?;
            if period.abs_diff(PERIOD) > FLYWHEEL / 2 {
                return Err(ClockFault::Rate);
            }
        }
        (self.external, self.looked) = (external, None);
        TIM2.arr().write_value(PERIOD - 1 + if external { FLYWHEEL } else { 0 });
        TIM2.smcr().modify(|w| {
            // TIM3's TRGO (RM0456, "TIM2 internal trigger connection")
            w.set_ts(Ts::ITR2);
            w.set_sms(if external { Sms::RESET_MODE } else { Sms::DISABLED });
        });
        Ok(())
    }

    /// Raises the output until the next reading, and returns the instant.
    pub fn mark(&mut self, next: u32) -> Ago {
        let (now, phase, _) = critical_section::with(|_| {
            self.output.set_high();
            look()
        });
        self.raised = true;
        RULER.place(now, phase, 0, next)
    }
}

/// Count of periods and the counts of TIM2 and TIM3 at one moment; the last two are read about ten
/// cycles apart, 0.003 of a scan.
fn look() -> (u32, u32, u32) {
    loop {
        let now = TIM5.cnt().read();
        let (phase, count) = critical_section::with(|_| (TIM2.cnt().read(), TIM3.cnt().read()));
        if phase >= SETTLED && TIM5.cnt().read() == now {
            return (now, phase, count);
        }
    }
}

/// Counts between two edges of the external clock, measured for at most four scans with interrupts
/// disabled; nothing depends on these scans yet.
fn period() -> Option<u32> {
    critical_section::with(|_| {
        // discard an earlier capture
        TIM3.ccr(CLOCK).read();
        let begun = TIM3.cnt().read();
        let mut first = None;
        while TIM3.cnt().read().wrapping_sub(begun) < 4 * PERIOD {
            if TIM3.sr().read().ccif(CLOCK) {
                let at = TIM3.ccr(CLOCK).read();
                if let Some(before) = first.replace(at) {
                    return Some(at.wrapping_sub(before));
                }
            }
        }
        None
    })
}

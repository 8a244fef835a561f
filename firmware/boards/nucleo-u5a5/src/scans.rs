//! The board's scans: CONVST from TIM2, counted by TIM5; sixteen channels out of two rings.
//!
//! Whatever goes wrong, the count of CONVST goes on, so that the next block says exactly how many scans are missing
//! before it. The remedy depends on what went wrong: rings that lost step are emptied and joined anew; converters
//! that fell silent are reset, set up and tested again, over and over, with a report each time the trouble changes.

use core::fmt;
use core::mem::forget;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Level, Output, OutputType, Speed};
use embassy_stm32::pac::TIM5;
use embassy_stm32::peripherals;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::{
    CountingMode, MasterMode, OutputCompareMode, RoundTo, SlaveMode, Timer as Counter, TriggerSource,
};
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::timer::{Ch1, Channel};
use embassy_time::{Duration, Timer, with_timeout};
use jointrig_firmware::ad7606b::pair::{PAIR_BYTES, Slip, join};
use jointrig_firmware::ad7606b::trouble::Trouble;
use jointrig_firmware::board::{Delivered, Scans};
use jointrig_protocol::limits::BLOCK_SAMPLE_BYTES;

use crate::chips::{self, Chips};
use crate::lights::{FAULT, SCANNING};
use crate::rings::{self, FIRST, SECOND};
use crate::{BLOCK_SCANS, SCAN_RATE_HZ, Shared, watchdog};
use core::sync::atomic::Ordering;

/// Counts of the timers per second.
pub const TIMER_HZ: u32 = 160_000_000;
/// CONVST is low for the first µs of each period and rises then: counts of TIM2.
pub const CONVST_LOW: u32 = TIMER_HZ / 1_000_000;
/// A block takes 0.29 ms; this long without one is silence.
const PATIENCE: Duration = Duration::from_millis(5);
/// Between two tries to set silent converters up.
const RETRY: Duration = Duration::from_millis(20);

/// What went wrong with the converters.
#[derive(Debug, PartialEq)]
enum Fault {
    /// Which converter, and why it cannot be set up.
    SetUp(u8, chips::Fault),
    /// While they ran.
    Running(Trouble),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::SetUp(number, fault) => write!(f, "converter {number}: {fault}"),
            Self::Running(trouble) => trouble.fmt(f),
        }
    }
}

impl From<Trouble> for Fault {
    fn from(trouble: Trouble) -> Self {
        Self::Running(trouble)
    }
}

/// What must be done before blocks can come.
#[derive(Clone, Copy, PartialEq)]
enum Next {
    SetUp,
    Join,
    Read,
}

/// Both converters.
pub struct Converters {
    core: &'static Shared,
    chips: Chips,
    convst: Counter<'static, peripherals::TIM2>,
    convst_pin: Peri<'static, peripherals::PA0>,
    _edges: Counter<'static, peripherals::TIM5>,
    next: Next,
    /// The block that is due.
    block: u32,
    /// TIM5's count at the start of the rings.
    started_at: u32,
    /// Up to where scans have been delivered or reported missing, in TIM5's count.
    accounted: u32,
    slips: [Slip; 2],
    last_report: Option<Fault>,
}

impl Converters {
    /// Both timers run from now on; the converters are set up when the first block is asked for.
    pub fn new(
        core: &'static Shared,
        chips: Chips,
        convst: Peri<'static, peripherals::TIM2>,
        edges: Peri<'static, peripherals::TIM5>,
        convst_pin: Peri<'static, peripherals::PA0>,
    ) -> Self {
        let edges = Counter::new(edges);
        // counts TIM2's updates: RM0456, "TIM5 internal trigger connection", ITR1 is TIM2's TRGO
        edges.set_trigger_source(TriggerSource::ITR1);
        edges.set_slave_mode(SlaveMode::EXT_CLOCK_MODE);
        edges.set_max_compare_value(u32::MAX);
        edges.start();

        let convst = Counter::new(convst);
        convst.set_counting_mode(CountingMode::EdgeAlignedUp);
        convst.set_frequency(Hertz(SCAN_RATE_HZ), RoundTo::Faster);
        convst.set_output_compare_mode(Channel::Ch1, OutputCompareMode::PwmMode2);
        convst.set_compare_value(Channel::Ch1, CONVST_LOW);
        convst.set_master_mode(MasterMode::UPDATE);
        convst.start();
        rings::enable_interrupts();
        Self {
            core,
            chips,
            convst,
            convst_pin,
            _edges: edges,
            next: Next::SetUp,
            block: 0,
            started_at: 0,
            accounted: TIM5.cnt().read(),
            slips: [Slip::default(); 2],
            last_report: None,
        }
    }

    /// Resets, sets up and tests both, with CONVST as an ordinary pin.
    async fn set_up(&mut self) -> Result<(), Fault> {
        FIRST.stop();
        SECOND.stop();
        self.convst.enable_channel(Channel::Ch1, false);
        let mut convst = Output::new(self.convst_pin.reborrow(), Level::High, Speed::High);
        self.chips.first.set_up(&mut convst).await.map_err(|fault| Fault::SetUp(1, fault))?;
        self.chips.second.set_up(&mut convst).await.map_err(|fault| Fault::SetUp(2, fault))?;
        Ok(())
    }

    /// Starts the rings so that their first scan is the one of the very next period.
    async fn join(&mut self) {
        self.convst.enable_channel(Channel::Ch1, false);
        forget(PwmPin::<'_, peripherals::TIM2, Ch1>::new(self.convst_pin.reborrow(), OutputType::PushPull));
        // a conversion that is under way ends, and is read by nobody
        Timer::after_micros(100).await;
        self.chips.first.ready_for_ring();
        self.chips.second.ready_for_ring();
        FIRST.start(self.chips.first.request());
        SECOND.start(self.chips.second.request());
        self.block = 0;
        self.slips = [Slip::default(); 2];
        self.started_at = critical_section::with(|_| {
            // wait for the end of a period (20 µs at most): there is a µs between its end and CONVST's edge
            let before = TIM5.cnt().read();
            while TIM5.cnt().read() == before {}
            self.convst.enable_channel(Channel::Ch1, true);
            before.wrapping_add(1)
        });
        self.next = Next::Read;
    }

    /// The block that is due, as far as it is good.
    async fn read(&mut self, block: &mut [u8; BLOCK_SAMPLE_BYTES]) -> Result<Delivered, Trouble> {
        if with_timeout(PATIENCE, rings::arrived(self.block)).await.is_err() {
            return Err(Trouble::Silent(FIRST.progress().0, SECOND.progress().0));
        }
        if FIRST.has_failed() || SECOND.has_failed() {
            return Err(Trouble::Dma);
        }
        for (ring, slip) in [&FIRST, &SECOND].into_iter().zip(&mut self.slips) {
            let (blocks, edges) = ring.progress();
            // the period of the last scan has begun when its block is complete: its edge is counted
            let read = blocks.wrapping_mul(BLOCK_SCANS as u32);
            let begun = edges.wrapping_sub(self.started_at).wrapping_add(1);
            match slip.block(begun, read) {
                0 => {}
                missing => return Err(Trouble::Slipped(missing)),
            }
        }
        let (Some(first), Some(second)) = (FIRST.read(self.block), SECOND.read(self.block)) else {
            return Err(Trouble::Overrun);
        };
        let joined = join(&first, &second, block.as_chunks_mut::<PAIR_BYTES>().0);
        let from = self.started_at.wrapping_add(self.block.wrapping_mul(BLOCK_SCANS as u32));
        let missed = from.wrapping_sub(self.accounted);
        self.accounted = from.wrapping_add(joined.scans as u32);
        self.block = self.block.wrapping_add(1);
        if joined.crc_wrong {
            self.report(Trouble::Crc.into());
        } else {
            SCANNING.store(true, Ordering::Relaxed);
            FAULT.store(false, Ordering::Relaxed);
        }
        Ok(Delivered { scans: joined.scans as u8, missed })
    }

    /// Remembers the remedy and reports the fault, unless it is the one reported last.
    fn report(&mut self, fault: Fault) {
        SCANNING.store(false, Ordering::Relaxed);
        FAULT.store(true, Ordering::Relaxed);
        self.next = match fault {
            Fault::SetUp(..) | Fault::Running(Trouble::Silent(..) | Trouble::Dma) => Next::SetUp,
            Fault::Running(Trouble::Crc | Trouble::Slipped(_) | Trouble::Overrun) => Next::Join,
        };
        if self.last_report.as_ref() != Some(&fault) {
            self.core.report_fault(&fault);
            self.last_report = Some(fault);
        }
    }

    /// Nothing to deliver; what has gone by since the last delivery is missing.
    fn nothing(&mut self) -> Delivered {
        let now = TIM5.cnt().read();
        let missed = now.wrapping_sub(self.accounted);
        self.accounted = now;
        Delivered { scans: 0, missed }
    }
}

impl Scans for Converters {
    async fn next(&mut self, block: &mut [u8; BLOCK_SAMPLE_BYTES]) -> Delivered {
        watchdog::ACQUISITION.beat();
        if self.next == Next::SetUp {
            match self.set_up().await {
                Ok(()) => self.next = Next::Join,
                Err(fault) => {
                    self.report(fault);
                    Timer::after(RETRY).await;
                    return self.nothing();
                }
            }
        }
        if self.next == Next::Join {
            self.join().await;
        }
        match self.read(block).await {
            Ok(delivered) => delivered,
            Err(trouble) => {
                self.report(trouble.into());
                self.nothing()
            }
        }
    }
}

//! The board's scans: CONVST from TIM2, counted by TIM5; sixteen channels from two rings.
//!
//! After any fault the count of CONVST continues, so that the next block states exactly how many
//! scans are missing before it. The recovery depends on the fault: rings that lost alignment are
//! emptied and restarted together; converters that fell silent are reset, configured and tested
//! again, repeatedly, with a report each time the fault changes.

use core::mem::forget;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Level, Output, OutputType, Speed};
use embassy_stm32::pac::{TIM2, TIM5};
use embassy_stm32::peripherals;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::{
    CountingMode, MasterMode, OutputCompareMode, RoundTo, SlaveMode, Timer as Counter, TriggerSource,
};
use embassy_stm32::timer::simple_pwm::PwmPin;
use embassy_stm32::timer::{Ch1, Channel};
use embassy_time::{Duration, Timer, with_timeout};
use jointrig_firmware::ad7606b::part::AD7606B;
use jointrig_firmware::ad7606b::reader::{Alignment, Clock, Moment, Reader, Trouble};
use jointrig_firmware::board::{Delivered, Scans, Seen};
use jointrig_firmware::ruler::Ago;
use jointrig_firmware::sentence::{Sentence, Tell};
use jointrig_protocol::limits::{BLOCK_SAMPLE_BYTES, MAX_CHANNELS};
use jointrig_protocol::sync::{self as protocol, ClockFault};

use crate::chips::{self, Chips, SETTINGS};
use crate::clocks::{CONVST_LOW, SETTLED, TIMER_HZ};
use crate::lights::{FAULT, SCANNING};
use crate::rings::{self, BLOCKS, FIRST, SECOND};
use crate::{BLOCK_SCANS, SCAN_RATE_HZ, Shared, restart, sync, watchdog};
use core::sync::atomic::Ordering;

/// A block takes 0.29 ms; without one for this long, the converters count as silent.
const PATIENCE: Duration = Duration::from_millis(5);
/// Time between two attempts to set up silent converters.
const RETRY: Duration = Duration::from_millis(20);

/// A fault of the converters.
#[derive(Debug, PartialEq)]
enum Fault {
    /// Number of the converter, and why it cannot be set up.
    SetUp(u8, chips::Fault),
    /// A fault during acquisition.
    Running(Trouble),
}

impl Tell for Fault {
    fn tell(&self, to: &mut Sentence) {
        match self {
            Self::SetUp(number, fault) => {
                fault.tell(to.text("converter ").number((*number).into()).text(": "));
            }
            Self::Running(trouble) => trouble.tell(to),
        }
    }
}

impl From<Trouble> for Fault {
    fn from(trouble: Trouble) -> Self {
        Self::Running(trouble)
    }
}

/// The next step before blocks can arrive.
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
    reader: Reader,
    sync: sync::Port,
    last_report: Option<Fault>,
}

impl Converters {
    /// Starts both timers; the converters are set up when the first block is requested.
    pub fn new(
        core: &'static Shared,
        chips: Chips,
        convst: Peri<'static, peripherals::TIM2>,
        edges: Peri<'static, peripherals::TIM5>,
        convst_pin: Peri<'static, peripherals::PA0>,
        sync: impl FnOnce() -> sync::Port,
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
        let sync = sync();
        rings::enable_interrupts();
        Self {
            core,
            chips,
            convst,
            convst_pin,
            _edges: edges,
            next: Next::SetUp,
            reader: Reader::new(alignment(), MAX_CHANNELS, TIM5.cnt().read()),
            sync,
            last_report: None,
        }
    }

    /// Resets, configures and tests both converters, with CONVST as an ordinary output pin.
    async fn set_up(&mut self) -> Result<(), Fault> {
        FIRST.stop();
        SECOND.stop();
        self.convst.enable_channel(Channel::Ch1, false);
        let mut convst = Output::new(self.convst_pin.reborrow(), Level::High, Speed::High);
        self.chips.first.set_up(&mut convst).await.map_err(|fault| Fault::SetUp(1, fault))?;
        self.chips.second.set_up(&mut convst).await.map_err(|fault| Fault::SetUp(2, fault))?;
        Ok(())
    }

    /// Starts the rings so that their first scan is that of the next period.
    async fn join(&mut self) {
        self.convst.enable_channel(Channel::Ch1, false);
        forget(PwmPin::<'_, peripherals::TIM2, Ch1>::new(self.convst_pin.reborrow(), OutputType::PushPull));
        // a conversion in progress ends and is not read
        Timer::after_micros(100).await;
        self.chips.first.ready_for_ring();
        self.chips.second.ready_for_ring();
        FIRST.start(self.chips.first.request());
        SECOND.start(self.chips.second.request());
        self.reader.start(critical_section::with(|_| {
            // wait for the end of a period (at most 20 µs): CONVST's edge follows 1 µs later
            let before = TIM5.cnt().read();
            while TIM5.cnt().read() == before {}
            self.convst.enable_channel(Channel::Ch1, true);
            before.wrapping_add(1)
        }));
        self.next = Next::Read;
    }

    /// Reads the next block, as far as it is good.
    async fn read(&mut self, block: &mut [u8; BLOCK_SAMPLE_BYTES]) -> Result<Delivered, Trouble> {
        let due = self.reader.due();
        if with_timeout(PATIENCE, rings::arrived(due)).await.is_err() {
            return Err(Trouble::Silent(FIRST.progress(), SECOND.progress()));
        }
        if FIRST.has_failed() || SECOND.has_failed() || !restart::works(0) || !restart::works(1) {
            return Err(Trouble::Dma);
        }
        let (delivered, trouble) = self.reader.take([&FIRST.block(due), &SECOND.block(due)], look, block)?;
        if let Some(trouble) = trouble {
            self.report(trouble.into());
        } else {
            SCANNING.store(true, Ordering::Relaxed);
            FAULT.store(false, Ordering::Relaxed);
        }
        Ok(delivered)
    }

    /// Selects the recovery, and reports the fault unless it equals the last report.
    fn report(&mut self, fault: Fault) {
        SCANNING.store(false, Ordering::Relaxed);
        FAULT.store(true, Ordering::Relaxed);
        self.next = match fault {
            Fault::SetUp(..) | Fault::Running(Trouble::Silent(..) | Trouble::Dma) => Next::SetUp,
            Fault::Running(Trouble::Crc | Trouble::Slipped(..) | Trouble::Overrun) => Next::Join,
        };
        if self.last_report.as_ref() != Some(&fault) {
            self.core.report_fault(&fault);
            self.last_report = Some(fault);
        }
    }
}

/// Timing of the read-out within a period, in counts of TIM2, and the dimensions of the rings.
fn alignment() -> Alignment {
    let from_edge = |ns: u32| CONVST_LOW + ns * (TIMER_HZ / 1_000_000) / 1_000;
    let clock = Clock {
        settled: SETTLED,
        // no averaging ends before half of its longest time
        read_from: from_edge(AD7606B.conversion_us(SETTINGS.oversampling) * 500),
        // the longest averaging, 144 bits of 25 ns, two idle clocks before and after, and 1 µs for
        // trigger and DMA
        read_by: from_edge(AD7606B.conversion_us(SETTINGS.oversampling) * 1_000 + 148 * 25 + 1_000),
    };
    Alignment { clock, block_scans: BLOCK_SCANS as u32, blocks: BLOCKS }
}

/// Present state of clock and rings. If the count of periods is the same before and after the other
/// reads, all values belong to one period.
fn look() -> Moment {
    loop {
        let periods = TIM5.cnt().read();
        let phase = TIM2.cnt().read();
        let words = [FIRST.position(), SECOND.position()];
        if TIM5.cnt().read() == periods {
            return Moment { periods, phase, words };
        }
    }
}

impl Scans for Converters {
    const PERIOD: u32 = sync::PERIOD;

    fn seen(&mut self) -> Option<Seen> {
        self.sync.seen(self.reader.next_period())
    }

    fn clock(&mut self, clock: protocol::Clock) -> Result<(), ClockFault> {
        self.sync.clock(clock)
    }

    fn mark(&mut self) -> Option<Ago> {
        Some(self.sync.mark(self.reader.next_period()))
    }

    async fn next(&mut self, block: &mut [u8; BLOCK_SAMPLE_BYTES]) -> Delivered {
        watchdog::ACQUISITION.beat();
        if self.next == Next::SetUp {
            match self.set_up().await {
                Ok(()) => self.next = Next::Join,
                Err(fault) => {
                    self.report(fault);
                    Timer::after(RETRY).await;
                    return self.reader.nothing(TIM5.cnt().read());
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
                self.reader.nothing(TIM5.cnt().read())
            }
        }
    }
}

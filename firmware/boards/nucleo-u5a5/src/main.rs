//! The rig's controller: a NUCLEO-U5A5ZJ-Q with two AD7606B, the hammer's coil and a high-speed USB
//! port.
//!
//! This crate contains only the wiring; the instrument's logic is in `jointrig-firmware`. Pins:
//! docs/WIRING.md. Functions not yet verified on a real board: docs/first-light.md.
//!
//! Timing does not depend on software:
//!
//! | function | implementation |
//! |---|---|
//! | sampling instants | TIM2 drives CONVST of both converters |
//! | counting them | TIM5 counts TIM2's periods, so that missing scans are detected |
//! | reading 16 channels | the end of BUSY starts SPI1 and SPI2, GPDMA writes rings ([`rings`]) |
//! | preparing SPI1 and SPI2 for it | TIM2 makes GPDMA switch them off and on ([`restart`]) |
//! | start of a coil pulse | TIM2 starts TIM1 ([`coil`]) |
//! | its end | TIM1 in one-pulse mode; its longest period is the cap |
//! | the shaker's codes | TIM2 requests each; DMA supplies them, followed by rest ([`drive`]) |
//! | external clock, edges at the sync input | TIM3 ([`sync`]) |
//! | guard and emergency stop | TIM1's break input, and the coil driver's own gate |
//! | a program that hangs | the independent watchdog ([`watchdog`]) |
//!
//! There are three executors. In order of decreasing priority they run guard and emergency stop
//! ([`guard`]), acquisition, and, in thread mode, USB, watch and lights.
#![no_std]
#![no_main]

mod channels;
mod chips;
mod clocks;
mod coil;
mod dma;
mod drive;
mod guard;
mod keep;
mod lights;
mod probe;
mod restart;
mod rings;
mod scans;
mod slow;
mod sync;
mod usb;
mod watchdog;

use embassy_executor::{InterruptExecutor, Spawner};
use embassy_stm32::interrupt::{self, InterruptExt, Priority};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use jointrig_copy as _;
use jointrig_firmware::board::{Board, Coil, NoStage, Stage};
use jointrig_firmware::ring::Slot;
use jointrig_firmware::{Core, Facts, acquire, watch};
use jointrig_protocol::limits::{MAX_CHANNELS, scans_per_block};
use static_cell::{ConstStaticCell, StaticCell};

/// Scans per second: 160 MHz / 3125, without a remainder.
pub const SCAN_RATE_HZ: u32 = 51_200;
/// Scans in a full block.
pub const BLOCK_SCANS: usize = match scans_per_block(MAX_CHANNELS) {
    Some(scans) => scans,
    None => unreachable!(),
};
/// Blocks that the ring holds: 1.1 seconds, 1.9 MB.
const SLOTS: usize = (SCAN_RATE_HZ as usize * 11 / 10).div_ceil(BLOCK_SCANS);

/// State shared by the tasks.
pub type Shared = Core<'static, CriticalSectionRawMutex>;

/// This board.
pub struct Nucleo;

impl Board for Nucleo {
    type Mutex = CriticalSectionRawMutex;
    type Scans = scans::Converters;
    type Coil = coil::PulseTimer;
    type Drive = drive::ShakerDrive;
    type Inputs = guard::Switches;
    type Source = usb::Source;
    type Sink = usb::Sink;
    type Stage = NoStage;
}

static RING: ConstStaticCell<[Slot; SLOTS]> = ConstStaticCell::new([Slot::EMPTY; SLOTS]);
static CORE: StaticCell<Shared> = StaticCell::new();
/// Executor of acquisition.
static ABOVE: InterruptExecutor = InterruptExecutor::new();
/// Executor of the guard.
static TOP: InterruptExecutor = InterruptExecutor::new();

/// An otherwise unused interrupt vector serves as acquisition's software interrupt.
#[embassy_stm32::interrupt]
fn LPUART1() {
    // SAFETY: only this interrupt polls the executor, which was started before the interrupt was
    // enabled.
    unsafe { ABOVE.on_interrupt() }
}

/// Another one serves the guard.
#[embassy_stm32::interrupt]
fn UART5() {
    // SAFETY: as above.
    unsafe { TOP.on_interrupt() }
}

#[embassy_executor::task]
async fn acquisition(
    core: &'static Shared,
    mut scans: scans::Converters,
    mut coil: coil::PulseTimer,
    mut drive: drive::ShakerDrive,
    mut inputs: guard::Switches,
) {
    acquire::acquire(core, &mut scans, &mut coil, &mut drive, &mut inputs).await;
}

#[embassy_executor::task]
async fn watching(core: &'static Shared) {
    watch::watch(core).await;
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    jointrig_board_fault::limit_stack();
    // first: what the last run left in memory
    let last_panic = keep::take_panic();
    let reset = keep::take_reset();
    probe::start();
    let p = embassy_stm32::init(clocks::config());
    // the chip's unique id is where the cache must not read (clocks::cache)
    let serial = channels::name(embassy_stm32::uid::uid_hex());
    clocks::cache();
    let dog = watchdog::start(p.IWDG);
    let mut without_nonce = false;
    let start = keep::count_start(|| {
        keep::draw().unwrap_or_else(|| {
            without_nonce = true;
            1
        })
    });

    let coil = coil::PulseTimer::new(p.TIM1, p.PE9, p.PE15);
    let inputs = guard::Switches::new(p.PF13, p.PF14, p.PF15, p.PF12);
    let facts = Facts {
        board: channels::name("nucleo-u5a5"),
        serial,
        target: channels::text(env!("JOINTRIG_TARGET")),
        build: jointrig_board_log::build_id(),
        scan_rate_hz: SCAN_RATE_HZ,
        channels: channels::table(),
        coil_cap_us: coil.cap_us(),
        stage: NoStage::PRESENT,
        sync: true,
        drive_v: drive::FULL_SCALE_V,
        reset,
        boot: start.boot,
    };
    let core: &'static Shared = CORE.init(Core::new(facts, RING.take()).with_logs(&jointrig_board_log::TAP));
    if let Some(text) = last_panic {
        core.report_panic(text.as_str());
    }
    if without_nonce {
        core.report_fault("no random number: streams after a power cut may have old epochs");
    }

    let chips = chips::Chips {
        first: chips::First {
            port: p.SPI1,
            clock: p.PA5,
            sdi: p.PA7,
            dout: p.PA6,
            select: p.PE12,
            reset: p.PE5,
            busy: p.PE4,
            dma: p.GPDMA1_CH0,
        },
        second: chips::Second {
            port: p.SPI2,
            clock: p.PD1,
            sdi: p.PD4,
            dout: p.PD3,
            select: p.PD0,
            reset: p.PE6,
            busy: p.PD9,
            dma: p.GPDMA1_CH1,
        },
    };
    let port = || sync::Port::new(p.TIM3, p.PC6, p.PC8, p.PD15);
    let scans = scans::Converters::new(core, chips, p.TIM2, p.TIM5, p.PA0, port);

    let drive = drive::ShakerDrive::new(p.DAC1, p.PA4, p.PE10, p.GPDMA1_CH2, p.GPDMA1_CH3);

    interrupt::UART5.set_priority(Priority::P5);
    let top = TOP.start(interrupt::UART5);
    interrupt::LPUART1.set_priority(Priority::P6);
    let above = ABOVE.start(interrupt::LPUART1);
    // each task is spawned once, so that its single slot is free
    top.spawn(defmt::unwrap!(guard::task(core)));
    above.spawn(defmt::unwrap!(acquisition(core, scans, coil, drive, inputs)));
    spawner.spawn(defmt::unwrap!(watching(core)));
    spawner.spawn(defmt::unwrap!(usb::task(core, p.USB_OTG_HS, p.PA12, p.PA11)));
    spawner.spawn(defmt::unwrap!(watchdog::task(dog)));
    spawner.spawn(defmt::unwrap!(slow::task(p.ADC1, (p.PC0, p.PC1, p.PC2, p.PC3))));
    spawner.spawn(defmt::unwrap!(lights::task(p.PC7, p.PB7, p.PG2)));
    defmt::info!("jointrig on nucleo-u5a5, start {}, boot {:#010x}", start.count, start.boot);
}

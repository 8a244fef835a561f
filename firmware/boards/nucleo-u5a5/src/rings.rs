//! From converter to memory without software: BUSY's falling edge starts the serial port, the port's words go
//! to a ring by GPDMA, block after block, round and round.
//!
//! The port works in its autonomous mode (RM0456, "SPI autonomous mode"): an edge of EXTI line 4 or 9 starts a transfer
//! of [`CHIP_WORDS`] words, with the select pin driven by the port. The DMA follows a closed list of blocks
//! ([`BLOCKS`]) and interrupts once per block, every 0.29 ms; what an interrupt does is count. A reader that is more
//! than [`BLOCKS`] − 2 blocks late (1.7 ms) has lost some and finds out ([`Ring::read`]).
//!
//! embassy-stm32 0.6.0 has a ring of its own; this one is smaller, never moves, and does not share its known
//! faults.

use core::cell::UnsafeCell;
use core::future::poll_fn;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering, compiler_fence, fence};
use core::task::Poll;

use embassy_stm32::interrupt::{self, InterruptExt};
use embassy_stm32::pac::gpdma::regs::{ChBr1, ChLlr};
use embassy_stm32::pac::gpdma::vals::{Ap, Dreq, Dw, Prio};
use embassy_stm32::pac::spi::Spi;
use embassy_stm32::pac::spi::vals::{Comm, Cpha, Cpol, Fthlv, Master, Mbr, Ssom, Trigpol};
use embassy_stm32::pac::{EXTI, GPDMA1, SPI1, SPI2, TIM5};
use embassy_sync::waitqueue::AtomicWaker;
use jointrig_firmware::ad7606b::frames::CHIP_WORDS;

use crate::BLOCK_SCANS;
use crate::dma::{self, Carries};

/// Blocks in each ring.
pub const BLOCKS: u32 = 8;

/// One block of one chip.
pub type Block = [[u16; CHIP_WORDS]; BLOCK_SCANS];

/// What the DMA loads to go on with the next block: byte count, destination, and the item after it.
type Item = [u32; 3];

/// Aligned to more than its size, so that it never crosses a 64 kB page, within which its addresses are.
#[repr(C, align(128))]
struct Items(UnsafeCell<[Item; BLOCKS as usize]>);

/// One chip's ring.
pub struct Ring {
    port: Spi,
    channel: usize,
    /// Which trigger of the port BUSY's line is (RM0456, SPI trigger table): 4 for EXTI 4, 5 for EXTI 9.
    trigger: u8,
    /// BUSY's pin: EXTI line, and port (A is 0).
    busy: (usize, u8),
    items: Items,
    blocks: UnsafeCell<[Block; BLOCKS as usize]>,
    /// Blocks written since the start.
    written: AtomicU32,
    /// What TIM5 had counted when the last of them was complete.
    edges: AtomicU32,
    failed: AtomicBool,
}

// SAFETY: `items` is written only while the channel is off, and read only by the DMA. `blocks` is written only by the
// DMA and read only by `read`, which reads no block that is being written and checks afterwards that none was.
unsafe impl Sync for Ring {}

/// Channels 1 to 8: BUSY on PE4.
pub static FIRST: Ring = Ring::new(SPI1, 0, 4, (4, 4));
/// Channels 9 to 16: BUSY on PD9.
pub static SECOND: Ring = Ring::new(SPI2, 1, 5, (9, 3));

static ARRIVED: AtomicWaker = AtomicWaker::new();

impl Ring {
    const fn new(port: Spi, channel: usize, trigger: u8, busy: (usize, u8)) -> Self {
        Self {
            port,
            channel,
            trigger,
            busy,
            items: Items(UnsafeCell::new([[0; 3]; BLOCKS as usize])),
            blocks: UnsafeCell::new([[[0; CHIP_WORDS]; BLOCK_SCANS]; BLOCKS as usize]),
            written: AtomicU32::new(0),
            edges: AtomicU32::new(0),
            failed: AtomicBool::new(false),
        }
    }

    /// Stops port and DMA.
    pub fn stop(&self) {
        self.port.cr1().modify(|w| w.set_spe(false));
        self.port.autocr().modify(|w| w.set_trigen(false));
        dma::stop(self.channel);
    }

    /// Makes both ready for the next conversion. The pins must have their functions already.
    pub fn start(&'static self, request: u8) {
        self.stop();
        self.written.store(0, Ordering::Relaxed);
        self.failed.store(false, Ordering::Relaxed);
        self.start_channel(request);
        self.start_port();
    }

    fn start_channel(&'static self, request: u8) {
        let items = self.items.0.get() as u32;
        let link = |to: u32| dma::link(items + to * size_of::<Item>() as u32, Carries::Destination).0;
        let mut count = ChBr1(0);
        count.set_bndt(size_of::<Block>() as u16);
        let first = self.blocks.get() as u32;
        let list: [Item; BLOCKS as usize] = core::array::from_fn(|i| {
            let i = i as u32;
            [count.0, first + i * size_of::<Block>() as u32, link((i + 1) % BLOCKS)]
        });
        // SAFETY: `stop` has just reset the channel, so that the DMA does not read the list, and nobody else
        // ever does.
        unsafe { self.items.0.get().write_volatile(list) };
        fence(Ordering::SeqCst);

        let channel = GPDMA1.ch(self.channel);
        channel.lbar().write(|w| w.set_lba((items >> 16) as u16));
        channel.tr1().write(|w| {
            w.set_sdw(Dw::HALF_WORD);
            w.set_ddw(Dw::HALF_WORD);
            w.set_dinc(true);
            w.set_sap(Ap::PORT1);
            w.set_dap(Ap::PORT0);
        });
        channel.tr2().write(|w| {
            w.set_dreq(Dreq::SOURCE_PERIPHERAL);
            w.set_reqsel(request);
        });
        channel.br1().write_value(ChBr1(list[0][0]));
        channel.sar().write_value(self.port.rxdr16().as_ptr() as u32);
        channel.dar().write_value(list[0][1]);
        channel.llr().write_value(ChLlr(list[0][2]));
        channel.cr().write(|w| {
            w.set_prio(Prio::HIGH);
            w.set_tcie(true);
            w.set_dteie(true);
            w.set_uleie(true);
            w.set_useie(true);
            w.set_en(true);
        });
    }

    fn start_port(&self) {
        let port = self.port;
        port.cfg1().write(|w| {
            w.set_dsize(15);
            w.set_fthlv(Fthlv::ONE_FRAME);
            // 160 MHz / 4: 40 MHz; AD7606B Rev. 0, "Timing Specifications", allows it from 2.7 V of VDRIVE on
            w.set_mbr(Mbr::DIV4);
            w.set_rxdmaen(true);
        });
        port.cfg2().write(|w| {
            w.set_comm(Comm::RECEIVER);
            w.set_master(Master::MASTER);
            w.set_cpol(Cpol::IDLE_HIGH);
            w.set_cpha(Cpha::FIRST_EDGE);
            // the port drives select: low with the transfer's first clock, high after its last
            w.set_ssoe(true);
            w.set_ssom(Ssom::ASSERTED);
            w.set_mssi(2);
        });
        port.cr2().write(|w| w.set_tsize(CHIP_WORDS as u16));
        port.ifcr().write(|w| {
            w.set_eotc(true);
            w.set_txtfc(true);
            w.set_ovrc(true);
            w.set_modfc(true);
            w.set_suspc(true);
        });
        let (line, pin_port) = self.busy;
        EXTI.exticr(line / 4).modify(|w| w.set_exti(line % 4, pin_port));
        EXTI.ftsr(0).modify(|w| w.set_line(line, true));
        if cfg!(feature = "busy-interrupt") {
            EXTI.imr(0).modify(|w| w.set_line(line, true));
        } else {
            port.autocr().write(|w| {
                w.set_trigsel(self.trigger);
                w.set_trigpol(Trigpol::FALLING_EDGE);
                w.set_trigen(true);
            });
        }
        port.cr1().modify(|w| w.set_spe(true));
    }

    /// Reads block `number`, counted from the start. `None` when it has not come, or is gone already.
    pub fn read(&self, number: u32) -> Option<Block> {
        // the newest complete block down to the oldest that the DMA will not touch while this reads
        let whole = |written: u32| (1..BLOCKS).contains(&written.wrapping_sub(number));
        if !whole(self.written.load(Ordering::Acquire)) {
            return None;
        }
        // SAFETY: in bounds by the remainder; `whole` says that the DMA writes another block now, and the volatile read
        // keeps the compiler from believing that memory does not change.
        let block =
            unsafe { self.blocks.get().cast::<Block>().add((number % BLOCKS) as usize).read_volatile() };
        compiler_fence(Ordering::Acquire);
        whole(self.written.load(Ordering::Acquire)).then_some(block)
    }

    /// Blocks written since the start, and TIM5's count when the last was complete.
    pub fn progress(&self) -> (u32, u32) {
        critical_section::with(|_| (self.written.load(Ordering::Relaxed), self.edges.load(Ordering::Relaxed)))
    }

    /// Whether the DMA has given up.
    pub fn has_failed(&self) -> bool {
        self.failed.load(Ordering::Relaxed)
    }

    fn on_interrupt(&self) {
        let channel = GPDMA1.ch(self.channel);
        let status = channel.sr().read();
        if status.dtef() || status.ulef() || status.usef() {
            channel.fcr().write(|w| {
                w.set_dtef(true);
                w.set_ulef(true);
                w.set_usef(true);
            });
            self.failed.store(true, Ordering::Relaxed);
        }
        if status.tcf() {
            channel.fcr().write(|w| w.set_tcf(true));
            self.edges.store(TIM5.cnt().read(), Ordering::Relaxed);
            self.written.fetch_add(1, Ordering::Release);
        }
        ARRIVED.wake();
    }

    #[cfg(feature = "busy-interrupt")]
    fn on_busy(&self) {
        EXTI.fpr(0).write(|w| w.set_line(self.busy.0, true));
        // a port that has finished must be switched off and on to count anew
        self.port.cr1().modify(|w| w.set_spe(false));
        self.port.ifcr().write(|w| {
            w.set_eotc(true);
            w.set_txtfc(true);
        });
        self.port.cr1().modify(|w| w.set_spe(true));
        self.port.cr1().modify(|w| w.set_cstart(true));
    }
}

/// Waits until both rings have block `number`, or one has failed.
pub async fn arrived(number: u32) {
    poll_fn(|context| {
        ARRIVED.register(context.waker());
        let has = |ring: &Ring| ring.written.load(Ordering::Acquire).wrapping_sub(number).cast_signed() > 0;
        let over = has(&FIRST) && has(&SECOND) || FIRST.has_failed() || SECOND.has_failed();
        if over { Poll::Ready(()) } else { Poll::Pending }
    })
    .await;
}

#[embassy_stm32::interrupt]
fn GPDMA1_CHANNEL0() {
    FIRST.on_interrupt();
}

#[embassy_stm32::interrupt]
fn GPDMA1_CHANNEL1() {
    SECOND.on_interrupt();
}

#[cfg(feature = "busy-interrupt")]
#[embassy_stm32::interrupt]
fn EXTI4() {
    FIRST.on_busy();
}

#[cfg(feature = "busy-interrupt")]
#[embassy_stm32::interrupt]
fn EXTI9() {
    SECOND.on_busy();
}

/// Lets the interrupts of this file through.
pub fn enable_interrupts() {
    let numbers: &[interrupt::Interrupt] = if cfg!(feature = "busy-interrupt") {
        &[interrupt::GPDMA1_CHANNEL0, interrupt::GPDMA1_CHANNEL1, interrupt::EXTI4, interrupt::EXTI9]
    } else {
        &[interrupt::GPDMA1_CHANNEL0, interrupt::GPDMA1_CHANNEL1]
    };
    for number in numbers {
        // SAFETY: their handlers stand above and touch nothing but atomics and their own peripherals.
        unsafe { number.enable() };
    }
}

//! Transfers data from the converters to memory without software: BUSY's falling edge starts the
//! serial port, and GPDMA writes the port's words to a ring, block after block.
//!
//! The port works in its autonomous mode (RM0456, "SPI autonomous mode"): an edge of EXTI line 4 or
//! 9 starts a transfer of nine words, with the select pin driven by the port. Before each
//! conversion a second DMA channel disables and enables the port, which would otherwise start no
//! further transfer ([`crate::restart`]). The first DMA channel follows a closed list of blocks
//! ([`BLOCKS`]) and interrupts once per block, every 0.29 ms. The interrupt only counts, and the
//! count is only used for waking: whether a block is complete, aligned and not overwritten is
//! determined from the channel's own address ([`Ring::position`]).
//!
//! embassy-stm32 0.6.0 also has a ring; this one is smaller, never moves, and does not share its
//! known faults.

use core::cell::UnsafeCell;
use core::future::poll_fn;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering, fence};
use core::task::Poll;

use embassy_stm32::interrupt::{self, InterruptExt};
use embassy_stm32::pac::gpdma::regs::{ChBr1, ChLlr};
use embassy_stm32::pac::gpdma::vals::{Ap, Dreq, Dw, Prio};
use embassy_stm32::pac::spi::Spi;
use embassy_stm32::pac::spi::vals::{Comm, Cpha, Cpol, Fthlv, Master, Mbr, Ssom, Trigpol};
use embassy_stm32::pac::{EXTI, GPDMA1, SPI1, SPI2};
use embassy_sync::waitqueue::AtomicWaker;
use jointrig_firmware::ad7606b::reader::SCAN_WORDS;
use jointrig_hot::pair::CHIP_BYTES;

use crate::dma::{self, Carries};
use crate::{BLOCK_SCANS, restart};

/// Blocks in each ring.
pub const BLOCKS: u32 = 8;
/// Words in a ring.
const RING_WORDS: u32 = BLOCKS * BLOCK_SCANS as u32 * SCAN_WORDS;

const _: () = assert!((CHIP_BYTES * BLOCK_SCANS).is_multiple_of(2));

/// One block of one chip.
pub type Block = [[u8; CHIP_BYTES]; BLOCK_SCANS];

/// The blocks of both rings, kept separate from other data so that they are zero-initialised and
/// take no flash.
#[repr(C, align(4))]
struct Memory(UnsafeCell<[Block; BLOCKS as usize]>);

// SAFETY: written only by the DMA; readers check afterwards whether it wrote meanwhile.
unsafe impl Sync for Memory {}

static MEMORY: [Memory; 2] =
    [const { Memory(UnsafeCell::new([[[0; CHIP_BYTES]; BLOCK_SCANS]; BLOCKS as usize])) }; 2];

/// List item that the DMA loads for the next block: byte count, destination, and link to the
/// following item.
type Item = [u32; 3];

/// Aligned to more than its size, so that it never crosses a 64 kB page, to which its addresses are
/// relative.
#[repr(C, align(128))]
struct Items(UnsafeCell<[Item; BLOCKS as usize]>);

// SAFETY: written only while the channel is off, and read only by the DMA.
unsafe impl Sync for Items {}

static ITEMS: [Items; 2] = [const { Items(UnsafeCell::new([[0; 3]; BLOCKS as usize])) }; 2];

/// One chip's ring.
pub struct Ring {
    port: Spi,
    channel: usize,
    /// The port's trigger number for BUSY's line (RM0456, SPI trigger table): 4 for EXTI 4, 5 for
    /// EXTI 9.
    trigger: u8,
    /// BUSY's pin: EXTI line, and port (A is 0).
    busy: (usize, u8),
    /// Blocks written since the start, as counted by interrupts.
    written: AtomicU32,
    failed: AtomicBool,
}

/// Channels 1 to 8: BUSY on PE4.
pub static FIRST: Ring = Ring::new(SPI1, 0, 4, (4, 4));
/// Channels 9 to 16: BUSY on PD9.
pub static SECOND: Ring = Ring::new(SPI2, 1, 5, (9, 3));

static ARRIVED: AtomicWaker = AtomicWaker::new();

impl Ring {
    const fn new(port: Spi, channel: usize, trigger: u8, busy: (usize, u8)) -> Self {
        Self { port, channel, trigger, busy, written: AtomicU32::new(0), failed: AtomicBool::new(false) }
    }

    /// Stops port and DMA.
    pub fn stop(&self) {
        // first stop the channel that re-enables the port
        restart::stop(self.channel);
        self.port.cr1().modify(|w| w.set_spe(false));
        self.port.autocr().modify(|w| w.set_trigen(false));
        dma::stop(self.channel);
    }

    /// Prepares port and DMA for the next conversion. The pins must already have their functions.
    pub fn start(&'static self, request: u8) {
        self.stop();
        self.written.store(0, Ordering::Relaxed);
        self.failed.store(false, Ordering::Relaxed);
        self.start_channel(request);
        self.start_port();
        restart::start(self.channel, self.port);
    }

    fn start_channel(&'static self, request: u8) {
        let items = ITEMS[self.channel].0.get() as u32;
        let link = |to: u32| dma::link(items + to * size_of::<Item>() as u32, Carries::Destination).0;
        let mut count = ChBr1(0);
        count.set_bndt(size_of::<Block>() as u16);
        let first = MEMORY[self.channel].0.get() as u32;
        let list: [Item; BLOCKS as usize] = core::array::from_fn(|i| {
            let i = i as u32;
            [count.0, first + i * size_of::<Block>() as u32, link((i + 1) % BLOCKS)]
        });
        // SAFETY: `stop` has just reset the channel, so that the DMA does not read the list, and
        // nothing else ever does.
        unsafe { ITEMS[self.channel].0.get().write_volatile(list) };
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
            // 160 MHz / 4: 40 MHz; AD7606B Rev. 0, "Timing Specifications", permits it for VDRIVE
            // of 2.7 V and more
            w.set_mbr(Mbr::DIV4);
            w.set_rxdmaen(true);
        });
        port.cfg2().write(|w| {
            w.set_comm(Comm::RECEIVER);
            w.set_master(Master::MASTER);
            w.set_cpol(Cpol::IDLE_HIGH);
            // The converter outputs a bit on a rising edge, and the next falling edge comes before
            // it is valid. It is therefore sampled on the following rising edge, which also outputs
            // the next bit (timing in firmware/tests/it/front_end/timing.rs).
            w.set_cpha(Cpha::SECOND_EDGE);
            // the pins stay driven while the port is off (RM0456, SPI_CFG2, AFCNTR)
            w.set_afcntr(true);
            // the port drives select: low with the transfer's first clock, high after its last
            w.set_ssoe(true);
            w.set_ssom(Ssom::ASSERTED);
            w.set_mssi(2);
        });
        port.cr2().write(|w| w.set_tsize(SCAN_WORDS as u16));
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

    /// Block `number`, counted from the start, with its present content. The DMA may be writing to
    /// it; only the ring's position, read afterwards, shows that it did not.
    ///
    /// Every word is read with a volatile access. A reference would require that nothing writes
    /// while it exists, which cannot be guaranteed for the DMA, and its reads might be moved after
    /// that of the position.
    pub fn block(&self, number: u32) -> Block {
        const HALF_WORDS: usize = size_of::<Block>() / 2;
        let ring = core::ptr::from_ref(&MEMORY[self.channel]).cast::<u16>();
        let mut block: Block = [[0; CHIP_BYTES]; BLOCK_SCANS];
        for (place, bytes) in block.as_flattened_mut().chunks_exact_mut(2).enumerate() {
            let place = (number % BLOCKS) as usize * HALF_WORDS + place;
            // SAFETY: in bounds because of the remainder, and aligned like the ring; the DMA writes
            // half-words, each in one access.
            bytes.copy_from_slice(&unsafe { ring.add(place).read_volatile() }.to_ne_bytes());
        }
        block
    }

    /// How far the ring is filled, in words from its beginning: the address that the DMA writes
    /// next (RM0456, "GPDMA channel x destination address register").
    pub fn position(&self) -> u32 {
        // the previous reads access memory, this one a device: the processor does not order the two
        // by itself
        fence(Ordering::SeqCst);
        let filled = GPDMA1.ch(self.channel).dar().read().wrapping_sub(MEMORY[self.channel].0.get() as u32);
        // after the last block, until the list's first item is loaded, the address is the ring's
        // end
        filled / 2 % RING_WORDS
    }

    /// Blocks written since the start, as counted by interrupts.
    pub fn progress(&self) -> u32 {
        self.written.load(Ordering::Relaxed)
    }

    /// Whether the DMA has stopped with an error.
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
            self.written.fetch_add(1, Ordering::Release);
        }
        ARRIVED.wake();
    }

    #[cfg(feature = "busy-interrupt")]
    fn on_busy(&self) {
        EXTI.fpr(0).write(|w| w.set_line(self.busy.0, true));
        // a port that has finished must be disabled and enabled to count again
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

/// Enables the interrupts of this file.
pub fn enable_interrupts() {
    let numbers: &[interrupt::Interrupt] = if cfg!(feature = "busy-interrupt") {
        &[interrupt::GPDMA1_CHANNEL0, interrupt::GPDMA1_CHANNEL1, interrupt::EXTI4, interrupt::EXTI9]
    } else {
        &[interrupt::GPDMA1_CHANNEL0, interrupt::GPDMA1_CHANNEL1]
    };
    for number in numbers {
        // SAFETY: their handlers are defined above and access only atomics and their own
        // peripherals.
        unsafe { number.enable() };
    }
}

//! Disables and re-enables the ports before each conversion, without the CPU.
//!
//! A port that has transferred its count of words starts no further transfer on any trigger until
//! it was disabled and enabled (RM0456, SPI "Procedure for disabling the SPI"; AN5543). Therefore,
//! shortly before CONVST rises, TIM2 triggers a separate DMA channel for each port, which writes
//! two words into CR1: zero, then SPE. By then the last read-out is complete, and the next begins
//! 10 µs later. Each channel has its own request, because one request must not drive two channels
//! (RM0456, "GPDMA request selection").

use core::cell::UnsafeCell;
use core::sync::atomic::{Ordering, fence};

use embassy_stm32::pac::gpdma::regs::{ChBr1, ChLlr};
use embassy_stm32::pac::gpdma::vals::{Ap, Breq, Dreq, Dw, Prio};
use embassy_stm32::pac::spi::Spi;
use embassy_stm32::pac::spi::regs::Cr1;
use embassy_stm32::pac::{GPDMA1, TIM2};

use crate::clocks::CONVST_LOW;
use crate::dma::{self, Carries};

/// The DMA channel of each port.
const CHANNELS: [usize; 2] = [4, 5];
/// Their requests: TIM2's compare channels 2 and 3 (RM0456, "GPDMA1 request assignments"; the same
/// numbers in embassy-stm32's tables).
const REQUESTS: [u8; 2] = [57, 58];
/// Counts of TIM2 at which the requests occur: after the period's begin, before CONVST's edge, and
/// not simultaneously.
const AT: [u32; 2] = [CONVST_LOW / 4, CONVST_LOW / 2];
/// Length of the two words in bytes.
const BYTES: u32 = 8;

/// The two words (off, on), and the DMA list item that restarts with them.
#[repr(C, align(32))]
struct Shared(UnsafeCell<[u32; 2]>, UnsafeCell<[[u32; 3]; 2]>);

// SAFETY: written only while the channels are off, and read only by the DMA.
unsafe impl Sync for Shared {}

static SHARED: Shared = Shared(UnsafeCell::new([0; 2]), UnsafeCell::new([[0; 3]; 2]));

/// Stops restarting port `number` (0 or 1).
pub fn stop(number: usize) {
    TIM2.dier().modify(|w| w.set_ccde(1 + number, false));
    dma::stop(CHANNELS[number]);
}

/// Disables and re-enables a port before each conversion from now on.
pub fn start(number: usize, port: Spi) {
    if cfg!(feature = "busy-interrupt") {
        return;
    }
    stop(number);
    let mut on = Cr1(0);
    on.set_spe(true);
    let words = SHARED.0.get();
    let item = SHARED.1.get().cast::<[u32; 3]>().wrapping_add(number);
    let link = dma::link(item as u32, Carries::Source);
    // SAFETY: this channel is off; the two words are the same for both.
    unsafe {
        words.write_volatile([0, on.0]);
        item.write_volatile([BYTES, words as u32, link.0]);
    }
    fence(Ordering::SeqCst);
    let channel = GPDMA1.ch(CHANNELS[number]);
    channel.lbar().write(|w| w.set_lba((item as u32 >> 16) as u16));
    channel.tr1().write(|w| {
        w.set_sdw(Dw::WORD);
        w.set_ddw(Dw::WORD);
        w.set_sinc(true);
        w.set_sap(Ap::PORT0);
        w.set_dap(Ap::PORT1);
    });
    channel.tr2().write(|w| {
        w.set_dreq(Dreq::DESTINATION_PERIPHERAL);
        // both words on one request
        w.set_breq(Breq::BLOCK);
        w.set_reqsel(REQUESTS[number]);
    });
    channel.br1().write_value(ChBr1(BYTES));
    channel.sar().write_value(words as u32);
    channel.dar().write_value(port.cr1().as_ptr() as u32);
    channel.llr().write_value(ChLlr(link.0));
    channel.cr().write(|w| {
        w.set_prio(Prio::HIGH);
        w.set_en(true);
    });
    TIM2.ccr(1 + number).write_value(AT[number]);
    TIM2.dier().modify(|w| w.set_ccde(1 + number, true));
}

/// Whether the channel of port `number` is running.
pub fn works(number: usize) -> bool {
    cfg!(feature = "busy-interrupt") || dma::works(CHANNELS[number])
}

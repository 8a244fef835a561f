//! The shaker's drive: DAC1's first output on PA4, one code per scan, synchronised with CONVST.
//!
//! TIM2's update ends a scan's period: it makes the DAC output the word it holds, and CONVST rises
//! 1 µs later. The DAC then requests the next word of a ring from GPDMA channel 2, the player. The
//! same update triggers channel 3, the eraser, which writes rest behind the player
//! ([`jointrig_firmware::feed`]). Neither needs software: if the program hangs, the ring returns to
//! rest after the last code (usually 1.5 ms, at most 4.4 ms) and stays there.
//!
//! TIM5, which counts TIM2's updates, gives the player's position. The word that the player takes
//! after the n-th update is output with the (n+1)-th.
//!
//! Rest is the middle of the DAC's range. The amplifier then receives 0 V, and also while the pin
//! floats in reset: a capacitor and a divider to mid-supply ensure this (docs/WIRING.md). PE10
//! controls the relay that connects the amplifier; it is low in reset.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, Ordering, fence};

use embassy_stm32::Peri;
use embassy_stm32::dac::{Ch1, ChannelTrigger, DacChannel, Dma, Value};
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::mode::Blocking;
use embassy_stm32::pac::gpdma::regs::{ChBr1, ChLlr};
use embassy_stm32::pac::gpdma::vals::{Ap, Dreq, Dw, Prio};
use embassy_stm32::pac::{self, GPDMA1, TIM2, TIM5};
use embassy_stm32::peripherals::{DAC1, GPDMA1_CH2, GPDMA1_CH3, PA4, PE10, TIM2 as ScanTimer};
use embassy_stm32::timer::UpDma;
use embassy_stm32::triggers::TIM2_TRGO;
use jointrig_firmware::board::{Drive, RanDry};
use jointrig_firmware::feed::{FULL_SCALE_STEPS, Feed, REST, RING, TRAIL, Words};

use crate::dma::{self, Carries};

/// VREF+ of the board, V: the 3.3 V supply.
const REFERENCE_V: f32 = 3.3;
/// Steps of the DAC.
const STEPS: f32 = 4096.0;
/// Gain from the DAC's pin to the amplifier (docs/WIRING.md).
const STAGE_GAIN: f32 = 2.0;
/// Voltage at the amplifier's input for the largest code, V.
pub const FULL_SCALE_V: f32 = FULL_SCALE_STEPS / STEPS * REFERENCE_V * STAGE_GAIN;
/// PE10: bit number in GPIOE.
const ENABLE_BIT: usize = 10;
/// Index of DAC1's first channel in its registers.
const CHANNEL: usize = 0;
/// GPDMA channels.
const PLAYER: usize = 2;
const ERASER: usize = 3;
const WORD_BYTES: u32 = size_of::<u32>() as u32;
const RING_BYTES: u32 = RING * WORD_BYTES;

/// List item that a DMA channel loads to repeat: byte count, address, and the link to this item.
type Item = [u32; 3];

/// Memory read and written by the DMA. Aligned to more than an item's size, so that no item crosses
/// a 64 kB page.
#[repr(C, align(64))]
struct Shared {
    player: UnsafeCell<Item>,
    _apart: u32,
    eraser: UnsafeCell<Item>,
    rest: u32,
}

/// The ring's words. Zero until the drive starts, which first writes rest everywhere; so they take
/// no flash.
#[repr(C, align(64))]
struct Ringed(UnsafeCell<[u32; RING as usize]>);

// SAFETY: as for `Shared`.
unsafe impl Sync for Ringed {}

static WORDS: Ringed = Ringed(UnsafeCell::new([0; RING as usize]));

// SAFETY: the items are written only while both channels are off, and read only by the DMA. The
// words are accessed by the DMA and, with volatile accesses inside critical sections, by `In`; each
// is a `u32` of which any value may be played, and both sides access whole words.
unsafe impl Sync for Shared {}

static SHARED: Shared =
    Shared { player: UnsafeCell::new([0; 3]), _apart: 0, eraser: UnsafeCell::new([0; 3]), rest: REST };

/// Set when an emergency stop has muted the drive; only [`Drive::rest`] allows playing again.
static MUTED: AtomicBool = AtomicBool::new(false);

/// Access to the ring's words within a critical section.
struct In<'a>(#[allow(dead_code, reason = "proves the section")] critical_section::CriticalSection<'a>);

impl Words for In<'_> {
    fn get(&self, place: usize) -> u32 {
        // SAFETY: in bounds by the remainder; see `Shared`.
        unsafe { WORDS.0.get().cast::<u32>().add(place % RING as usize).read_volatile() }
    }

    fn set(&mut self, place: usize, word: u32) {
        // SAFETY: as above.
        unsafe { WORDS.0.get().cast::<u32>().add(place % RING as usize).write_volatile(word) }
    }
}

/// Disables the drive, whatever else is running: the ring is at rest within 0.1 ms, and the relay
/// drops. For a task with a higher priority than acquisition, which may be stuck.
pub fn mute() {
    critical_section::with(|section| {
        pac::GPIOE.bsrr().write(|w| w.set_br(ENABLE_BIT, true));
        MUTED.store(true, Ordering::Relaxed);
        Feed::new().rest(&mut In(section));
    });
}

/// The drive.
pub struct ShakerDrive {
    feed: Feed,
    /// TIM5's count when the player was at the ring's first word.
    started_at: u32,
    enable: Output<'static>,
    _dac: DacChannel<'static, Blocking>,
    player: Peri<'static, GPDMA1_CH2>,
    eraser: Peri<'static, GPDMA1_CH3>,
}

impl ShakerDrive {
    /// Initialises at rest. TIM2 and TIM5 must already run.
    pub fn new(
        dac: Peri<'static, DAC1>,
        output: Peri<'static, PA4>,
        enable: Peri<'static, PE10>,
        player: Peri<'static, GPDMA1_CH2>,
        eraser: Peri<'static, GPDMA1_CH3>,
    ) -> Self {
        let enable = Output::new(enable, Level::Low, Speed::Low);
        let mut dac = DacChannel::new_blocking(dac, output);
        // no trigger is set yet, so that the value is output immediately
        dac.set(Value::Bit12Right(REST as u16));
        let mut drive = Self { feed: Feed::new(), started_at: 0, enable, _dac: dac, player, eraser };
        drive.start();
        drive
    }

    /// Starts player and eraser at the ring's beginning, right after an update of TIM2.
    fn start(&mut self) {
        let player = Dma::<DAC1, Ch1>::request(&*self.player);
        let eraser = UpDma::<ScanTimer>::request(&*self.eraser);
        critical_section::with(|section| {
            TIM2.dier().modify(|w| w.set_ude(false));
            pac::DAC1.cr().modify(|w| w.set_dmaen(CHANNEL, false));
            dma::stop(PLAYER);
            dma::stop(ERASER);
            self.feed.rest(&mut In(section));
            prepare_player(player);
            prepare_eraser(eraser);
            pac::DAC1.sr().write(|w| w.set_dmaudr(CHANNEL, true));
            pac::DAC1.cr().modify(|w| w.set_tsel(CHANNEL, ChannelTrigger::<DAC1>::signal(&TIM2_TRGO)));

            // a whole period follows an update, of which this needs 1 µs
            let before = TIM5.cnt().read();
            while TIM5.cnt().read() == before {}
            self.started_at = TIM5.cnt().read();
            GPDMA1.ch(ERASER).cr().write(|w| {
                w.set_prio(Prio::LOW_WITH_HIGH_WEIGHT);
                w.set_en(true);
            });
            GPDMA1.ch(PLAYER).cr().write(|w| {
                w.set_prio(Prio::HIGH);
                w.set_en(true);
            });
            TIM2.dier().modify(|w| w.set_ude(true));
            pac::DAC1.cr().modify(|w| {
                w.set_dmaen(CHANNEL, true);
                w.set_ten(CHANNEL, true);
            });
        });
    }

    /// Whether both channels are running and the DAC has had no underrun. After an underrun the DAC
    /// issues no more requests (RM0456, "DMA underrun") and holds its last word; the capacitor
    /// after it blocks this constant voltage.
    fn works() -> bool {
        dma::works(PLAYER) && dma::works(ERASER) && !pac::DAC1.sr().read().dmaudr(CHANNEL)
    }

    fn fall_silent(&mut self) {
        self.enable.set_low();
        critical_section::with(|section| self.feed.rest(&mut In(section)));
        if !Self::works() {
            defmt::warn!("the drive's DMA had stopped: it is started anew");
            self.start();
        }
    }
}

/// Player: ring to DAC, one word per DAC request, cyclically.
fn prepare_player(request: u8) {
    let ring = WORDS.0.get() as u32;
    let item = SHARED.player.get();
    let link = dma::link(item as u32, Carries::Source);
    // SAFETY: both channels are off, so that the DMA does not read the item; nothing else does.
    unsafe { item.write_volatile([RING_BYTES, ring, link.0]) };
    fence(Ordering::SeqCst);
    let channel = GPDMA1.ch(PLAYER);
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
        w.set_reqsel(request);
    });
    channel.br1().write_value(ChBr1(RING_BYTES));
    channel.sar().write_value(ring);
    channel.dar().write_value(pac::DAC1.dhr12r(CHANNEL).as_ptr() as u32);
    channel.llr().write_value(ChLlr(link.0));
}

/// Eraser: rest value to ring, one word per update of TIM2, [`TRAIL`] words behind the player; its
/// first pass covers only the end of the ring.
fn prepare_eraser(request: u8) {
    let ring = WORDS.0.get() as u32;
    let item = SHARED.eraser.get();
    let link = dma::link(item as u32, Carries::Destination);
    // SAFETY: as for the player.
    unsafe { item.write_volatile([RING_BYTES, ring, link.0]) };
    fence(Ordering::SeqCst);
    let channel = GPDMA1.ch(ERASER);
    channel.lbar().write(|w| w.set_lba((item as u32 >> 16) as u16));
    channel.tr1().write(|w| {
        w.set_sdw(Dw::WORD);
        w.set_ddw(Dw::WORD);
        w.set_dinc(true);
        w.set_sap(Ap::PORT0);
        w.set_dap(Ap::PORT0);
    });
    channel.tr2().write(|w| {
        w.set_dreq(Dreq::DESTINATION_PERIPHERAL);
        w.set_reqsel(request);
    });
    channel.br1().write_value(ChBr1(TRAIL * WORD_BYTES));
    channel.sar().write_value(&raw const SHARED.rest as u32);
    channel.dar().write_value(ring + (RING - TRAIL) * WORD_BYTES);
    channel.llr().write_value(ChLlr(link.0));
}

impl Drive for ShakerDrive {
    fn full_scale_v(&self) -> f32 {
        FULL_SCALE_V
    }

    fn play(&mut self, codes: &[i16]) -> Result<(), RanDry> {
        let played = critical_section::with(|section| {
            if MUTED.load(Ordering::Relaxed) || !Self::works() {
                return Err(RanDry);
            }
            let now = TIM5.cnt().read().wrapping_sub(self.started_at);
            self.feed.play(now, codes, &mut In(section))?;
            self.enable.set_high();
            Ok(())
        });
        if played.is_err() {
            self.fall_silent();
        }
        played
    }

    fn rest(&mut self) {
        self.fall_silent();
        MUTED.store(false, Ordering::Relaxed);
    }
}

//! The shaker's drive: DAC1's first output on PA4, one code per scan, in step with CONVST.
//!
//! TIM2's update ends a scan's period: it makes the DAC put out the word it holds, and CONVST rises
//! 1 µs later. The DAC then asks GPDMA channel 2, the player, for the next word of a ring. The same
//! update asks channel 3, the eraser, which writes rest behind the player
//! ([`jointrig_firmware::feed`]). Neither needs a program: when it hangs, the ring is at rest after
//! what was given (1.5 ms as a rule, 4.4 ms at most), and stays so.
//!
//! TIM5, which counts TIM2's updates, is the player's position. The word that the player takes
//! after the n-th update is put out with the (n+1)-th.
//!
//! Rest is the middle of the DAC's range. The amplifier sees 0 V then, and also while the pin
//! floats in reset: a capacitor and a divider to the middle see to that (docs/WIRING.md). PE10
//! holds the relay that lets the amplifier hear at all; it is low in reset.

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

/// VREF+ of the board, V: its 3.3 V supply.
const REFERENCE_V: f32 = 3.3;
/// Steps of the DAC.
const STEPS: f32 = 4096.0;
/// From the DAC's pin to the amplifier (docs/WIRING.md).
const STAGE_GAIN: f32 = 2.0;
/// At the amplifier's input with the largest code, V.
pub const FULL_SCALE_V: f32 = FULL_SCALE_STEPS / STEPS * REFERENCE_V * STAGE_GAIN;
/// PE10 of GPIOE.
const ENABLE_BIT: usize = 10;
/// DAC1's first channel in its registers.
const CHANNEL: usize = 0;
/// GPDMA channels.
const PLAYER: usize = 2;
const ERASER: usize = 3;
const WORD_BYTES: u32 = size_of::<u32>() as u32;
const RING_BYTES: u32 = RING * WORD_BYTES;

/// What a DMA channel loads to go round again: byte count, address, and the link to this again.
type Item = [u32; 3];

/// What the DMA reads and writes. Aligned to more than an item's size, so that none crosses a 64 kB
/// page.
#[repr(C, align(64))]
struct Shared {
    player: UnsafeCell<Item>,
    _apart: u32,
    eraser: UnsafeCell<Item>,
    rest: u32,
}

/// The ring's words. Zeros until the drive starts, which writes rest everywhere first: so they take
/// no flash.
#[repr(C, align(64))]
struct Ringed(UnsafeCell<[u32; RING as usize]>);

// SAFETY: as for `Shared`.
unsafe impl Sync for Ringed {}

static WORDS: Ringed = Ringed(UnsafeCell::new([0; RING as usize]));

// SAFETY: the items are written only while both channels are off, and read only by the DMA. The
// words are touched by the DMA and, through volatile accesses inside critical sections, by `In`;
// each is a `u32` of which any value may be played, and the accesses of both sides are whole words.
unsafe impl Sync for Shared {}

static SHARED: Shared =
    Shared { player: UnsafeCell::new([0; 3]), _apart: 0, eraser: UnsafeCell::new([0; 3]), rest: REST };

/// Whoever stopped everything has muted the drive; only [`Drive::rest`] lets it play again.
static MUTED: AtomicBool = AtomicBool::new(false);

/// The ring's words, inside a critical section.
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

/// Takes the drive away from whatever runs: silence in the ring within 0.1 ms, and the relay falls.
/// For a task above acquisition, which may be stuck.
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
    /// At rest. TIM2 and TIM5 must run already.
    pub fn new(
        dac: Peri<'static, DAC1>,
        output: Peri<'static, PA4>,
        enable: Peri<'static, PE10>,
        player: Peri<'static, GPDMA1_CH2>,
        eraser: Peri<'static, GPDMA1_CH3>,
    ) -> Self {
        let enable = Output::new(enable, Level::Low, Speed::Low);
        let mut dac = DacChannel::new_blocking(dac, output);
        // without a trigger yet, so that it is put out now
        dac.set(Value::Bit12Right(REST as u16));
        let mut drive = Self { feed: Feed::new(), started_at: 0, enable, _dac: dac, player, eraser };
        drive.start();
        drive
    }

    /// Starts player and eraser from the ring's beginning, right after an update of TIM2.
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

            // a whole period is left after its beginning, of which this needs a µs
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

    /// Whether both channels go round, and the DAC has never waited in vain. A DAC that has asks no
    /// more (RM0456, "DMA underrun") and keeps its last word: of that the capacitor behind it
    /// leaves nothing.
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

/// Ring to DAC, a word for each of the DAC's requests, round and round.
fn prepare_player(request: u8) {
    let ring = WORDS.0.get() as u32;
    let item = SHARED.player.get();
    let link = dma::link(item as u32, Carries::Source);
    // SAFETY: both channels are off, so that the DMA does not read the item; nobody else does.
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

/// Rest to ring, a word for each of TIM2's updates, [`TRAIL`] words behind the player: the first
/// time only to the ring's end.
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

//! Data that survive a reset: the last panic's message, and the count of starts of the controller,
//! which begins at a random number after a power cut.
//!
//! Both are in RAM that the start-up code does not initialise. After a power cut they are random,
//! which a checksum distinguishes from a valid record; after a reset by the watchdog or by software
//! they are unchanged. The random number comes from the RNG with its reset settings; embassy's
//! driver is not used, because it retries endlessly when the source fails, and a controller must
//! start without a random number too.

use core::mem::MaybeUninit;
use core::panic::PanicInfo;
use core::ptr::{addr_of, addr_of_mut};
use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use embassy_stm32::pac;
use embassy_stm32::pac::{RCC, RNG};
use heapless::String;
use jointrig_firmware::sentence::{Sentence, Tell};
use jointrig_protocol::answer::Reset;
use jointrig_protocol::limits::SENTENCE_BYTES;

/// Characters of a file's path kept for a panic: package, version and file for all packages in the
/// image.
const MOST_OF_A_PATH: usize = 60;
/// Marks a valid record ("JRIG").
const MAGIC: u32 = 0x4A52_4947;

/// The panic record: [`MAGIC`], the length, the bytes of the message and a checksum, all in words.
/// A volatile access to each byte would be a separate instruction: with bytes this took 2 kB of
/// flash.
type Record = [u32; RECORD_WORDS];
/// Words of the message.
const TEXT_WORDS: usize = SENTENCE_BYTES / 4;
const RECORD_WORDS: usize = TEXT_WORDS + 3;
const _: () = assert!(SENTENCE_BYTES.is_multiple_of(4));

#[derive(Clone, Copy)]
#[repr(C)]
struct Starts {
    count: u32,
    /// Random number drawn at power-on.
    first: u32,
    sum: u32,
}

impl Starts {
    fn due_sum(&self) -> u32 {
        !(self.count ^ self.first.rotate_left(16)) ^ MAGIC
    }
}

/// Identification of this start.
#[derive(Clone, Copy)]
pub struct Start {
    /// 1 after power-on, one more after every other reset.
    pub count: u32,
    /// One more after every reset, a different number after power-on.
    pub boot: u32,
}

// SAFETY of the section: both are plain numbers, for which any bytes are valid; nothing uses them
// as initialised before they were checked.
#[unsafe(link_section = ".uninit.jointrig_panic")]
static mut RECORD: MaybeUninit<Record> = MaybeUninit::uninit();
#[unsafe(link_section = ".uninit.jointrig_starts")]
static mut STARTS: MaybeUninit<Starts> = MaybeUninit::uninit();

/// FNV-1a by words: the probability that random data pass both this and the magic is 2^-64.
fn sum_of(record: &Record) -> u32 {
    record[1..RECORD_WORDS - 1]
        .iter()
        .fold(0x811C_9DC5, |sum, word| (sum ^ word).rotate_left(5).wrapping_mul(0x0100_0193))
}

/// Returns the message of the last run's panic, once.
pub fn take_panic() -> Option<String<SENTENCE_BYTES>> {
    let mut record = [0; RECORD_WORDS];
    let kept = addr_of_mut!(RECORD).cast::<u32>();
    for (place, word) in record.iter_mut().enumerate() {
        // SAFETY: called first in `main`, before any task or interrupt that could panic runs; the
        // volatile read accepts any content, stays inside the record, and any bytes are a valid
        // word.
        *word = unsafe { kept.add(place).read_volatile() };
    }
    // SAFETY: as above; this invalidates the record, so that it is returned only once.
    unsafe { kept.write_volatile(0) };
    if record[0] != MAGIC || record[RECORD_WORDS - 1] != sum_of(&record) {
        return None;
    }
    let words = record[2..2 + TEXT_WORDS].iter().flat_map(|word| word.to_le_bytes());
    String::from_utf8(words.take(record[1] as usize).collect()).ok()
}

/// The cause of this start, once: the flags are cleared, so that the next start reports its own
/// cause (RM0456, "RCC control/status register", `RCC_CSR`). Watchdog and software resets also
/// assert the reset pin, so the pin flag counts only without theirs.
pub fn take_reset() -> Reset {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    if flags.iwdgrstf() || flags.wwdgrstf() {
        Reset::Watchdog
    } else if flags.sftrstf() {
        Reset::Software
    } else if flags.borrstf() {
        // set at power-on and by a supply dip: the count of starts survives only the latter
        if has_counted() { Reset::Brownout } else { Reset::Power }
    } else if flags.pinrstf() {
        Reset::Pin
    } else {
        Reset::Unknown
    }
}

/// Whether the record of earlier starts is valid.
fn has_counted() -> bool {
    // SAFETY: as in `count_start`, which is called later.
    let before = unsafe { addr_of!(STARTS).cast::<Starts>().read_volatile() };
    before.sum == before.due_sum()
}

/// Counts this start; `draw` provides the first number after power-on.
pub fn count_start(draw: impl FnOnce() -> u32) -> Start {
    // SAFETY: called once in `main` before any task runs, and no interrupt uses it; any bytes are a
    // valid `Starts`.
    let before = unsafe { addr_of!(STARTS).cast::<Starts>().read_volatile() };
    let (count, first) = if before.sum == before.due_sum() {
        (before.count.wrapping_add(1), before.first)
    } else {
        (1, draw())
    };
    let mut now = Starts { count, first, sum: 0 };
    now.sum = now.due_sum();
    // SAFETY: as above.
    unsafe { addr_of_mut!(STARTS).cast::<Starts>().write_volatile(now) };
    Start { count, boot: first.wrapping_add(count).wrapping_sub(1) }
}

/// Switches the coil off, stores the message, and resets.
fn end(what: &Sentence) -> ! {
    cortex_m::interrupt::disable();
    pac::TIM1.bdtr().modify(|w| w.set_moe(false));
    let text = what.as_str().as_bytes();
    let mut record = [0; RECORD_WORDS];
    (record[0], record[1]) = (MAGIC, text.len() as u32);
    for (place, byte) in text.iter().enumerate() {
        record[2 + place / 4] |= u32::from(*byte) << (8 * (place % 4));
    }
    record[RECORD_WORDS - 1] = sum_of(&record);
    for (place, word) in record.iter().enumerate() {
        // SAFETY: interrupts are disabled and this function does not return, so that nothing else
        // uses the record; the access is inside it.
        unsafe { addr_of_mut!(RECORD).cast::<u32>().add(place).write_volatile(*word) };
    }
    cortex_m::asm::dsb();
    SCB::sys_reset()
}

/// Stores file and line, and the message if it needs no formatting: the code that formats numbers
/// would take 5 kB of flash, and the line identifies the numbers.
#[panic_handler]
fn panicked(info: &PanicInfo<'_>) -> ! {
    let mut sentence = Sentence::default();
    if let Some(at) = info.location() {
        // the end of a long path is more informative than its beginning
        let file = at.file();
        let from = file.len().saturating_sub(MOST_OF_A_PATH);
        sentence.text(file.get(from..).unwrap_or(file)).text(":").number(at.line()).text(": ");
    }
    end(sentence.text(info.message().as_str().unwrap_or("a panic whose message has numbers")))
}

#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    let mut sentence = Sentence::default();
    sentence.text("hard fault at ").hex(frame.pc(), 8).text(" from ").hex(frame.lr(), 8).text(": ");
    jointrig_board_fault::status().tell(&mut sentence);
    end(&sentence)
}

/// Number of polls before the source is considered failed: some ms; the first number takes 0.2 ms.
const LOOKS: u32 = 100_000;

/// Draws a number; `None` when the source reports an error or does not respond. The RNG is clocked
/// by HSI48, which `embassy_stm32::init` has started.
pub fn draw() -> Option<u32> {
    RCC.ahb2enr1().modify(|w| w.set_rngen(true));
    // the clock is active two cycles after the write (RM0456, "Peripheral clock enabling"); this
    // read waits for it
    let _ = RCC.ahb2enr1().read();
    RNG.cr().modify(|w| w.set_rngen(true));
    let mut drawn = None;
    for _ in 0..LOOKS {
        let status = RNG.sr().read();
        if status.seis() || status.ceis() {
            break;
        }
        if status.drdy() {
            // zero indicates an error that occurred between the two reads (RM0456, "RNG operation")
            drawn = Some(RNG.dr().read()).filter(|number| *number != 0);
            break;
        }
    }
    RNG.cr().modify(|w| w.set_rngen(false));
    RCC.ahb2enr1().modify(|w| w.set_rngen(false));
    drawn
}

//! The memory that this board shares with the simulator.

use core::ptr;

use jointrig_firmware::lockstep::{
    ASK_AT, BASE, BYTES, MAGIC, MAGIC_AT, REPLY_AT, RING_BYTES, TEXT_AT, TEXT_BYTES, WORDS,
};

/// Whether a simulator with the same memory layout serves the memory.
pub fn is_served() -> bool {
    let mut word = [0; 4];
    read(MAGIC_AT, &mut word);
    u32::from_le_bytes(word) == MAGIC
}

/// Copies bytes from the shared memory.
///
/// # Panics
/// Outside the shared memory.
pub fn read(at: usize, out: &mut [u8]) {
    assert!(at <= BYTES && out.len() <= BYTES - at, "outside the shared memory");
    // SAFETY: the range lies within the 16 MB at BASE, which is plain memory of this machine,
    // aligned for bytes and disjoint from everything that the linker placed, so it contains no Rust
    // object. The simulator writes only while this core is halted in a semihosting call, which the
    // compiler must assume to access the memory.
    unsafe { ptr::copy_nonoverlapping((BASE + at) as *const u8, out.as_mut_ptr(), out.len()) }
}

/// Passes the simulator's data to `f` without a copy; they are valid until this side ends its turn.
///
/// # Panics
/// Outside the shared memory.
pub fn look<R>(at: usize, length: usize, f: impl FnOnce(&[u8]) -> R) -> R {
    assert!(at <= BYTES && length <= BYTES - at, "outside the shared memory");
    // SAFETY: as in `read`; `f` takes no turn, so that nothing writes while the bytes are borrowed.
    f(unsafe { core::slice::from_raw_parts((BASE + at) as *const u8, length) })
}

/// Copies bytes to the shared memory.
///
/// # Panics
/// Outside the shared memory.
pub fn write(at: usize, bytes: &[u8]) {
    assert!(at <= BYTES && bytes.len() <= BYTES - at, "outside the shared memory");
    // SAFETY: as in `read`; nothing else writes during this core's turn.
    unsafe { ptr::copy_nonoverlapping(bytes.as_ptr(), (BASE + at) as *mut u8, bytes.len()) }
}

/// Writes the words of an ask.
pub fn write_ask(words: &[u32; WORDS]) {
    let to = (BASE + ASK_AT) as *mut u32;
    for (i, word) in words.iter().enumerate() {
        // SAFETY: as in `read`, and aligned for words; volatile, because the simulator reads it.
        unsafe { to.add(i).write_volatile(*word) }
    }
}

/// Reads the words of a reply.
pub fn read_reply() -> [u32; WORDS] {
    let from = (BASE + REPLY_AT) as *const u32;
    core::array::from_fn(|i| {
        // SAFETY: as in `write_ask`.
        unsafe { from.add(i).read_volatile() }
    })
}

/// Writes a message and returns the length written, which may be truncated.
pub fn write_text(text: &[u8]) -> u32 {
    let length = text.len().min(TEXT_BYTES);
    write(TEXT_AT, &text[..length]);
    length as u32
}

/// Copies from a ring, starting at a byte count.
pub fn read_ring(ring: usize, from: u32, out: &mut [u8]) {
    let at = from % RING_BYTES;
    let first = out.len().min((RING_BYTES - at) as usize);
    let (head, rest) = out.split_at_mut(first);
    read(ring + at as usize, head);
    read(ring, rest);
}

/// Copies into a ring, starting at a byte count.
pub fn write_ring(ring: usize, from: u32, bytes: &[u8]) {
    let at = from % RING_BYTES;
    let first = bytes.len().min((RING_BYTES - at) as usize);
    let (head, rest) = bytes.split_at(first);
    write(ring + at as usize, head);
    write(ring, rest);
}

//! Tunes the system's allocator for short-lived signals and matrices.

/// Half of the total size of the signals of several records, or of the matrices of one step of the
/// fit, bytes. A larger value would keep more memory idle than an analysis gains from it.
const BLOCK_BYTES: usize = 7 << 20;

/// glibc returns memory to the system when twice the size of the largest block freed so far is
/// idle, so each record's signals would be paged in again, which takes a tenth of an analysis.
/// Freeing this block raises that threshold (`mallopt(3)`, dynamic threshold); other allocators are
/// not affected.
pub fn expect_signals() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(BLOCK_BYTES)));
}

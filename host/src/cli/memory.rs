//! How the system's allocator treats the signals of one record after another.

/// More than a signal of a record takes: 0.8 MB for two seconds at 51.2 kHz.
const BLOCK_BYTES: usize = 4 << 20;

/// glibc gives memory back to the system when some more than the largest block that was ever freed lies idle, so that each record's signals
/// would be paged in anew, which takes a tenth of an analysis. It learns from this block that such sizes come and go (`mallopt(3)`,
/// dynamic threshold); other allocators are not impressed.
pub fn expect_signals() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(BLOCK_BYTES)));
}

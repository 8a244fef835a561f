//! How the system's allocator treats signals and matrices that come and go.

/// Half of what the signals of several records, or the matrices of one step of the fit, take together. More would be held idle than an analysis
/// gains by it.
const BLOCK_BYTES: usize = 7 << 20;

/// glibc gives memory back to the system when twice the largest block that was ever freed lies idle, so that each record's signals
/// would be paged in anew, which takes a tenth of an analysis. It learns from this block that such sizes come and go (`mallopt(3)`,
/// dynamic threshold); other allocators are not impressed.
pub fn expect_signals() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(BLOCK_BYTES)));
}

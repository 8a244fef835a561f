//! A block of scans as the hammer and the shaker look at it.

/// One block of codes, as the machine reads it.
pub trait Scanned {
    /// Index of the first scan.
    fn first_scan(&self) -> u64;
    /// How many scans.
    fn scans(&self) -> usize;
    /// The code of a channel in the `scan`-th scan.
    fn code(&self, scan: usize, channel: usize) -> i16;
}

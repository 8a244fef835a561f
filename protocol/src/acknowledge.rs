//! The host's cumulative acknowledgement: 12 bytes, little-endian. It also serves as the host's
//! sign of life.

/// Everything before `next_scan` of stream `epoch` has arrived and need not be kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Acknowledge {
    /// The stream's session epoch.
    pub epoch: u32,
    /// The first scan that has not arrived yet.
    pub next_scan: u64,
}

/// Encoded length in bytes.
pub const BYTES: usize = 12;

impl Acknowledge {
    /// Encodes epoch (u32), then next scan (u64).
    #[must_use]
    pub fn to_bytes(&self) -> [u8; BYTES] {
        let mut out = [0; BYTES];
        out[..4].copy_from_slice(&self.epoch.to_le_bytes());
        out[4..].copy_from_slice(&self.next_scan.to_le_bytes());
        out
    }

    /// Decodes; `None` unless exactly [`BYTES`] long.
    #[must_use]
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let b: &[u8; BYTES] = bytes.try_into().ok()?;
        Some(Self {
            epoch: u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
            next_scan: u64::from_le_bytes([b[4], b[5], b[6], b[7], b[8], b[9], b[10], b[11]]),
        })
    }
}

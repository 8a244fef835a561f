//! The handshake, with a permanently frozen layout: 32 bytes, little-endian, the first frame in
//! each direction.
//!
//! | offset | bytes | field |
//! |---|---|---|
//! | 0 | 4 | magic `JRIG` |
//! | 4 | 2 | major |
//! | 6 | 2 | minor |
//! | 8 | 8 | schema hash |
//! | 16 | 2 | longest frame before COBS |
//! | 18 | 1 | most channels |
//! | 19 | 1 | role: 0 host, 1 device |
//! | 20 | 4 | session: chosen by the host, echoed by the device |
//! | 24 | 4 | boot: the device's count of its own starts (0 from a host) |
//! | 28 | 4 | ring: scans the device can send again (0 from a host) |
//!
//! Later versions may append bytes; a reader uses the first 32 bytes. So far one byte is appended,
//! at offset 32. Its bit 0 concerns packets ([`crate::packet`]). From a host: it can read them.
//! From a device: it sends packets in this session, except this Hello.
//!
//! A session starts with a host's Hello with a new session number; the device then discards the
//! stored replies to earlier sessions' requests.

use crate::{limits, schema};

/// Magic bytes that start every Hello.
pub const MAGIC: [u8; 4] = *b"JRIG";

/// Length of the frozen part.
pub const BYTES: usize = limits::HELLO_BYTES;

/// Length including the appended byte.
pub const LONG_BYTES: usize = BYTES + 1;

/// Bit 0 of the byte after the frozen part.
const PACKETS: u8 = 1;

/// Which end sent the Hello.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// The host.
    Host,
    /// The rig's controller.
    Device,
}

/// The Hello of one end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hello {
    /// Major version; both ends must have the same.
    pub major: u16,
    /// Minor version; the lower of the two is used.
    pub minor: u16,
    /// Hash of every type and layout on the wire ([`schema::HASH`]).
    pub schema: u64,
    /// Longest frame before COBS, in bytes.
    pub max_frame: u16,
    /// Most channels in a scan.
    pub max_channels: u8,
    /// Which end sent it.
    pub role: Role,
    /// Chosen by the host, echoed by the device.
    pub session: u32,
    /// The device's count of its starts; also the session epoch of its first stream.
    pub boot: u32,
    /// Scans that the device can retransmit.
    pub ring_scans: u32,
    /// From a host: it can read packets. From a device: it sends packets.
    pub packets: bool,
}

/// Why two ends are incompatible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mismatch {
    /// Not a Hello at all.
    NotHello,
    /// Both ends have the same role.
    Role,
    /// Different majors: (ours, theirs).
    Major(u16, u16),
    /// Same version, different schema: ((major, minor), ours, theirs).
    Schema((u16, u16), u64, u64),
}

impl core::fmt::Display for Mismatch {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::NotHello => f.write_str("the other end does not speak jointrig's protocol"),
            Self::Role => {
                f.write_str("the other end plays the same role as this one (two hosts, or two devices)")
            }
            Self::Major(ours, theirs) => write!(
                f,
                "protocol version {ours} here, {theirs} there: flash the firmware that belongs to this program"
            ),
            Self::Schema((major, minor), ours, theirs) => write!(
                f,
                "protocol {major}.{minor} on both ends, but schema {ours:016x} here and {theirs:016x} there: \
                 the two were built from different sources; flash the firmware that belongs to this program"
            ),
        }
    }
}

impl core::error::Error for Mismatch {}

impl Hello {
    /// The Hello of a host with this build's version.
    #[must_use]
    pub const fn host(session: u32) -> Self {
        Self {
            major: schema::MAJOR,
            minor: schema::MINOR,
            schema: schema::HASH,
            max_frame: limits::MAX_FRAME as u16,
            max_channels: limits::MAX_CHANNELS as u8,
            role: Role::Host,
            session,
            boot: 0,
            ring_scans: 0,
            packets: false,
        }
    }

    /// The Hello of a device with this build's version.
    #[must_use]
    pub const fn device(session: u32, boot: u32, ring_scans: u32) -> Self {
        Self { role: Role::Device, boot, ring_scans, ..Self::host(session) }
    }

    /// The 32 frozen bytes and the appended byte.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; LONG_BYTES] {
        let mut out = [0; LONG_BYTES];
        out[0..4].copy_from_slice(&MAGIC);
        out[4..6].copy_from_slice(&self.major.to_le_bytes());
        out[6..8].copy_from_slice(&self.minor.to_le_bytes());
        out[8..16].copy_from_slice(&self.schema.to_le_bytes());
        out[16..18].copy_from_slice(&self.max_frame.to_le_bytes());
        out[18] = self.max_channels;
        out[19] = u8::from(self.role == Role::Device);
        out[20..24].copy_from_slice(&self.session.to_le_bytes());
        out[24..28].copy_from_slice(&self.boot.to_le_bytes());
        out[28..32].copy_from_slice(&self.ring_scans.to_le_bytes());
        out[32] = if self.packets { PACKETS } else { 0 };
        out
    }

    /// Decodes the frozen part and the known appended bytes. Bytes appended by later versions are
    /// ignored; bytes that an earlier version did not have may be missing.
    ///
    /// # Errors
    /// [`Mismatch::NotHello`] when it is too short, has another magic, or an unknown role.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Mismatch> {
        let b = bytes.first_chunk::<BYTES>().ok_or(Mismatch::NotHello)?;
        if b[0..4] != MAGIC {
            return Err(Mismatch::NotHello);
        }
        let role = match b[19] {
            0 => Role::Host,
            1 => Role::Device,
            _ => return Err(Mismatch::NotHello),
        };
        Ok(Self {
            major: u16::from_le_bytes([b[4], b[5]]),
            minor: u16::from_le_bytes([b[6], b[7]]),
            schema: u64::from_le_bytes([b[8], b[9], b[10], b[11], b[12], b[13], b[14], b[15]]),
            max_frame: u16::from_le_bytes([b[16], b[17]]),
            max_channels: b[18],
            role,
            session: u32::from_le_bytes([b[20], b[21], b[22], b[23]]),
            boot: u32::from_le_bytes([b[24], b[25], b[26], b[27]]),
            ring_scans: u32::from_le_bytes([b[28], b[29], b[30], b[31]]),
            packets: bytes.get(BYTES).is_some_and(|bits| bits & PACKETS != 0),
        })
    }

    /// Checks whether `self` (ours) is compatible with `theirs`, and returns the common minor
    /// version.
    ///
    /// # Errors
    /// The [`Mismatch`]; for versions and schemas it contains both values.
    pub fn check(&self, theirs: &Self) -> Result<u16, Mismatch> {
        if self.role == theirs.role {
            return Err(Mismatch::Role);
        }
        if self.major != theirs.major {
            return Err(Mismatch::Major(self.major, theirs.major));
        }
        if self.minor == theirs.minor && self.schema != theirs.schema {
            return Err(Mismatch::Schema((self.major, self.minor), self.schema, theirs.schema));
        }
        Ok(self.minor.min(theirs.minor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_negotiated_or_refused_by_name() {
        let host = Hello::host(7);
        let device = Hello::device(7, 3, 64_000);
        assert_eq!(host.check(&device), Ok(schema::MINOR));
        assert_eq!(host.check(&host), Err(Mismatch::Role));
        let newer = Hello { minor: device.minor + 1, schema: 1, ..device };
        assert_eq!(host.check(&newer), Ok(schema::MINOR), "another minor may have another schema");
        let other = Hello { schema: 1, ..device };
        assert!(matches!(host.check(&other), Err(Mismatch::Schema(_, ours, 1)) if ours == schema::HASH));
        let major = Hello { major: 9, ..device };
        assert_eq!(host.check(&major), Err(Mismatch::Major(schema::MAJOR, 9)));
    }

    #[test]
    fn appended_bytes_of_later_versions_are_ignored() {
        let device = Hello::device(1, 2, 3);
        let mut long = [0xAA; BYTES + 9];
        long[..LONG_BYTES].copy_from_slice(&device.to_bytes());
        assert_eq!(Hello::from_bytes(&long), Ok(device));
        assert_eq!(Hello::from_bytes(&long[..BYTES]), Ok(device), "earlier versions end here");
        assert_eq!(Hello::from_bytes(&long[..BYTES - 1]), Err(Mismatch::NotHello));
        let packets = Hello { packets: true, ..device };
        assert_eq!(Hello::from_bytes(&packets.to_bytes()), Ok(packets));
        assert_eq!(Hello::from_bytes(&packets.to_bytes()[..BYTES]), Ok(device));
    }
}

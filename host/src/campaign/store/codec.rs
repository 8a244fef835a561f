//! Samples as bytes in the file: one pco chunk per channel, lossless, with a CRC-32 over the raw
//! codes.
//!
//! The blob is, for each channel, the chunk's length (u32, little-endian) and the chunk; a chunk is
//! a standalone pco file of `i16`. From Python: `pcodec.standalone.simple_decompress(chunk)`.
//! `docs/compare_codecs.py` compares pco with zstd on a campaign's records. On the paper's
//! campaign, simulated: pco 3.5 : 1; zstd at most 2.9 : 1 (level 19, a hundred times slower), and
//! 2.6 : 1 at the level that is as fast as pco (3). Byte-wise preprocessing before zstd
//! (differences, separate low bytes) makes it worse: the low byte is noise.
//!
//! The CRC-32 (zlib's) runs over the codes as little-endian i16, channel after channel.

use pco::standalone::{simple_compress, simple_decompress_into};
use pco::{ChunkConfig, DeltaSpec, ModeSpec};
use rayon::prelude::*;
use std::cell::Cell;

/// Vibration is mostly noise on a slow ring-down: with second differences and the classic mode
/// fixed, the result is as small as with pco's own choice, in half the time.
fn config() -> ChunkConfig {
    ChunkConfig::default()
        .with_compression_level(6)
        .with_mode_spec(ModeSpec::Classic)
        .with_delta_spec(DeltaSpec::Auto)
}

/// Samples up to this many bytes are unpacked whatever their compression ratio, …
const ALWAYS_BYTES: usize = 64 << 20;
/// … and larger ones up to this ratio: noise does not compress better.
const MOST_RATIO: usize = 16;

thread_local! {
    /// Buffer for one channel, reused because fresh memory for each record costs a tenth of
    /// unpacking it.
    static SPARE: Cell<Vec<i16>> = const { Cell::new(Vec::new()) };
}

/// Why a blob could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CodecError {
    /// The compressor refused.
    #[error("compression: {0}")]
    Pco(#[from] pco::errors::PcoError),
    /// The blob ends within a channel, has bytes left over, or its channels differ in length.
    #[error("there are too few or too many bytes of samples")]
    Shape,
    /// The row claims far more samples than its bytes can hold.
    #[error("{blob} bytes cannot hold {channels} channels of {scans} samples")]
    Bomb {
        /// Channels, according to the row.
        channels: usize,
        /// Samples of each, according to the row.
        scans: usize,
        /// Size of the blob, bytes.
        blob: usize,
    },
    /// The file system or the file's structure prevents reading.
    #[error("the samples cannot be read: {0}")]
    Unreadable(String),
    /// The bytes differ from those that were stored.
    #[error("checksum of the stored bytes {found:08x}, should be {stored:08x}")]
    Bytes {
        /// Checksum of the bytes read.
        found: u32,
        /// Checksum of the bytes stored.
        stored: u32,
    },
    /// The codes differ from those that were stored.
    #[error("checksum {found:08x}, stored {stored:08x}")]
    Checksum {
        /// Checksum of the codes read.
        found: u32,
        /// Checksum of the codes stored.
        stored: u32,
    },
}

/// Compresses codes (channel after channel, `channels` of equal length).
///
/// # Errors
/// The compressor refused.
pub fn encode(codes: &[i16], channels: usize) -> Result<Vec<u8>, CodecError> {
    let scans = codes.len().checked_div(channels).unwrap_or(0);
    let config = config();
    let mut blob = Vec::new();
    for channel in codes.chunks_exact(scans.max(1)) {
        let chunk = simple_compress(channel, &config)?;
        let length = u32::try_from(chunk.len()).map_err(|_| CodecError::Shape)?;
        blob.extend(length.to_le_bytes());
        blob.extend(chunk);
    }
    Ok(blob)
}

/// Reads codes back and compares their checksum with the stored one.
///
/// # Errors
/// The blob is damaged.
pub fn decode(blob: &[u8], channels: usize, scans: usize, stored: u32) -> Result<Vec<i16>, CodecError> {
    let chunks = chunks(blob, channels, scans)?;
    let mut codes = vec![0; chunks.len() * scans];
    let channel = scans.max(1);
    if rayon::current_thread_index().is_some() {
        // called from a worker: other records are being read in parallel, so no nested parallelism
        for (chunk, channel) in chunks.into_iter().zip(codes.chunks_exact_mut(channel)) {
            unpack(chunk, channel)?;
        }
    } else {
        // a single record: all cores unpack its channels in parallel
        let parts = chunks.into_par_iter().zip(codes.par_chunks_exact_mut(channel));
        parts.try_for_each(|(chunk, channel)| unpack(chunk, channel))?;
    }
    let found = checksum(&codes);
    if found == stored { Ok(codes) } else { Err(CodecError::Checksum { found, stored }) }
}

/// Passes the codes of some channels to `look`, each with its index, in the order of `places`; an
/// empty slice for an index beyond the last channel. The checksum over all codes cannot be compared
/// here: the caller has compared that of the blob.
///
/// # Errors
/// The blob is damaged. `look` may have been called for some channels by then.
pub fn decode_each(
    blob: &[u8],
    channels: usize,
    scans: usize,
    places: &[usize],
    mut look: impl FnMut(usize, &[i16]),
) -> Result<(), CodecError> {
    let chunks = chunks(blob, channels, scans)?;
    let mut codes = SPARE.take();
    codes.resize(scans, 0);
    for place in places {
        match chunks.get(*place) {
            Some(chunk) => {
                unpack(chunk, &mut codes)?;
                look(*place, &codes);
            }
            None => look(*place, &[]),
        }
    }
    SPARE.set(codes);
    Ok(())
}

/// The chunk of each channel; empty for a shot without contact, which has no samples.
fn chunks(blob: &[u8], channels: usize, scans: usize) -> Result<Vec<&[u8]>, CodecError> {
    let bytes = channels.checked_mul(scans).and_then(|codes| codes.checked_mul(2));
    let most = ALWAYS_BYTES + MOST_RATIO * blob.len();
    if bytes.is_none_or(|bytes| bytes > most) {
        return Err(CodecError::Bomb { channels, scans, blob: blob.len() });
    }
    let (mut chunks, mut rest) = (Vec::new(), blob);
    for _ in 0..if scans == 0 { 0 } else { channels } {
        let (length, after) = rest.split_first_chunk::<4>().ok_or(CodecError::Shape)?;
        let (chunk, after) =
            after.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or(CodecError::Shape)?;
        chunks.push(chunk);
        rest = after;
    }
    if rest.is_empty() { Ok(chunks) } else { Err(CodecError::Shape) }
}

fn unpack(chunk: &[u8], channel: &mut [i16]) -> Result<(), CodecError> {
    let read = simple_decompress_into(chunk, channel)?;
    if read.finished && read.n_processed == channel.len() { Ok(()) } else { Err(CodecError::Shape) }
}

/// CRC-32 of the codes as little-endian bytes.
pub fn checksum(codes: &[i16]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    let mut bytes = [0; 4096];
    for part in codes.chunks(bytes.len() / 2) {
        for (pair, code) in bytes.as_chunks_mut::<2>().0.iter_mut().zip(part) {
            *pair = code.to_le_bytes();
        }
        hasher.update(&bytes[..2 * part.len()]);
    }
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_codes_come_back_and_any_flipped_bit_is_found() {
        let codes: Vec<i16> = (0..3_000_i64).map(|i| ((i * i * 7919 + i) % 65_536 - 32_768) as i16).collect();
        let crc = checksum(&codes);
        let blob = encode(&codes, 3).expect("compresses");
        assert_eq!(decode(&blob, 3, 1_000, crc).expect("reads"), codes);
        let mut some = Vec::new();
        decode_each(&blob, 3, 1_000, &[2, 0, 3], |place, own| some.push((place, own.to_vec())))
            .expect("reads");
        assert_eq!(some, [(2, codes[2_000..].to_vec()), (0, codes[..1_000].to_vec()), (3, Vec::new())]);
        assert!(decode(&blob, 3, 1_000, crc ^ 1).is_err());
        assert!(decode(&blob[..blob.len() - 1], 3, 1_000, crc).is_err());
        for place in (0..blob.len()).step_by(97) {
            let mut bad = blob.clone();
            bad[place] ^= 0x10;
            // a padding bit may be unused; then the codes are intact (and the checksum over the
            // stored bytes is not)
            if let Ok(read) = decode(&bad, 3, 1_000, crc) {
                assert_eq!(read, codes);
            }
        }
        // chunks that are longer or shorter than the row claims
        assert!(matches!(decode(&blob, 3, 999, crc), Err(CodecError::Shape)));
        assert!(matches!(decode(&blob, 3, 1_001, crc), Err(CodecError::Shape)));
        assert!(matches!(decode(&blob, 2, 1_000, crc), Err(CodecError::Shape)));
        // and sizes beyond any memory
        for (channels, scans) in
            [(usize::MAX, 2), (2, usize::MAX / 2), (1_000_000_000, 1_000_000_000), (16, 1 << 30)]
        {
            assert!(matches!(decode(&blob, channels, scans, crc), Err(CodecError::Bomb { .. })));
        }
        let empty = encode(&[], 10).expect("nothing");
        assert!(decode(&empty, 10, 0, 0).expect("nothing").is_empty());
    }

    #[test]
    fn the_checksum_is_zlibs() {
        assert_eq!(checksum(&[0x3231, 0x3433, 0x3635, 0x3837]), crc32fast::hash(b"12345678"));
    }
}

//! Samples as bytes in the file: one pco chunk per channel, lossless, with a CRC-32 over the raw
//! samples.
//!
//! The blob is, for each channel, the chunk's length (u32, little-endian) and the chunk; a chunk is
//! a standalone pco file of the channel's type. From Python:
//! `pcodec.standalone.simple_decompress(chunk)`.
//! `docs/compare_codecs.py` compares pco with zstd on a campaign's records. On the paper's
//! campaign, simulated, 16-bit codes: pco 3.5 : 1; zstd at most 2.9 : 1 (level 19, a hundred times
//! slower), and 2.6 : 1 at the level that is as fast as pco (3). Byte-wise preprocessing before
//! zstd (differences, separate low bytes) makes it worse: the low byte is noise.
//!
//! The CRC-32 (zlib's) runs over the samples as little-endian bytes, channel after channel.
//! Floating-point samples are finite: others are neither stored nor read.

use pco::data_types::Number;
use pco::standalone::{simple_compress, simple_decompress_into};
use pco::{ChunkConfig, DeltaSpec, ModeSpec};
use rayon::prelude::*;
use std::cell::Cell;

use crate::device::samples::{ChannelSamples, ChannelView, SampleType, Samples, each_type};

/// Vibration is mostly noise on a slow ring-down: with second differences and the classic mode
/// fixed, 16-bit codes become as small as with pco's own choice, in half the time. Wider samples
/// may be multiples of a step (a converter's, in units of the sensor), which pco finds.
fn config(of: SampleType) -> ChunkConfig {
    let mode = if of == SampleType::I16 { ModeSpec::Classic } else { ModeSpec::Auto };
    ChunkConfig::default().with_compression_level(6).with_mode_spec(mode).with_delta_spec(DeltaSpec::Auto)
}

/// Samples up to this many bytes are unpacked whatever their compression ratio, …
const ALWAYS_BYTES: usize = 64 << 20;
/// … and larger ones up to this ratio: noise does not compress better.
const MOST_RATIO: usize = 16;

thread_local! {
    /// Buffer for one channel, reused because fresh memory for each record costs a tenth of
    /// unpacking it.
    static SPARE: Cell<ChannelSamples> = const { Cell::new(ChannelSamples::empty(SampleType::I16)) };
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
    /// The row names more or fewer types than it has channels.
    #[error("{channels} channels of samples with the types of {named}")]
    Types {
        /// Channels, according to the row.
        channels: usize,
        /// Types that it names.
        named: usize,
    },
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
    /// A sample is not a number or infinite.
    #[error("sample {sample} of channel {channel} (both from 0) is not a finite number")]
    NotFinite {
        /// Index of the channel.
        channel: usize,
        /// Index of the sample.
        sample: usize,
    },
    /// The bytes differ from those that were stored.
    #[error("checksum of the stored bytes {found:08x}, should be {stored:08x}")]
    Bytes {
        /// Checksum of the bytes read.
        found: u32,
        /// Checksum of the bytes stored.
        stored: u32,
    },
    /// The samples differ from those that were stored.
    #[error("checksum {found:08x}, stored {stored:08x}")]
    Checksum {
        /// Checksum of the samples read.
        found: u32,
        /// Checksum of the samples stored.
        stored: u32,
    },
}

/// Compresses the samples of a record.
///
/// # Errors
/// A sample is not finite, or the compressor refused.
pub fn encode(samples: &Samples) -> Result<Vec<u8>, CodecError> {
    let mut blob = Vec::new();
    for (place, channel) in samples.each().enumerate().filter(|(_, channel)| !channel.is_empty()) {
        finite(place, channel)?;
        let config = config(channel.of());
        let chunk = each_type!(ChannelView, channel, samples => simple_compress(samples, &config))?;
        let length = u32::try_from(chunk.len()).map_err(|_| CodecError::Shape)?;
        blob.extend(length.to_le_bytes());
        blob.extend(chunk);
    }
    Ok(blob)
}

fn finite(channel: usize, samples: ChannelView<'_>) -> Result<(), CodecError> {
    samples.not_finite().map_or(Ok(()), |sample| Err(CodecError::NotFinite { channel, sample }))
}

/// Reads the samples of channels of these types back and compares their checksum with the stored
/// one.
///
/// # Errors
/// The blob is damaged.
pub fn decode(blob: &[u8], types: &[SampleType], scans: usize, stored: u32) -> Result<Samples, CodecError> {
    let chunks = chunks(blob, types, scans)?;
    let one = |(place, (of, chunk)): (usize, (SampleType, &[u8]))| {
        let mut channel = ChannelSamples::empty(of);
        unpack(place, chunk, of, scans, &mut channel)?;
        Ok(channel)
    };
    let channels: Result<Vec<ChannelSamples>, CodecError> = if rayon::current_thread_index().is_some() {
        // called from a worker: other records are being read in parallel, so no nested parallelism
        chunks.into_iter().enumerate().map(one).collect()
    } else {
        // a single record: all cores unpack its channels in parallel
        chunks.into_par_iter().enumerate().map(one).collect()
    };
    let samples = Samples::new(channels?).ok_or(CodecError::Shape)?;
    let found = checksum(&samples);
    if found == stored { Ok(samples) } else { Err(CodecError::Checksum { found, stored }) }
}

/// Passes the samples of some channels to `look`, each with its index, in the order of `places`; an
/// empty slice for an index beyond the last channel. The checksum over all samples cannot be
/// compared here: the caller has compared that of the blob.
///
/// # Errors
/// The blob is damaged. `look` may have been called for some channels by then.
pub fn decode_each(
    blob: &[u8],
    types: &[SampleType],
    scans: usize,
    places: &[usize],
    mut look: impl FnMut(usize, ChannelView<'_>),
) -> Result<(), CodecError> {
    let chunks = chunks(blob, types, scans)?;
    let mut channel = SPARE.replace(ChannelSamples::empty(SampleType::I16));
    for place in places {
        match chunks.get(*place) {
            Some((of, chunk)) => {
                unpack(*place, chunk, *of, scans, &mut channel)?;
                look(*place, channel.view());
            }
            None => look(*place, ChannelView::I16(&[])),
        }
    }
    SPARE.set(channel);
    Ok(())
}

/// Type and chunk of each channel. A shot without contact has no samples, and no chunks in the
/// blob.
fn chunks<'b>(
    blob: &'b [u8],
    types: &[SampleType],
    scans: usize,
) -> Result<Vec<(SampleType, &'b [u8])>, CodecError> {
    let bytes = types.iter().map(|of| of.bytes()).sum::<usize>().checked_mul(scans);
    let most = ALWAYS_BYTES + MOST_RATIO * blob.len();
    if bytes.is_none_or(|bytes| bytes > most) {
        return Err(CodecError::Bomb { channels: types.len(), scans, blob: blob.len() });
    }
    let (mut chunks, mut rest) = (Vec::new(), blob);
    for of in types {
        if scans == 0 {
            chunks.push((*of, &[][..]));
            continue;
        }
        let (length, after) = rest.split_first_chunk::<4>().ok_or(CodecError::Shape)?;
        let (chunk, after) =
            after.split_at_checked(u32::from_le_bytes(*length) as usize).ok_or(CodecError::Shape)?;
        chunks.push((*of, chunk));
        rest = after;
    }
    if rest.is_empty() { Ok(chunks) } else { Err(CodecError::Shape) }
}

/// Unpacks the chunk of the channel at `place` into `channel`, whose memory is reused.
fn unpack(
    place: usize,
    chunk: &[u8],
    of: SampleType,
    scans: usize,
    channel: &mut ChannelSamples,
) -> Result<(), CodecError> {
    if channel.view().of() != of {
        *channel = ChannelSamples::empty(of);
    }
    each_type!(ChannelSamples, channel, samples => unpack_as(chunk, scans, samples))?;
    finite(place, channel.view())
}

fn unpack_as<T: Number + Default>(
    chunk: &[u8],
    scans: usize,
    samples: &mut Vec<T>,
) -> Result<(), CodecError> {
    samples.resize(scans, T::default());
    if scans == 0 {
        return Ok(());
    }
    let read = simple_decompress_into(chunk, samples)?;
    if read.finished && read.n_processed == scans { Ok(()) } else { Err(CodecError::Shape) }
}

/// CRC-32 of the samples as little-endian bytes.
pub fn checksum(samples: &Samples) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    let mut bytes = [0; 4096];
    for channel in samples.each() {
        each_type!(ChannelView, channel, samples => {
            // a size known to the compiler makes the copy of a sample one instruction
            let size = bytes_of_each(samples);
            for part in samples.chunks(bytes.len() / size) {
                for (to, sample) in bytes.chunks_exact_mut(size).zip(part) {
                    to.copy_from_slice(&sample.to_le_bytes());
                }
                hasher.update(&bytes[..size * part.len()]);
            }
        });
    }
    hasher.finalize()
}

const fn bytes_of_each<T>(_: &[T]) -> usize {
    size_of::<T>()
}

#[cfg(test)]
#[path = "codec_tests.rs"]
mod tests;
#[cfg(test)]
pub(super) use tests::{any_channel, bits};

//! Arrays in npz archives, read and written: the layer that the FRF and record files share.
//!
//! Reading accepts real, complex and text arrays of any numpy width, in either byte order and
//! either memory order, and always returns C order and the widest type. Every error names the file,
//! the array and what was expected of it. Values are read as a stream. The memory for all that is
//! read of one file is bounded by the file's size, because a few compressed bytes may expand to a
//! billion zeros. An untrusted zip archive is opened only if its list of members is of a bounded
//! length.
//!
//! Writing produces float64, complex128 and unicode, in C order.

use super::npy_header::Header;
use super::units;
use super::units::{Unit, UnitError};
use crate::{advice, untrusted_input};
use memchr::memmem;
use npyz::npz::{array_name_from_file_name, file_name_from_array_name};
use npyz::{DType, WriteOptions, WriterBuilder};
use num_complex::Complex;
use std::borrow::Borrow;
use std::fs::File;
use std::io;
use std::io::{BufReader, BufWriter, ErrorKind, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// An array in C order: the last index runs fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Array<T> {
    /// Length of each axis; empty for a scalar.
    pub shape: Vec<usize>,
    /// The values.
    pub values: Vec<T>,
}

/// An npz file open for reading.
pub struct NpzFile {
    path: PathBuf,
    archive: ZipArchive<BufReader<File>>,
    size: u64,
    /// Bytes of memory that arrays of this file may still take.
    left: u64,
}

/// Bytes that a string takes in memory in addition to its characters.
const NAME: u64 = 56;

/// Most bytes that a compressed byte can become (RFC 1951: 258 for two bits).
const DEFLATES: u64 = 1032;

/// Bytes of the pieces in which values are read.
const PIECE: usize = 1 << 16;

impl NpzFile {
    /// Opens the archive; arrays are read on demand.
    ///
    /// # Errors
    /// [`NpzError::Open`].
    pub fn open(path: &Path) -> Result<Self, NpzError> {
        let (archive, size) = open(path).map_err(|source| NpzError::Open { path: path.into(), source })?;
        Ok(NpzFile { path: path.into(), archive, size, left: untrusted_input::memory_for(size) })
    }

    /// Allows arrays that take up to `bytes` of memory, for a file whose contents are described
    /// elsewhere; no file holds more than its size can expand to.
    #[must_use]
    pub fn allowing(mut self, bytes: u64) -> Self {
        self.left = self.left.max(bytes.min(self.size.saturating_mul(DEFLATES)));
        self
    }

    /// Counts the memory that `array` is about to take in the form in which it is returned.
    ///
    /// # Errors
    /// [`NpzError::Unexpected`] when this exceeds the limit for a file of this size.
    pub fn charge(&mut self, array: &str, count: usize, each: u64, expected: &str) -> Result<(), NpzError> {
        let bytes = (count as u64).saturating_mul(each);
        if let Some(left) = self.left.checked_sub(bytes) {
            self.left = left;
            return Ok(());
        }
        let found = format!(
            "would take {} of memory, but the arrays of a file of {} may take only {} in all: split it, or store it \
             uncompressed and as floats (np.savez)",
            untrusted_input::megabytes(bytes),
            untrusted_input::megabytes(self.size),
            untrusted_input::megabytes(untrusted_input::memory_for(self.size)),
        );
        Err(self.unexpected(array, &found, expected))
    }

    /// Whether the file has an array of this name.
    pub fn has(&self, array: &str) -> bool {
        self.archive.index_for_name(&file_name_from_array_name(array)).is_some()
    }

    /// The file's path, for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A content error of this file.
    pub fn content(&self, reason: impl Into<String>) -> NpzError {
        NpzError::Content { path: self.path.clone(), reason: reason.into() }
    }

    /// A real array (float or integer of any width) as f64.
    ///
    /// # Errors
    /// When it is missing, complex, text, or damaged.
    pub fn real(&mut self, array: &str, expected: &str) -> Result<Array<f64>, NpzError> {
        let mut complex = false;
        let found = self.numbers(array, expected, 8, |value| {
            complex |= value.im != 0.0;
            value.re
        })?;
        if complex { Err(self.unexpected(array, "is complex", expected)) } else { Ok(found) }
    }

    /// Reads one real number: a scalar array, or one of length one.
    ///
    /// # Errors
    /// As [`NpzFile::real`]; also when it has several values or none, or is not finite.
    pub fn number(&mut self, array: &str, expected: &str) -> Result<f64, NpzError> {
        let real = self.real(array, expected)?;
        match real.values[..] {
            [value] if value.is_finite() => Ok(value),
            [value] => Err(self.unexpected(array, &format!("is {value}"), expected)),
            _ => Err(self.unexpected(array, &format!("has {} values", real.values.len()), expected)),
        }
    }

    /// A complex (or real) array as `Complex<f64>`.
    ///
    /// # Errors
    /// When it is missing, text, or damaged.
    pub fn complex(&mut self, array: &str, expected: &str) -> Result<Array<Complex<f64>>, NpzError> {
        self.numbers(array, expected, 16, |value| value)
    }

    /// Reads numbers and converts them with `take`; each result takes `each` bytes.
    fn numbers<T: Clone>(
        &mut self,
        array: &str,
        expected: &str,
        each: u64,
        mut take: impl FnMut(Complex<f64>) -> T,
    ) -> Result<Array<T>, NpzError> {
        let (header, count) = self.header(array, expected)?;
        let Some(number) = number_of(&header) else {
            return Err(self.unexpected(array, &of_type(&header), expected));
        };
        self.charge(array, count, each, expected)?;
        let mut values = Vec::with_capacity(count);
        self.elements(array, &header, count, expected, |bytes| {
            values.push(take(number(bytes, header.big)));
            Ok(())
        })?;
        Ok(Array { values: in_c_order(values, &header), shape: header.shape })
    }

    /// A text array (unicode or bytes).
    ///
    /// # Errors
    /// When it is missing, not text, or damaged.
    pub fn text(&mut self, array: &str, expected: &str) -> Result<Array<String>, NpzError> {
        let (header, count) = self.header(array, expected)?;
        if !matches!(header.kind, 'U' | 'S' | 'a') {
            return Err(self.unexpected(array, &of_type(&header), expected));
        }
        self.charge(array, count, NAME + header.width as u64, expected)?;
        let mut values = Vec::with_capacity(count);
        self.elements(array, &header, count, expected, |bytes| {
            values.push(letters(bytes, &header)?);
            Ok(())
        })?;
        Ok(Array { values: in_c_order(values, &header), shape: header.shape })
    }

    /// Reads a text array with one value.
    ///
    /// # Errors
    /// As [`NpzFile::text`]; also when it has several values or none.
    pub fn word(&mut self, array: &str, expected: &str) -> Result<String, NpzError> {
        let text = self.text(array, expected)?;
        match &text.values[..] {
            [word] => Ok(word.clone()),
            words => Err(self.unexpected(array, &format!("has {} values", words.len()), expected)),
        }
    }

    /// The unit stated by the user, else the one in the array; `None` where neither is given.
    ///
    /// # Errors
    /// The unit is unknown or of another dimension.
    pub fn unit(
        &mut self,
        array: &str,
        stated: Option<&str>,
        parse: impl Fn(&str) -> Result<Unit, UnitError>,
    ) -> Result<Option<Unit>, NpzError> {
        if let Some(label) = stated {
            let unit = parse(label)
                .map_err(|error| self.content(format!("the unit `{label}` that is stated: {error}")))?;
            return Ok(Some(unit));
        }
        if !self.has(array) {
            return Ok(None);
        }
        let label = self.word(array, "a unit, e.g. mm/s")?;
        let Some(label) = units::told(&label) else { return Ok(None) };
        let unit = parse(label);
        unit.map(Some).map_err(|error| {
            self.content(format!(
                "array `{array}` is `{label}`: {error}; correct it, or state the unit with --units"
            ))
        })
    }

    /// Refuses arrays whose names contain `unit` but are not in `known`: they would be ignored and
    /// the values taken as SI.
    ///
    /// # Errors
    /// [`NpzError::Content`] with the names of these arrays.
    pub fn refuse_other_units(&self, known: &[&str]) -> Result<(), NpzError> {
        let mut others: Vec<String> = self
            .archive
            .file_names()
            .flatten()
            .filter_map(|name| array_name_from_file_name(&name).map(String::from))
            .filter(|name| name.to_lowercase().contains("unit") && !known.contains(&name.as_str()))
            .take(MOST_NAMED)
            .collect();
        others.sort_unstable();
        if others.is_empty() {
            return Ok(());
        }
        Err(self.content(format!(
            "its arrays {} may name units, but units are read from {} only",
            others.join(", "),
            known.join(", ")
        )))
    }

    /// An [`NpzError::Unexpected`] for this file.
    pub fn unexpected(&self, array: &str, found: &str, expected: &str) -> NpzError {
        NpzError::Unexpected {
            path: self.path.clone(),
            array: array.into(),
            found: found.into(),
            expected: expected.into(),
        }
    }

    /// Opens the archive member of an array.
    fn member(&mut self, array: &str, expected: &str) -> Result<impl Read + '_, NpzError> {
        let at = self.archive.index_for_name(&file_name_from_array_name(array));
        let Some(at) = at else {
            let mut available: Vec<String> = self
                .archive
                .file_names()
                .flatten()
                .filter_map(|name| array_name_from_file_name(&name).map(String::from))
                .take(MOST_NAMED)
                .collect();
            available.sort_unstable();
            return Err(NpzError::Missing {
                path: self.path.clone(),
                array: array.into(),
                expected: expected.into(),
                available: available.join(", "),
            });
        };
        let path = &self.path;
        self.archive.by_index(at).map_err(|error| NpzError::Unexpected {
            path: path.clone(),
            array: array.into(),
            found: format!("is damaged ({error})"),
            expected: expected.into(),
        })
    }

    /// Reads an array's header and its number of elements. A header that claims more bytes than the
    /// archive lists for the member is refused before anything of that size is allocated.
    fn header(&mut self, array: &str, expected: &str) -> Result<(Header, usize), NpzError> {
        let header = Header::read(&mut self.member(array, expected)?);
        let header = header.map_err(|found| self.unexpected(array, &found, expected))?;
        let at = self.archive.index_for_name(&file_name_from_array_name(array));
        let stored = at.and_then(|at| self.archive.by_index(at).ok()).map_or(0, |member| member.size());
        let bytes = header.elements().and_then(|count| count.checked_mul(header.width));
        match (header.elements(), bytes) {
            (Some(count), Some(bytes)) if bytes as u64 <= stored => Ok((header, count)),
            _ => {
                let found = format!(
                    "of shape {:?} needs {} bytes, but the archive has only {stored}",
                    header.shape,
                    bytes.map_or("too many".into(), |bytes| bytes.to_string())
                );
                Err(self.unexpected(array, &found, expected))
            }
        }
    }

    /// An array's header, and where its values lie: for arrays that are read in pieces. The whole
    /// array is read once, because the archive checks its checksum only then.
    pub(super) fn places(&mut self, array: &str, expected: &str) -> Result<(Header, Bytes), NpzError> {
        let (header, count) = self.header(array, expected)?;
        let at = self.archive.index_for_name(&file_name_from_array_name(array));
        let stored = at.and_then(|at| {
            let member = self.archive.by_index(at).ok()?;
            let plain = member.compression() == CompressionMethod::Stored;
            member.data_start().filter(|_| plain)
        });
        if stored.is_none() {
            self.charge(array, count, header.width as u64, expected)?;
        }
        let mut from = self.member(array, expected)?;
        let mut read = || -> Result<(u64, Vec<u8>), String> {
            let damaged = |error: io::Error| format!("is damaged ({error})");
            let mut counted = Counted { from: &mut from, bytes: 0 };
            Header::read(&mut counted)?;
            let begin = counted.bytes;
            let mut values = Vec::new();
            if stored.is_some() {
                io::copy(&mut from, &mut io::sink()).map_err(damaged)?;
            } else {
                let length = count * header.width;
                values = vec![0; length];
                from.read_exact(&mut values).map_err(damaged)?;
                from.read(&mut [0]).map_err(damaged)?;
            }
            Ok((begin, values))
        };
        let read = read();
        drop(from);
        let (begin, values) = read.map_err(|found| self.unexpected(array, &found, expected))?;
        let bytes = stored.map_or(Bytes::Memory(values), |start| Bytes::File(start + begin));
        Ok((header, bytes))
    }

    /// Passes the bytes of every element to `take`, in file order.
    fn elements(
        &mut self,
        array: &str,
        header: &Header,
        count: usize,
        expected: &str,
        mut take: impl FnMut(&[u8]) -> Result<(), String>,
    ) -> Result<(), NpzError> {
        let mut from = self.member(array, expected)?;
        let mut read = || -> Result<(), String> {
            let damaged = |error: io::Error| format!("is damaged ({error})");
            Header::read(&mut from)?;
            if header.width == 0 {
                return (0..count).try_for_each(|_| take(&[]));
            }
            let in_piece = (PIECE / header.width).max(1);
            let mut buffer = vec![0; in_piece.min(count) * header.width];
            let mut left = count;
            while left > 0 {
                let piece = &mut buffer[..in_piece.min(left) * header.width];
                from.read_exact(piece).map_err(damaged)?;
                piece.chunks_exact(header.width).try_for_each(&mut take)?;
                left -= piece.len() / header.width;
            }
            // the archive checks its checksum when the member has been read to its end
            from.read(&mut [0]).map(|_| ()).map_err(damaged)
        };
        let read = read();
        drop(from);
        read.map_err(|found| self.unexpected(array, &found, expected))
    }
}

/// Where the values of an array are.
pub(super) enum Bytes {
    /// In the file, from this offset.
    File(u64),
    /// In memory, because the file has them compressed.
    Memory(Vec<u8>),
}

/// Counts the bytes that are read.
struct Counted<R> {
    from: R,
    bytes: u64,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let read = self.from.read(into)?;
        self.bytes += read as u64;
        Ok(read)
    }
}

/// Most arrays that an error message lists.
const MOST_NAMED: usize = 40;

fn of_type(header: &Header) -> String {
    format!("has elements of type {} with {} bytes", header.kind.escape_debug(), header.width)
}

/// Why an npz file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum NpzError {
    /// The file does not exist, cannot be read or is not an npz archive.
    #[error("{}: cannot be opened as npz: {source}; {}", path.display(), advice::reading(source))]
    Open {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// An array is missing.
    #[error("{}: there is no array `{array}` ({expected}); the file has: {available}", path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The array.
        array: String,
        /// What it should hold.
        expected: String,
        /// Names of the arrays in the file.
        available: String,
    },
    /// An array does not have the expected type, shape or value.
    #[error("{}: array `{array}` {found}; expected {expected}", path.display())]
    Unexpected {
        /// The file.
        path: PathBuf,
        /// The array.
        array: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// The arrays are well formed, but do not make an FRF or a record.
    #[error("{}: {reason}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The file cannot be written.
    #[error("{}: cannot be written: {source}; {}", path.display(), advice::writing(source))]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
}

/// Most members of an archive.
const MOST_MEMBERS: u64 = 4096;

/// Signature of an entry of the central directory (the list of members).
const ENTRY: &[u8] = b"PK\x01\x02";
/// Signature and length of the zip64 end of central directory record.
const END_OF_LARGE: &[u8] = b"PK\x06\x06";
const END_OF_LARGE_BYTES: usize = 56;

/// An archive and the size of its file.
pub(super) type Opened = (ZipArchive<BufReader<File>>, u64);

/// Opens the archive at `path`.
///
/// # Errors
/// As [`untrusted_input::open`]; [`ErrorKind::InvalidData`] for a file that is not a zip archive or
/// lists too many members.
pub(super) fn open(path: &Path) -> io::Result<Opened> {
    let (mut file, size) = untrusted_input::open(path)?;
    refuse_long_lists(&mut file, size)?;
    Ok((ZipArchive::new(BufReader::new(file))?, size))
}

/// Counts the members by the signature of their entries before the archive is opened: the zip
/// reader allocates memory for all members that an archive claims or lists, before their number can
/// be checked.
fn refuse_long_lists(file: &mut File, size: u64) -> io::Result<()> {
    let refused = |what: String| Err(io::Error::new(ErrorKind::InvalidData, what));
    let (entry, end) = (memmem::Finder::new(ENTRY), memmem::Finder::new(END_OF_LARGE));
    let (mut buffer, mut kept, mut members) = (vec![0; 1 << 18], 0, 0u64);
    loop {
        let read = file.read(&mut buffer[kept..])?;
        let there = &buffer[..kept + read];
        let last = read == 0;
        // a signature in the last bytes is examined together with the next block
        let done = if last { there.len() } else { there.len().saturating_sub(END_OF_LARGE_BYTES) };
        members += entry.find_iter(there).filter(|at| *at < done).count() as u64;
        if members > MOST_MEMBERS {
            return refused(format!("it lists more than {MOST_MEMBERS} members"));
        }
        for at in end.find_iter(there).filter(|at| *at < done) {
            let word = |from: usize| {
                let bytes = there.get(at + from..at + from + 8).and_then(|bytes| bytes.try_into().ok());
                bytes.map_or(0, u64::from_le_bytes)
            };
            // the same four bytes within compressed data are followed by a length that exceeds the
            // file's size
            let claimed = word(24).max(word(32));
            if word(4) <= size && claimed > MOST_MEMBERS {
                return refused(format!(
                    "it claims to list {claimed} members, at most {MOST_MEMBERS} are read"
                ));
            }
        }
        if last {
            break;
        }
        let end = there.len();
        buffer.copy_within(done..end, 0);
        kept = end - done;
    }
    file.seek(SeekFrom::Start(0)).map(|_| ())
}

/// Converts the bytes of an element to a number; the second argument is whether they are
/// big-endian.
pub(super) type FromBytes = fn(&[u8], bool) -> Complex<f64>;

/// The function that reads a number of this type from its bytes; `None` for other types.
pub(super) fn number_of(header: &Header) -> Option<FromBytes> {
    /// The bytes of an element in little-endian order.
    fn low_first<const N: usize>(bytes: &[u8], big: bool) -> [u8; N] {
        let mut word = [0; N];
        word.copy_from_slice(bytes);
        if big {
            word.reverse();
        }
        word
    }
    macro_rules! real {
        ($of:ty) => {
            |bytes, big| Complex::new(<$of>::from_le_bytes(low_first(bytes, big)) as f64, 0.0)
        };
    }
    macro_rules! complex {
        ($of:ty, $width:literal) => {
            |bytes, big| {
                let part = |bytes| f64::from(<$of>::from_le_bytes(low_first(bytes, big)));
                Complex::new(part(&bytes[..$width]), part(&bytes[$width..]))
            }
        };
    }
    Some(match (header.kind, header.width) {
        ('f', 4) => real!(f32),
        ('f', 8) => real!(f64),
        ('c', 8) => complex!(f32, 4),
        ('c', 16) => complex!(f64, 8),
        ('i', 1) => real!(i8),
        ('i', 2) => real!(i16),
        ('i', 4) => real!(i32),
        ('i', 8) => real!(i64),
        ('u', 1) => real!(u8),
        ('u', 2) => real!(u16),
        ('u', 4) => real!(u32),
        ('u', 8) => real!(u64),
        _ => return None,
    })
}

/// The text of an element without its zero padding.
pub(super) fn letters(bytes: &[u8], header: &Header) -> Result<String, String> {
    let damaged = || "is damaged (it is not text)".to_owned();
    if header.kind != 'U' {
        let end = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
        return Ok(std::str::from_utf8(&bytes[..end]).map_err(|_| damaged())?.into());
    }
    let mut text = String::new();
    for letter in bytes.as_chunks::<4>().0 {
        let code = if header.big { u32::from_be_bytes(*letter) } else { u32::from_le_bytes(*letter) };
        text.push(char::from_u32(code).ok_or_else(damaged)?);
    }
    text.truncate(text.trim_end_matches('\0').len());
    Ok(text)
}

/// Rearranges stored values so that the last index runs fastest.
pub(super) fn in_c_order<T: Clone>(values: Vec<T>, header: &Header) -> Vec<T> {
    let shape = &header.shape;
    if !header.fortran || shape.len() < 2 {
        return values;
    }
    let mut index = vec![0; shape.len()];
    let mut out = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        let at = shape.iter().zip(&index).rev().fold(0, |at, (&n, &i)| at * n + i);
        out.push(values[at].clone());
        for axis in (0..shape.len()).rev() {
            index[axis] += 1;
            if index[axis] < shape[axis] {
                break;
            }
            index[axis] = 0;
        }
    }
    out
}

/// An npz file being written.
pub struct NpzOutput {
    path: PathBuf,
    archive: ZipWriter<BufWriter<File>>,
    packing: CompressionMethod,
}

impl NpzOutput {
    /// Creates the file or replaces an existing one.
    ///
    /// # Errors
    /// [`NpzError::Write`].
    pub fn create(path: &Path) -> Result<Self, NpzError> {
        let file = File::create(path).map_err(|source| NpzError::Write { path: path.into(), source })?;
        let archive = ZipWriter::new(BufWriter::new(file));
        Ok(NpzOutput { path: path.into(), archive, packing: CompressionMethod::Deflated })
    }

    /// Stores arrays without compression, as numpy's `savez` does; for numbers that hardly
    /// compress.
    #[must_use]
    pub fn unpacked(self) -> Self {
        NpzOutput { packing: CompressionMethod::Stored, ..self }
    }

    /// Adds a float64 array in C order.
    ///
    /// # Errors
    /// [`NpzError::Write`].
    pub fn real(
        &mut self,
        name: &str,
        shape: &[usize],
        values: impl IntoIterator<Item: Borrow<f64>>,
    ) -> Result<(), NpzError> {
        self.array(name, shape, "<f8", values.into_iter().map(|v| *v.borrow()))
    }

    /// Adds a complex128 array in C order.
    ///
    /// # Errors
    /// [`NpzError::Write`].
    pub fn complex(
        &mut self,
        name: &str,
        shape: &[usize],
        values: impl IntoIterator<Item: Borrow<Complex<f64>>>,
    ) -> Result<(), NpzError> {
        self.array(name, shape, "<c16", values.into_iter().map(|v| *v.borrow()))
    }

    /// Adds a unicode array.
    ///
    /// # Errors
    /// [`NpzError::Write`].
    pub fn text(&mut self, name: &str, shape: &[usize], values: &[String]) -> Result<(), NpzError> {
        // numpy has no text type of width zero
        let width = values.iter().map(|v| v.chars().count()).max().unwrap_or(0).max(1);
        self.array(name, shape, &format!("<U{width}"), values.iter().cloned())
    }

    fn array<T: npyz::Serialize>(
        &mut self,
        name: &str,
        shape: &[usize],
        kind: &str,
        values: impl Iterator<Item = T>,
    ) -> Result<(), NpzError> {
        let shape: Vec<u64> = shape.iter().map(|&n| n as u64).collect();
        // a fixed date and system keep files of the same content identical
        let options = SimpleFileOptions::default()
            .last_modified_time(zip::DateTime::default())
            .system(zip::System::Unix)
            .compression_method(self.packing)
            // records are the bulk of the data: the default level takes 2.5 times as long for half
            // the size
            .compression_level((self.packing == CompressionMethod::Deflated).then_some(1))
            .large_file(shape.iter().product::<u64>() > 100_000_000);
        let dtype = DType::new_scalar(kind.parse().expect("type strings above are numpy's own"));
        let archive = &mut self.archive;
        let written = archive.start_file(file_name_from_array_name(name), options).map_err(io::Error::from);
        let written = written.and_then(|()| {
            let array = WriteOptions::<T>::new().dtype(dtype).shape(&shape);
            // buffered, because the compressor processes each write separately, however small
            let mut gathered = BufWriter::with_capacity(1 << 16, archive);
            let mut array = array.writer(&mut gathered).begin_nd()?;
            array.extend(values)?;
            array.finish()?;
            gathered.flush()
        });
        written.map_err(|source| NpzError::Write { path: self.path.clone(), source })
    }

    /// Closes the archive.
    ///
    /// # Errors
    /// [`NpzError::Write`].
    pub fn finish(self) -> Result<(), NpzError> {
        let closed = self.archive.finish().map_err(io::Error::from);
        let flushed = closed.and_then(|mut file| file.flush());
        flushed.map_err(|source| NpzError::Write { path: self.path, source })
    }
}

#[cfg(test)]
mod tests {
    use super::NpzOutput;
    use super::*;
    use zip::write::SimpleFileOptions;

    #[test]
    fn arrays_come_back() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("x.npz");
        let mut out = NpzOutput::create(&path).expect("writable");
        out.real("r", &[2, 3], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).expect("written");
        out.complex("c", &[1], [Complex::new(1.0, -2.0)]).expect("written");
        out.text("t", &[], &["αβ".into()]).expect("written");
        out.finish().expect("closed");
        let mut file = NpzFile::open(&path).expect("readable");
        assert_eq!(file.real("r", "").expect("real").shape, [2, 3]);
        assert_eq!(file.complex("c", "").expect("complex").values[0].im, -2.0);
        assert_eq!(file.word("t", "").expect("text"), "αβ");
        let text = file.real("q", "the force").expect_err("missing").to_string();
        assert!(text.contains("`q`") && text.contains("x.npz") && text.contains("c, r, t"), "{text}");
        assert!(file.real("t", "numbers").expect_err("text").to_string().contains("expected numbers"));
        assert!(file.real("c", "numbers").is_err());
    }

    /// An archive with one array `force`, this header, and `zeros` zero bytes as values.
    fn force(descr: &str, shape: &str, zeros: usize) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let mut zip = zip::ZipWriter::new(file.reopen().expect("the same file"));
        zip.start_file("force.npy", SimpleFileOptions::default()).expect("entry");
        let mut npy = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
        npy.extend(format!("{header:<117}\n").bytes());
        npy.resize(npy.len() + zeros, 0);
        io::Write::write_all(&mut zip, &npy).expect("written");
        zip.finish().expect("closed");
        file
    }

    #[test]
    fn a_header_that_promises_too_much_is_refused() {
        let file = force("<f8", "(4000000000, 1000000)", 0);
        let error = NpzFile::open(file.path()).expect("a zip").real("force", "the force").expect_err("bomb");
        assert!(error.to_string().contains("`force`"), "{error}");
        // elements of zero bytes take no space in the file, but each takes memory
        let file = force("|S0", "(1000000000000,)", 0);
        let error = NpzFile::open(file.path()).expect("a zip").text("force", "names").expect_err("bomb");
        assert!(error.to_string().contains("`force` would take"), "{error}");
    }

    #[test]
    fn zeros_without_end_are_refused_before_they_are_read() {
        let file = force("<f4", "(50000000,)", 200_000_000);
        let size = file.as_file().metadata().expect("there").len();
        let begun = std::time::Instant::now();
        let error = NpzFile::open(file.path()).expect("a zip").real("force", "the force").expect_err("bomb");
        assert!(error.to_string().contains("would take 400 MB"), "{error} of {size} bytes");
        assert!(begun.elapsed().as_secs() < 2);
        // zeros that compress moderately are read
        let file = force("<f4", "(2, 100000)", 800_000);
        let read = NpzFile::open(file.path()).expect("a zip").real("force", "the force").expect("zeros");
        assert_eq!((read.shape, read.values.len()), (vec![2, 100_000], 200_000));
    }

    #[test]
    fn a_byte_that_was_changed_is_noticed() {
        let file = force("<f8", "(1000,)", 8000);
        let mut bytes = std::fs::read(file.path()).expect("readable");
        let sum = bytes.windows(4).position(|four| four == b"PK\x01\x02").expect("the list") + 16;
        bytes[sum] ^= 1;
        std::fs::write(file.path(), bytes).expect("written");
        let error =
            NpzFile::open(file.path()).expect("a zip").real("force", "the force").expect_err("changed");
        assert!(error.to_string().contains("is damaged"), "{error}");
    }
}

#[cfg(test)]
mod archive_tests {
    use super::*;
    use std::io::Write;
    use zip::write::SimpleFileOptions;

    fn of(members: usize) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let mut zip = zip::ZipWriter::new(file.reopen().expect("the same file"));
        for member in 0..members {
            zip.start_file(format!("{member}.npy"), SimpleFileOptions::default()).expect("a member");
        }
        zip.finish().expect("closed");
        file
    }

    #[test]
    fn a_list_longer_than_any_tools_is_refused() {
        assert_eq!(open(of(1000).path()).expect("a good archive").0.len(), 1000);
        let said = open(of(5000).path()).map(|_| ()).expect_err("too many").to_string();
        assert!(said.contains("4096"), "{said}");
    }

    #[test]
    fn a_claim_of_many_members_makes_no_room_for_them() {
        let file = of(1);
        let good = std::fs::read(file.path()).expect("readable");
        let end = memmem::find(&good, b"PK\x05\x06").expect("its end");
        let mut bytes = good[..end].to_vec();
        let at = bytes.len() as u64;
        bytes.extend(END_OF_LARGE);
        bytes.extend(44u64.to_le_bytes());
        bytes.extend([45, 0, 45, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        for word in [1u64 << 40, 1 << 40, 1 << 50, 0] {
            bytes.extend(word.to_le_bytes());
        }
        bytes.extend(b"PK\x06\x07\0\0\0\0");
        bytes.extend(at.to_le_bytes());
        bytes.extend([1, 0, 0, 0]);
        bytes.extend(b"PK\x05\x06\0\0\0\0\xff\xff\xff\xff");
        bytes.extend([0xff; 8]);
        bytes.extend([0, 0]);
        file.reopen().and_then(|mut file| file.write_all(&bytes)).expect("written");
        let said = open(file.path()).map(|_| ()).expect_err("a lie").to_string();
        assert!(said.contains("claims to list"), "{said}");
    }
}

#[cfg(test)]
mod npy_values_tests {
    use super::*;

    #[test]
    fn fortran_order_is_turned() {
        // column by column: (0,0) (1,0) (0,1) (1,1) (0,2) (1,2)
        let of =
            |shape: &[usize]| Header { kind: 'f', width: 8, big: false, fortran: true, shape: shape.into() };
        let turned = in_c_order(vec![1, 4, 2, 5, 3, 6], &of(&[2, 3]));
        assert_eq!(turned, [1, 2, 3, 4, 5, 6]);
        let three = in_c_order((0..24).collect(), &of(&[2, 3, 4]));
        // (1, 2, 3) is at 1 + 2·2 + 6·3 in Fortran order and last in C order
        assert_eq!(three[23], 23);
        // (0, 1, 2) is at 0 + 2·1 + 6·2
        assert_eq!(three[4 + 2], 14);
    }

    #[test]
    fn numbers_and_texts_of_either_byte_order() {
        let of = |kind, width, big| Header { kind, width, big, fortran: false, shape: Vec::new() };
        let number =
            |kind, bytes: &[u8], big| number_of(&of(kind, bytes.len(), big)).map(|number| number(bytes, big));
        assert_eq!(number('i', &[0xfe, 0xff], false), Some(Complex::new(-2.0, 0.0)));
        assert_eq!(number('u', &[1, 2], true), Some(Complex::new(258.0, 0.0)));
        let parts = [2.5f32.to_be_bytes(), (-1.0f32).to_be_bytes()].concat();
        assert_eq!(number('c', &parts, true), Some(Complex::new(2.5, -1.0)));
        assert_eq!(number('f', &[0; 2], false), None);
        let text = [0, 0, 0, 0xb5, 0, 0, 0, b'm', 0, 0, 0, 0];
        assert_eq!(letters(&text, &of('U', 12, true)).as_deref(), Ok("µm"));
        assert_eq!(letters(b"a\0", &of('S', 2, false)).as_deref(), Ok("a"));
        assert!(letters(&[0xff; 4], &of('U', 4, false)).is_err());
    }
}

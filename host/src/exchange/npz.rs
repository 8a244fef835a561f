//! Arrays in npz archives: the layer that the FRF and record files share.
//!
//! Reads real, complex and text arrays of any numpy width, in either byte order and either memory
//! order; always returns C order and the widest type. Every error names the file, the array and
//! what was expected of it. Values are read as a stream. The memory for all that is read of one
//! file is bounded by the file's size, because a few compressed bytes may expand to a billion
//! zeros.

use super::archive;
use super::npy_header::Header;
use super::npy_values::{in_c_order, letters, number_of};
use super::npz_error::NpzError;
use super::units::{self, Unit, UnitError};
use crate::foreign;
use npyz::npz::{array_name_from_file_name, file_name_from_array_name};
use num_complex::Complex;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

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

/// Bytes of the pieces in which values are read.
const PIECE: usize = 1 << 16;

impl NpzFile {
    /// Opens the archive; arrays are read on demand.
    ///
    /// # Errors
    /// [`NpzError::Open`].
    pub fn open(path: &Path) -> Result<Self, NpzError> {
        let (archive, size) =
            archive::open(path).map_err(|source| NpzError::Open { path: path.into(), source })?;
        Ok(NpzFile { path: path.into(), archive, size, left: foreign::memory_for(size) })
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
            "would take {} of memory, and what a file of {} holds may take {} in all: split it, or store it uncompressed and as \
             floats (np.savez)",
            foreign::megabytes(bytes),
            foreign::megabytes(self.size),
            foreign::megabytes(foreign::memory_for(self.size)),
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
            "its arrays {} may name units, and are not known here: units are read from {}",
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
                    "of shape {:?} needs {} bytes and the archive has {stored} of it",
                    header.shape,
                    bytes.map_or("too many".into(), |bytes| bytes.to_string())
                );
                Err(self.unexpected(array, &found, expected))
            }
        }
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

/// Most arrays that an error message lists.
const MOST_NAMED: usize = 40;

fn of_type(header: &Header) -> String {
    format!("has elements of type {} with {} bytes", header.kind.escape_debug(), header.width)
}

#[cfg(test)]
mod tests {
    use super::super::npz_output::NpzOutput;
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

//! Arrays of npz files that are too long for memory: read in pieces, as the bytes of their own type.
//!
//! numpy.savez stores arrays uncompressed, so any part of them can be read where it lies in the
//! file. The checksum of such an array is verified once, when it is opened. A compressed array
//! (numpy.savez_compressed) has no such places and is kept in memory, within the bound for a file
//! of its size.

use super::npz::{Bytes, NpzError, NpzFile};
use crate::{advice, untrusted_input};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::PathBuf;

/// An array whose values stay in the file until they are read.
pub struct LongArray {
    path: PathBuf,
    name: String,
    file: File,
    bytes: Bytes,
    /// Whether elements are floating-point numbers; signed integers otherwise.
    pub float: bool,
    /// Bytes of an element: 2 or 4 for integers, 4 or 8 for floating-point numbers.
    pub width: usize,
    /// Whether the elements are big-endian.
    pub big: bool,
    /// Whether the first index runs fastest.
    pub fortran: bool,
    /// Length of each axis.
    pub shape: Vec<usize>,
}

impl LongArray {
    /// Opens the array of this name. `expected` says in messages what it should hold.
    ///
    /// # Errors
    /// It is missing, damaged, of a type other than int16, int32, float32 and float64, or
    /// compressed and too large for memory.
    pub fn open(npz: &mut NpzFile, name: &str, expected: &str) -> Result<Self, NpzError> {
        let (header, bytes) = npz.places(name, expected)?;
        let float = match (header.kind, header.width) {
            ('i', 2 | 4) => false,
            ('f', 4 | 8) => true,
            (kind, width) => {
                let found = format!("has elements of type {kind}{width}");
                let wanted = format!("{expected}, as int16, int32, float32 or float64 (numpy's astype)");
                return Err(npz.unexpected(name, &found, &wanted));
            }
        };
        let path = npz.path().to_owned();
        let opened = untrusted_input::open(&path);
        let (file, _) = opened.map_err(|source| NpzError::Open { path: path.clone(), source })?;
        Ok(Self {
            path,
            name: name.into(),
            file,
            bytes,
            float,
            width: header.width,
            big: header.big,
            fortran: header.fortran,
            shape: header.shape,
        })
    }

    /// Reads `count` elements from element `from` of the file's order; `out` is emptied first.
    ///
    /// # Errors
    /// The file cannot be read, or ends before them.
    pub fn read(&self, from: u64, count: usize, out: &mut Vec<u8>) -> Result<(), NpzError> {
        let (start, length) = (from * self.width as u64, count * self.width);
        let all: usize = self.shape.iter().product();
        out.clear();
        let read = match &self.bytes {
            _ if from + count as u64 > all as u64 => Err(io::Error::from(io::ErrorKind::UnexpectedEof)),
            Bytes::Memory(all) => {
                out.extend_from_slice(&all[start as usize..start as usize + length]);
                Ok(())
            }
            Bytes::File(at) => {
                out.resize(length, 0);
                let mut file = &self.file;
                file.seek(SeekFrom::Start(at + start)).and_then(|_| file.read_exact(out))
            }
        };
        read.map_err(|error| NpzError::Content {
            path: self.path.clone(),
            reason: format!(
                "array `{}` cannot be read from element {from}: {error}; {}",
                self.name,
                advice::reading(&error)
            ),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use zip::write::SimpleFileOptions;
    use zip::{CompressionMethod, ZipWriter};

    fn file(method: CompressionMethod, descr: &str, values: &[u8], shape: &str) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().expect("a temporary file");
        let mut zip = ZipWriter::new(file.reopen().expect("the same file"));
        let options = SimpleFileOptions::default().compression_method(method);
        zip.start_file("signals.npy", options).expect("a member");
        let text = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.bytes());
        bytes.extend(values);
        zip.write_all(&bytes).expect("written");
        zip.finish().expect("closed");
        file
    }

    #[test]
    fn any_part_is_read_as_it_is_stored() {
        let values: Vec<u8> = (0..3000_i16).flat_map(i16::to_le_bytes).collect();
        for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
            let file = file(method, "<i2", &values, "(3, 1000)");
            let mut npz = NpzFile::open(file.path()).expect("an archive");
            let array = LongArray::open(&mut npz, "signals", "signals").expect("there");
            assert_eq!((array.float, array.width, array.shape.as_slice()), (false, 2, &[3, 1000][..]));
            let mut out = Vec::new();
            array.read(1500, 4, &mut out).expect("there");
            assert_eq!(out, &values[3000..3008]);
            assert!(array.read(2999, 2, &mut out).is_err());
        }
    }

    #[test]
    fn other_types_and_changed_bytes_are_refused() {
        let of = |file: &tempfile::NamedTempFile| {
            let mut npz = NpzFile::open(file.path()).expect("an archive");
            LongArray::open(&mut npz, "signals", "signals").map(|_| ()).map_err(|error| error.to_string())
        };
        let complex = file(CompressionMethod::Stored, "<c8", &[0; 80], "(10,)");
        assert!(of(&complex).expect_err("complex").contains("float32"));
        let good = file(CompressionMethod::Stored, "<f8", &[0; 8000], "(1000,)");
        assert_eq!(of(&good), Ok(()));
        let mut bytes = std::fs::read(good.path()).expect("readable");
        bytes[4000] ^= 1;
        std::fs::write(good.path(), bytes).expect("written");
        assert!(of(&good).expect_err("changed").contains("damaged"));
        let short = file(CompressionMethod::Stored, "<f8", &[0; 80], "(1000,)");
        assert!(of(&short).expect_err("short").contains("needs 8000 bytes"));
    }
}

//! Arrays in npz archives: the layer that the FRF and record files share.
//!
//! Reads real, complex and text arrays of any numpy width, either byte order and either memory order; always
//! gives C order and the widest type. Every error names the file, the array and what was expected of it.

use crate::advice;
use npyz::npz::{array_name_from_file_name, file_name_from_array_name};
use npyz::{DType, NpyFile, Order, TypeChar};
use num_complex::Complex;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// Why an npz file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum NpzError {
    /// The file is not there, not readable, or no npz archive.
    #[error("{}: cannot be opened as npz: {source}; {}", path.display(), advice::reading(source))]
    Open {
        /// The file.
        path: PathBuf,
        /// Why.
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
        /// Names of the arrays that are there.
        available: String,
    },
    /// An array is not what it should be.
    #[error("{}: array `{array}` {found}; expected {expected}", path.display())]
    Unexpected {
        /// The file.
        path: PathBuf,
        /// The array.
        array: String,
        /// What it is.
        found: String,
        /// What it should be.
        expected: String,
    },
    /// Arrays are well formed, but what they say is not an FRF or a record.
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
        /// Why.
        source: io::Error,
    },
}

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
}

impl NpzFile {
    /// Opens the archive; arrays are read when asked for.
    ///
    /// # Errors
    /// [`NpzError::Open`].
    pub fn open(path: &Path) -> Result<Self, NpzError> {
        let archive = File::open(path)
            .and_then(|file| Ok(ZipArchive::new(BufReader::new(file))?))
            .map_err(|source| NpzError::Open { path: path.into(), source })?;
        Ok(NpzFile { path: path.into(), archive })
    }

    /// Whether there is an array of this name.
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
        let complex = self.complex(array, expected)?;
        if complex.values.iter().any(|v| v.im != 0.0) {
            return Err(self.unexpected(array, "is complex", expected));
        }
        Ok(Array { shape: complex.shape, values: complex.values.into_iter().map(|v| v.re).collect() })
    }

    /// One real number: a scalar array, or one of length one.
    ///
    /// # Errors
    /// As [`NpzFile::real`]; or it has several values or none, or is not finite.
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
        let (kind, size, shape, order, file) = self.header(array, expected)?;
        let values = match (kind, size) {
            (TypeChar::Float, 4) => file.into_vec::<f32>().map(widen),
            (TypeChar::Float, 8) => file.into_vec::<f64>().map(widen),
            (TypeChar::Complex, 8) => file
                .into_vec::<Complex<f32>>()
                .map(|v| v.into_iter().map(|c| Complex::new(c.re.into(), c.im.into())).collect()),
            (TypeChar::Complex, 16) => file.into_vec::<Complex<f64>>(),
            (TypeChar::Int, 1) => file.into_vec::<i8>().map(widen),
            (TypeChar::Int, 2) => file.into_vec::<i16>().map(widen),
            (TypeChar::Int, 4) => file.into_vec::<i32>().map(widen),
            (TypeChar::Int, 8) => {
                file.into_vec::<i64>().map(|v| widen(v.into_iter().map(|i| i as f64).collect()))
            }
            (TypeChar::Uint, 1) => file.into_vec::<u8>().map(widen),
            (TypeChar::Uint, 2) => file.into_vec::<u16>().map(widen),
            (TypeChar::Uint, 4) => file.into_vec::<u32>().map(widen),
            (TypeChar::Uint, 8) => {
                file.into_vec::<u64>().map(|v| widen(v.into_iter().map(|i| i as f64).collect()))
            }
            _ => {
                let found = format!("has elements of type {} with {size} bytes", kind.to_str());
                drop(file);
                return Err(self.unexpected(array, &found, expected));
            }
        };
        let values = values.map_err(|e| self.unexpected(array, &format!("is damaged ({e})"), expected))?;
        Ok(Array { values: in_c_order(values, &shape, order), shape })
    }

    /// A text array (unicode or bytes).
    ///
    /// # Errors
    /// When it is missing, no text, or damaged.
    pub fn text(&mut self, array: &str, expected: &str) -> Result<Array<String>, NpzError> {
        let (kind, size, shape, order, file) = self.header(array, expected)?;
        let values = match kind {
            TypeChar::UnicodeStr => file.into_vec::<String>(),
            TypeChar::ByteStr => file.into_vec::<Vec<u8>>().and_then(|v| {
                v.into_iter()
                    .map(|b| String::from_utf8(b).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e)))
                    .collect()
            }),
            _ => {
                let found = format!("has elements of type {} with {size} bytes", kind.to_str());
                drop(file);
                return Err(self.unexpected(array, &found, expected));
            }
        };
        let values = values.map_err(|e| self.unexpected(array, &format!("is damaged ({e})"), expected))?;
        Ok(Array { values: in_c_order(values, &shape, order), shape })
    }

    /// One word.
    ///
    /// # Errors
    /// As [`NpzFile::text`], or there are several.
    pub fn word(&mut self, array: &str, expected: &str) -> Result<String, NpzError> {
        let text = self.text(array, expected)?;
        match &text.values[..] {
            [word] => Ok(word.clone()),
            words => Err(self.unexpected(array, &format!("has {} values", words.len()), expected)),
        }
    }

    /// An [`NpzError::Unexpected`] of this file.
    pub fn unexpected(&self, array: &str, found: &str, expected: &str) -> NpzError {
        NpzError::Unexpected {
            path: self.path.clone(),
            array: array.into(),
            found: found.into(),
            expected: expected.into(),
        }
    }

    /// Kind, element size, shape and order of an array, with its reader standing at the data. A header that promises
    /// more bytes than the archive holds is refused before anything of its size is allocated.
    fn header(
        &mut self,
        array: &str,
        expected: &str,
    ) -> Result<(TypeChar, u64, Vec<usize>, Order, NpyFile<impl Read + '_>), NpzError> {
        if !self.has(array) {
            let mut available: Vec<String> = self
                .archive
                .file_names()
                .flatten()
                .filter_map(|name| array_name_from_file_name(&name).map(String::from))
                .collect();
            available.sort_unstable();
            return Err(NpzError::Missing {
                path: self.path.clone(),
                array: array.into(),
                expected: expected.into(),
                available: available.join(", "),
            });
        }
        let path = self.path.clone();
        let damaged = |found: String| NpzError::Unexpected {
            path: path.clone(),
            array: array.into(),
            found,
            expected: expected.into(),
        };
        let member = self
            .archive
            .by_name(&file_name_from_array_name(array))
            .map_err(|e| damaged(format!("is damaged ({e})")))?;
        let stored = member.size();
        let file = NpyFile::new(member).map_err(|e| damaged(format!("is damaged ({e})")))?;
        let DType::Plain(kind) = file.dtype() else {
            return Err(damaged("is a structured array".into()));
        };
        let shape: Vec<usize> = file.shape().iter().map(|&n| n as usize).collect();
        let bytes = kind
            .num_bytes()
            .and_then(|b| shape.iter().try_fold(b, |product, &n| product.checked_mul(n)))
            .map_or(u64::MAX, |b| b as u64);
        if kind.uses_pickled_array() || bytes > stored {
            return Err(damaged(format!(
                "of shape {shape:?} needs {bytes} bytes and the archive has {stored} of it"
            )));
        }
        let size = kind.num_bytes().unwrap_or(0) as u64;
        let order = file.order();
        Ok((kind.type_char(), size, shape, order, file))
    }
}

fn widen<T: Into<f64>>(values: Vec<T>) -> Vec<Complex<f64>> {
    values.into_iter().map(|v| Complex::new(v.into(), 0.0)).collect()
}

/// Values as stored in `order`, rearranged so that the last index runs fastest.
fn in_c_order<T: Clone>(values: Vec<T>, shape: &[usize], order: Order) -> Vec<T> {
    if order == Order::C || shape.len() < 2 {
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
        out.real("r", &[2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).expect("written");
        out.complex("c", &[1], &[Complex::new(1.0, -2.0)]).expect("written");
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

    #[test]
    fn fortran_order_is_turned() {
        // column by column: (0,0) (1,0) (0,1) (1,1) (0,2) (1,2)
        let turned = in_c_order(vec![1, 4, 2, 5, 3, 6], &[2, 3], Order::Fortran);
        assert_eq!(turned, [1, 2, 3, 4, 5, 6]);
        let three = in_c_order((0..24).collect(), &[2, 3, 4], Order::Fortran);
        // (1, 2, 3) stands at 1 + 2·2 + 6·3 in Fortran order and last in C order
        assert_eq!(three[23], 23);
        // (0, 1, 2) at 0 + 2·1 + 6·2
        assert_eq!(three[4 + 2], 14);
    }

    #[test]
    fn a_header_that_promises_too_much_is_refused() {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let path = dir.path().join("bomb.npz");
        let mut zip = zip::ZipWriter::new(File::create(&path).expect("writable"));
        zip.start_file("force.npy", SimpleFileOptions::default()).expect("entry");
        let mut npy = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (4000000000, 1000000), }".to_string();
        npy.extend(format!("{header:<117}\n").bytes());
        io::Write::write_all(&mut zip, &npy).expect("written");
        zip.finish().expect("closed");
        let error = NpzFile::open(&path).expect("a zip").real("force", "the force").expect_err("bomb");
        assert!(error.to_string().contains("`force`"), "{error}");
    }
}

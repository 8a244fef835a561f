//! Writes arrays into an npz archive: float64, complex128 and unicode, in C order.

use super::npz_error::NpzError;
use npyz::npz::file_name_from_array_name;
use npyz::{DType, WriteOptions, WriterBuilder};
use num_complex::Complex;
use std::borrow::Borrow;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

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
        // a fixed date keeps files of the same content identical
        let options = SimpleFileOptions::default()
            .last_modified_time(zip::DateTime::default())
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

//! The memory that QEMU and this process share.
//!
//! It is a file that QEMU maps and this process reads and writes: on every system with QEMU's
//! file-backed memory, both access the same pages. Turns are handed over through a pipe, which
//! orders the accesses; so nothing here needs to be mapped, atomic or unsafe.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use jointrig_firmware::lockstep::{
    ASK_AT, Ask, BYTES, MAGIC, MAGIC_AT, REPLY_AT, RING_BYTES, Reply, TEXT_AT, TEXT_BYTES, WORDS,
};

/// The memory, and its file path until that is removed.
#[derive(Debug)]
pub struct SharedRam {
    file: File,
    path: Option<PathBuf>,
}

/// A folder in memory rather than on disk, where there is one.
pub fn folder() -> PathBuf {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() { memory.to_path_buf() } else { std::env::temp_dir() }
}

impl SharedRam {
    /// Creates 16 MB of zeros and the mark that a server is present.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create() -> io::Result<Self> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = folder().join(format!("jointrig-qemu-{}-{number}", std::process::id()));
        // may be left over from a killed process with the same id
        let _ = std::fs::remove_file(&path);
        let file = File::options().read(true).write(true).create_new(true).open(&path)?;
        let ram = Self { file, path: Some(path) };
        ram.file.set_len(BYTES as u64)?;
        ram.write(MAGIC_AT, &MAGIC.to_le_bytes())?;
        Ok(ram)
    }

    /// The file's path, until it is removed.
    pub fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// Removes the file's name once QEMU has opened it: the memory is then freed when both users
    /// end.
    pub fn forget_name(&mut self) {
        if let Some(path) = self.path.take() {
            // it does not matter if it is already gone
            let _ = std::fs::remove_file(path);
        }
    }

    /// Copies bytes out of the memory.
    ///
    /// # Errors
    /// The I/O error.
    pub fn read(&self, at: usize, out: &mut [u8]) -> io::Result<()> {
        self.file.read_exact_at(out, at as u64)
    }

    /// Copies bytes into the memory.
    ///
    /// # Errors
    /// The I/O error.
    pub fn write(&self, at: usize, bytes: &[u8]) -> io::Result<()> {
        self.file.write_all_at(bytes, at as u64)
    }

    /// The board's request.
    ///
    /// # Errors
    /// The I/O error.
    pub fn ask(&self) -> io::Result<Ask> {
        let mut bytes = [0; 4 * WORDS];
        self.read(ASK_AT, &mut bytes)?;
        let (words, _) = bytes.as_chunks::<4>();
        Ok(Ask::from_words(&std::array::from_fn(|i| u32::from_le_bytes(words[i]))))
    }

    /// Writes the reply to the board.
    ///
    /// # Errors
    /// The I/O error.
    pub fn reply(&self, reply: &Reply) -> io::Result<()> {
        let mut bytes = [0; 4 * WORDS];
        for (four, word) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(reply.to_words()) {
            *four = word.to_le_bytes();
        }
        self.write(REPLY_AT, &bytes)
    }

    /// A message of this length.
    ///
    /// # Errors
    /// The I/O error.
    pub fn text(&self, length: u32) -> io::Result<Vec<u8>> {
        let mut text = vec![0; (length as usize).min(TEXT_BYTES)];
        self.read(TEXT_AT, &mut text)?;
        Ok(text)
    }

    /// Copies out of a ring, starting at byte count `from`.
    ///
    /// # Errors
    /// The I/O error.
    pub fn read_ring(&self, ring: usize, from: u32, out: &mut [u8]) -> io::Result<()> {
        let at = from % RING_BYTES;
        let first = out.len().min((RING_BYTES - at) as usize);
        let (head, rest) = out.split_at_mut(first);
        self.read(ring + at as usize, head)?;
        if rest.is_empty() { Ok(()) } else { self.read(ring, rest) }
    }

    /// Copies into a ring, starting at byte count `from`.
    ///
    /// # Errors
    /// The I/O error.
    pub fn write_ring(&self, ring: usize, from: u32, bytes: &[u8]) -> io::Result<()> {
        let at = from % RING_BYTES;
        let first = bytes.len().min((RING_BYTES - at) as usize);
        let (head, rest) = bytes.split_at(first);
        self.write(ring + at as usize, head)?;
        if rest.is_empty() { Ok(()) } else { self.write(ring, rest) }
    }
}

impl Drop for SharedRam {
    fn drop(&mut self) {
        self.forget_name();
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use jointrig_firmware::lockstep::LOG_AT;

    #[test]
    fn a_ring_goes_round() {
        let ram = SharedRam::create().unwrap();
        let bytes: Vec<u8> = (0..200).collect();
        ram.write_ring(LOG_AT, RING_BYTES * 3 - 77, &bytes).unwrap();
        let mut back = [0; 200];
        ram.read_ring(LOG_AT, RING_BYTES * 3 - 77, &mut back).unwrap();
        assert_eq!(back[..], bytes);
        assert_eq!(ram.read(BYTES - 1, &mut back).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
    }

    #[test]
    fn the_file_goes_with_its_owner() {
        let ram = SharedRam::create().unwrap();
        let path = ram.path().unwrap().to_path_buf();
        assert_eq!(std::fs::metadata(&path).unwrap().len(), BYTES as u64);
        drop(ram);
        assert!(!path.exists());
    }
}

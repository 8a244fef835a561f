//! Opens and reads files that other programs wrote: regular files only, each up to a size limit.
//!
//! Reading a pipe could wait forever, `/dev/zero` never ends, and a settings file as large as a
//! disk is not a settings file. Only the size that a file has when it is opened is read; a file
//! that grows while it is read is refused.

use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// Largest settings file (plan, rig, geometry, calibration), bytes.
pub(crate) const SETTINGS: u64 = 1 << 20;

/// Largest text table, bytes.
pub(crate) const TABLE: u64 = 8 << 20;

/// Largest universal file, bytes; it is read as a whole.
pub(crate) const UNIVERSAL: u64 = 2 << 30;

/// The contents of a file may take `TIMES` its size in memory …
const TIMES: u64 = 4;
/// … plus this, bytes, because small files may be highly compressed.
const BESIDE: u64 = 32 << 20;

/// Most bytes of memory that the contents of a file of `size` bytes may take.
pub(crate) fn memory_for(size: u64) -> u64 {
    size.saturating_mul(TIMES).saturating_add(BESIDE)
}

/// Formats a number of bytes for a message.
pub(crate) fn megabytes(bytes: u64) -> String {
    match bytes {
        0..1_000_000 => format!("{} kB", bytes.div_ceil(1000)),
        _ => format!("{} MB", bytes.div_ceil(1_000_000)),
    }
}

/// Opens a file; returns it with its size in bytes.
///
/// # Errors
/// An error of the operating system; [`ErrorKind::Unsupported`] for a pipe, a socket or a device.
pub(crate) fn open(path: &Path) -> io::Result<(File, u64)> {
    // before the file is opened: opening a pipe waits until another process writes to it
    refuse_what_is_no_file(&std::fs::metadata(path)?)?;
    let file = File::open(path)?;
    let there = file.metadata()?;
    refuse_what_is_no_file(&there)?;
    Ok((file, there.len()))
}

fn refuse_what_is_no_file(there: &std::fs::Metadata) -> io::Result<()> {
    if there.is_dir() {
        return Err(io::Error::from(ErrorKind::IsADirectory));
    }
    if !there.is_file() {
        return Err(io::Error::new(
            ErrorKind::Unsupported,
            "it is a pipe, a socket or a device, and not a file",
        ));
    }
    Ok(())
}

/// Reads all bytes of a file of at most `most` bytes.
///
/// # Errors
/// As [`open`]; [`ErrorKind::FileTooLarge`] for a larger file, and for one that grows while it is
/// read.
pub(crate) fn bytes(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let (file, size) = open(path)?;
    let too_large = |what: String| Err(io::Error::new(ErrorKind::FileTooLarge, what));
    if size > most {
        return too_large(format!("it has {}, at most {} are read", megabytes(size), megabytes(most)));
    }
    let mut bytes = Vec::with_capacity(size as usize);
    file.take(size + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > size {
        return too_large("it grows while it is read".into());
    }
    Ok(bytes)
}

/// Reads a file of at most `most` bytes as text.
///
/// # Errors
/// As [`bytes`]; [`ErrorKind::InvalidData`] with the number of the line that is not valid UTF-8.
pub(crate) fn text(path: &Path, most: u64) -> io::Result<String> {
    String::from_utf8(bytes(path, most)?).map_err(|error| {
        let good = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + memchr::memchr_iter(b'\n', good).count();
        io::Error::new(ErrorKind::InvalidData, format!("line {line} is not text (UTF-8)"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_files_and_what_is_no_text_are_refused_with_the_place() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("file");
        std::fs::write(&path, b"one\ntwo\n\xff").expect("written");
        assert_eq!(bytes(&path, 9).expect("nine bytes").len(), 9);
        assert_eq!(bytes(&path, 8).expect_err("one more").kind(), ErrorKind::FileTooLarge);
        assert!(text(&path, 9).expect_err("a stray byte").to_string().contains("line 3"));
        assert_eq!(bytes(folder.path(), 9).expect_err("a folder").kind(), ErrorKind::IsADirectory);
    }

    #[cfg(unix)]
    #[test]
    fn pipes_and_devices_are_refused_and_not_waited_for() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
        for path in [pipe.as_path(), Path::new("/dev/zero"), Path::new("/dev/null")] {
            assert_eq!(open(path).expect_err("no file").kind(), ErrorKind::Unsupported, "{}", path.display());
        }
    }
}

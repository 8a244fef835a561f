//! Opens untrusted zip archives only if their list of members is of a bounded length.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read, Seek, SeekFrom};
use std::path::Path;

use memchr::memmem;
use zip::ZipArchive;

use crate::foreign;

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
/// As [`foreign::open`]; [`ErrorKind::InvalidData`] for a file that is not a zip archive or lists
/// too many members.
pub(super) fn open(path: &Path) -> io::Result<Opened> {
    let (mut file, size) = foreign::open(path)?;
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

#[cfg(test)]
mod tests {
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

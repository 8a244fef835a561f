//! The blocks after the header.

use std::io::{self, ErrorKind, Read};

/// Magic bytes that start every block.
pub const MAGIC: [u8; 4] = *b"JRBK";

/// Bytes of a block's head.
pub const HEAD_BYTES: usize = 24;

/// Flag: scans were lost before this block, and their number is unknown.
pub const OVERRUN: u32 = 1;

/// Most bytes of samples in one block.
pub const MOST_BYTES: usize = 1 << 24;

/// Most scans that a block may report as lost: a day at 49 kHz.
pub const MOST_LOST: u64 = u32::MAX as u64;

/// A block as it came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block<'a> {
    /// Scans lost before it.
    pub lost: u64,
    /// More scans were lost before it, their number is unknown.
    pub overrun: bool,
    /// Its scans, each one sample of every channel.
    pub bytes: &'a [u8],
}

/// Why a stream cannot be read any further.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The stream broke.
    #[error("its output could not be read: {0}")]
    Read(#[from] io::Error),
    /// It ended within a block.
    #[error("its output ended in the middle of a block, after {0} bytes")]
    CutOff(u64),
    /// Bytes that belong to no block.
    #[error(
        "its output has bytes that belong to no block ({found}) after {after} bytes: a program must write nothing \
         but blocks to its standard output; print to standard error"
    )]
    Stray {
        /// Bytes of whole blocks before.
        after: u64,
        /// The first stray bytes, as text.
        found: String,
    },
    /// A field of a block's head is impossible.
    #[error("a block after {after} bytes is refused: {why}")]
    Head {
        /// Bytes of whole blocks before.
        after: u64,
        /// Which field, and its bounds.
        why: String,
    },
}

/// Reads blocks.
#[derive(Debug)]
pub struct Blocks<R> {
    source: R,
    scan_bytes: usize,
    bytes: Vec<u8>,
    /// Bytes of whole blocks so far.
    after: u64,
}

impl<R: Read> Blocks<R> {
    /// Reads blocks of scans of `scan_bytes` bytes from `source`, whose header was read.
    pub fn new(source: R, scan_bytes: usize) -> Self {
        Self { source, scan_bytes: scan_bytes.max(1), bytes: Vec::new(), after: 0 }
    }

    /// The next block; `None` at the end of the stream.
    ///
    /// # Errors
    /// [`StreamError`]. Later calls read on at an arbitrary place: do not use the reader again.
    pub fn next_block(&mut self) -> Result<Option<Block<'_>>, StreamError> {
        let mut head = [0; HEAD_BYTES];
        let got = self.fill(&mut head)?;
        let after = self.after;
        let whole = MAGIC.len().min(got);
        if head[..whole] != MAGIC[..whole] {
            let found = String::from_utf8_lossy(&head[..got]).escape_debug().to_string();
            return Err(StreamError::Stray { after, found });
        }
        match got {
            0 => return Ok(None),
            HEAD_BYTES => {}
            _ => return Err(StreamError::CutOff(after + got as u64)),
        }
        let word = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        let (scans, flags, zero) = (word(4) as usize, word(16), word(20));
        let lost = u64::from(word(8)) | u64::from(word(12)) << 32;
        let refuse = |why: String| Err(StreamError::Head { after, why });
        let most = MOST_BYTES / self.scan_bytes;
        if scans > most {
            return refuse(format!("it has {scans} scans, at most {most} are possible"));
        }
        if lost > MOST_LOST {
            return refuse(format!("it reports {lost} lost scans, at most {MOST_LOST} are possible"));
        }
        if flags & !OVERRUN != 0 || zero != 0 {
            return refuse(format!("its flags are {flags:#x} and {zero:#x}, 0 or 1 and 0 are possible"));
        }
        let size = scans * self.scan_bytes;
        let mut bytes = std::mem::take(&mut self.bytes);
        bytes.resize(size, 0);
        let got = self.fill(&mut bytes)?;
        self.bytes = bytes;
        if got < size {
            return Err(StreamError::CutOff(after + (HEAD_BYTES + got) as u64));
        }
        self.after += (HEAD_BYTES + size) as u64;
        Ok(Some(Block { lost, overrun: flags & OVERRUN != 0, bytes: &self.bytes }))
    }

    /// Fills the buffer as far as the stream reaches; returns how far.
    fn fill(&mut self, into: &mut [u8]) -> Result<usize, StreamError> {
        let mut got = 0;
        while got < into.len() {
            match self.source.read(&mut into[got..]) {
                Ok(0) => break,
                Ok(count) => got += count,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(got)
    }
}

/// The head of a block, for programs that write the format.
#[must_use]
pub fn head(scans: u32, lost: u64, overrun: bool) -> [u8; HEAD_BYTES] {
    let mut head = [0; HEAD_BYTES];
    head[..4].copy_from_slice(&MAGIC);
    head[4..8].copy_from_slice(&scans.to_le_bytes());
    head[8..16].copy_from_slice(&lost.to_le_bytes());
    head[16] = u8::from(overrun);
    head
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn block(lost: u64, overrun: bool, bytes: &[u8]) -> Vec<u8> {
        [&head(bytes.len() as u32 / 4, lost, overrun)[..], bytes].concat()
    }

    #[test]
    fn blocks_are_read_in_order_to_the_end() {
        let stream = [block(0, false, &[1; 8]), block(7, true, &[]), block(0, false, &[2; 4])].concat();
        let mut blocks = Blocks::new(&stream[..], 4);
        let mut next = || {
            blocks.next_block().expect("good").map(|block| (block.lost, block.overrun, block.bytes.to_vec()))
        };
        assert_eq!(next(), Some((0, false, vec![1; 8])));
        assert_eq!(next(), Some((7, true, vec![])));
        assert_eq!(next(), Some((0, false, vec![2; 4])));
        assert_eq!(next(), None);
    }

    #[test]
    fn a_print_and_a_cut_are_told_with_their_place() {
        let stream = [&block(0, false, &[1; 8])[..], b"buffer overflow!\n"].concat();
        let mut blocks = Blocks::new(&stream[..], 4);
        assert!(blocks.next_block().is_ok());
        let said = blocks.next_block().expect_err("stray").to_string();
        assert!(said.contains("(buffer overflow!\\n) after 32 bytes"), "{said}");
        for cut in 1..32 {
            let mut blocks = Blocks::new(&stream[..cut], 4);
            let said = blocks.next_block().expect_err("cut").to_string();
            assert!(said.contains(&format!("after {cut} bytes")), "{said}");
        }
    }

    #[test]
    fn sizes_are_bounded_before_memory_is_claimed() {
        let wide = head(u32::MAX, 0, false);
        assert!(matches!(Blocks::new(&wide[..], 256).next_block(), Err(StreamError::Head { .. })));
        let far = head(0, 1 << 40, false);
        assert!(matches!(Blocks::new(&far[..], 4).next_block(), Err(StreamError::Head { .. })));
    }

    proptest! {
        #[test]
        fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200), scan_bytes in 1_usize..600) {
            let mut blocks = Blocks::new(&bytes[..], scan_bytes);
            while matches!(blocks.next_block(), Ok(Some(_))) {}
        }

        #[test]
        fn damaged_blocks_never_panic(at in 0_usize..64, value in any::<u8>()) {
            let mut stream = [block(3, true, &[1; 8]), block(0, false, &[5; 8])].concat();
            stream[at] = value;
            let mut blocks = Blocks::new(&stream[..], 4);
            while matches!(blocks.next_block(), Ok(Some(_))) {}
        }
    }
}

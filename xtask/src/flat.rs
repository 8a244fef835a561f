//! Flat images: the bytes of the flash, for boards that are flashed as a USB drive or by the loader
//! in ROM.

use anyhow::{Context, Result, bail};
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Endianness, elf};
use std::path::{Path, PathBuf};

/// Value of erased flash bytes.
const ERASED: u8 = 0xFF;

/// Maximum distance between two parts of one image, bytes: more than the size of any flash.
const LARGEST: usize = 16 << 20;

/// Writes the flash's bytes next to the image as `.bin`; returns the file and the address of its
/// first byte.
pub fn write(image: &Path) -> Result<(PathBuf, u64)> {
    let bytes = std::fs::read(image).with_context(|| format!("could not read {}", image.display()))?;
    let (first, flat) = of(&bytes).with_context(|| format!("{} cannot be flattened", image.display()))?;
    let file = image.with_extension("bin");
    std::fs::write(&file, flat).with_context(|| format!("could not write {}", file.display()))?;
    Ok((file, first))
}

/// The address of the first loaded segment, and the bytes of all segments at their physical
/// addresses.
fn of(image: &[u8]) -> Result<(u64, Vec<u8>)> {
    let file = ElfFile32::<Endianness>::parse(image)?;
    let endian = Endianness::Little;
    let mut parts = Vec::new();
    for segment in file.elf_program_headers() {
        let data = segment.data(endian, image).ok().context("a segment lies outside the file")?;
        if segment.p_type(endian) == elf::PT_LOAD && !data.is_empty() {
            parts.push((u64::from(segment.p_paddr(endian)), data));
        }
    }
    parts.sort_by_key(|(at, _)| *at);
    let first = parts.first().context("nothing in it is loaded")?.0;
    let mut flat = Vec::new();
    for (at, data) in parts {
        let from = usize::try_from(at - first)?;
        if from < flat.len() || from > LARGEST {
            bail!("its part at {at:#010x} overlaps another or lies far from the first, at {first:#010x}");
        }
        flat.resize(from, ERASED);
        flat.extend_from_slice(data);
    }
    Ok((first, flat))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 32-bit image with these segments: (virtual address, physical address, bytes, size in
    /// memory).
    fn image(segments: &[(u32, u32, &[u8], u32)]) -> Vec<u8> {
        let mut out = vec![0x7F, b'E', b'L', b'F', 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        let half =
            |out: &mut Vec<u8>, values: &[u16]| values.iter().for_each(|v| out.extend(v.to_le_bytes()));
        let word =
            |out: &mut Vec<u8>, values: &[u32]| values.iter().for_each(|v| out.extend(v.to_le_bytes()));
        half(&mut out, &[2, 40]);
        word(&mut out, &[1, 0, 52, 0, 0]);
        half(&mut out, &[52, 32, segments.len() as u16, 40, 0, 0]);
        let mut at = 52 + 32 * segments.len() as u32;
        for (virtual_address, physical, data, memory) in segments {
            word(&mut out, &[1, at, *virtual_address, *physical, data.len() as u32, *memory, 5, 4]);
            at += data.len() as u32;
        }
        for (_, _, data, _) in segments {
            out.extend_from_slice(data);
        }
        out
    }

    #[test]
    fn segments_stand_at_their_physical_addresses() {
        let text = (0x0800_0000, 0x0800_0000, &b"text"[..], 4);
        // initialised data is in RAM and is loaded from the flash after the text; uninitialised RAM
        // is not in the file
        let data = (0x2000_0000, 0x0800_0008, &b"data"[..], 4);
        let bss = (0x2000_0004, 0x2000_0004, &b""[..], 64);
        let (first, flat) = of(&image(&[data, text, bss])).expect("an image");
        assert_eq!((first, flat.as_slice()), (0x0800_0000, &b"text\xFF\xFF\xFF\xFFdata"[..]));
    }

    #[test]
    fn what_is_no_flash_is_refused() {
        let far = image(&[(0x1000_0000, 0x1000_0000, b"a", 1), (0x3800_0000, 0x3800_0000, b"b", 1)]);
        assert!(of(&far).is_err_and(|error| error.to_string().contains("0x38000000")));
        let twice = image(&[(0, 0, b"abcd", 4), (2, 2, b"efgh", 4)]);
        assert!(of(&twice).is_err());
        assert!(of(&image(&[])).is_err() && of(b"no image").is_err());
    }
}

//! How much flash and RAM an image takes, read from its ELF sections.
//!
//! Flash holds code, constants and the initial values of variables (text + rodata + data); RAM
//! holds the variables (data + bss). The stack has no section: it uses the remaining RAM.

use anyhow::{Context, Result, bail};
use object::elf::{SHF_ALLOC, SHF_EXECINSTR, SHF_WRITE};
use object::{Object, ObjectSection, SectionFlags, SectionKind};
use std::fmt::Write;
use std::path::Path;

use crate::project::EMULATED_BOARD;

/// Bytes of flash that the emulated board's image may take, so that unintended growth is noticed.
pub const EMULATED_FLASH: u64 = 80_000;

/// Bytes of flash that a wired board's image may take, including its chip's support and USB: it
/// then also fits the smaller controllers of the same family.
pub const WIRED_FLASH: u64 = 96_000;

/// Flash limit of a board's image, bytes.
pub fn limit(board: &str) -> u64 {
    if board == EMULATED_BOARD { EMULATED_FLASH } else { WIRED_FLASH }
}

/// The sizes of an image's parts, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    text: u64,
    rodata: u64,
    data: u64,
    bss: u64,
}

impl Sizes {
    /// Bytes of flash.
    pub fn flash(self) -> u64 {
        self.text + self.rodata + self.data
    }

    /// Bytes of RAM, without the stack.
    pub fn ram(self) -> u64 {
        self.data + self.bss
    }
}

/// Reads the sizes of an image.
pub fn of_image(path: &Path) -> Result<Sizes> {
    let bytes =
        std::fs::read(path).with_context(|| format!("could not read the image {}", path.display()))?;
    of_elf(&bytes).with_context(|| format!("{} is not an ELF image", path.display()))
}

fn of_elf(bytes: &[u8]) -> Result<Sizes> {
    let file = object::File::parse(bytes)?;
    let mut sizes = Sizes::default();
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags, .. } = section.flags() else { continue };
        let has = |flag: u32| sh_flags & u64::from(flag) != 0;
        // Sections that are not loaded (debug information, defmt's strings) take no memory on the
        // chip.
        if !has(SHF_ALLOC) {
            continue;
        }
        let part = match section.kind() {
            SectionKind::UninitializedData | SectionKind::UninitializedTls => &mut sizes.bss,
            _ if has(SHF_EXECINSTR) => &mut sizes.text,
            _ if has(SHF_WRITE) => &mut sizes.data,
            _ => &mut sizes.rodata,
        };
        *part += section.size();
    }
    Ok(sizes)
}

/// The table of several images.
pub fn table(images: &[(String, Sizes)]) -> String {
    let width = images.iter().map(|(name, _)| name.len()).max().unwrap_or(0).max("board".len());
    let mut text = format!(
        "{:width$} {:>9} {:>9} {:>9} {:>9} {:>10} {:>10}\n",
        "board", "text", "rodata", "data", "bss", "flash", "RAM"
    );
    for (name, sizes) in images {
        // Writing into a String cannot fail.
        let _ = writeln!(
            text,
            "{name:width$} {:>9} {:>9} {:>9} {:>9} {:>10} {:>10}",
            sizes.text,
            sizes.rodata,
            sizes.data,
            sizes.bss,
            sizes.flash(),
            sizes.ram()
        );
    }
    text.push_str(
        "bytes; flash = text + rodata + data, RAM = data + bss (the stack takes from what is left)\n",
    );
    text
}

/// Fails if an image takes more flash than its [`limit`], and names it.
pub fn enforce(images: &[(String, Sizes)]) -> Result<()> {
    let over: Vec<String> = images
        .iter()
        .filter(|(name, sizes)| sizes.flash() > limit(name))
        .map(|(name, sizes)| format!("{name} takes {} bytes, allowed {}", sizes.flash(), limit(name)))
        .collect();
    if over.is_empty() {
        return Ok(());
    }
    bail!(
        "too much flash: {}. Make the image smaller, or raise the limit in xtask/src/size.rs and \
         say why",
        over.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use object::write::Object as Image;
    use object::{Architecture, BinaryFormat, Endianness};

    fn image(sections: &[(&str, SectionKind, usize)]) -> Vec<u8> {
        let mut image = Image::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little);
        for &(name, kind, size) in sections {
            let section = image.add_section(Vec::new(), name.into(), kind);
            if kind == SectionKind::UninitializedData {
                image.append_section_bss(section, size as u64, 4);
            } else {
                image.append_section_data(section, &vec![0xAA; size], 4);
            }
        }
        image.write().expect("a well-formed image")
    }

    #[test]
    fn each_section_is_counted_where_it_lives() {
        let bytes = image(&[
            (".vector_table", SectionKind::ReadOnlyData, 64),
            (".text", SectionKind::Text, 1000),
            (".rodata", SectionKind::ReadOnlyData, 200),
            (".data", SectionKind::Data, 30),
            (".bss", SectionKind::UninitializedData, 4096),
            (".uninit", SectionKind::UninitializedData, 8),
            (".debug_info", SectionKind::Debug, 5000),
        ]);
        let sizes = of_elf(&bytes).expect("an ELF image");
        assert_eq!(sizes, Sizes { text: 1000, rodata: 264, data: 30, bss: 4104 });
        assert_eq!((sizes.flash(), sizes.ram()), (1294, 4134));
    }

    #[test]
    fn what_is_not_an_image_is_an_error() {
        assert!(of_elf(b"not an image").is_err());
        let message = of_image(Path::new("/nowhere/image")).expect_err("no such file").to_string();
        assert_eq!(message, "could not read the image /nowhere/image");
    }

    #[test]
    fn the_table_has_a_line_per_board() {
        let sizes = Sizes { text: 1000, rodata: 264, data: 30, bss: 4104 };
        let text = table(&[("nucleo-u5a5".into(), sizes), ("x".into(), Sizes::default())]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "board            text    rodata      data       bss      flash        RAM");
        assert_eq!(lines[1], "nucleo-u5a5      1000       264        30      4104       1294       4134");
        assert!(lines[2].starts_with("x  "));
    }

    #[test]
    fn an_image_over_its_flash_is_named() {
        let limit = Sizes { text: WIRED_FLASH - 10, rodata: 6, data: 4, bss: 1 << 20 };
        let over = Sizes { data: 5, ..limit };
        assert!(enforce(&[("a".into(), limit)]).is_ok(), "the limit itself is allowed");
        let message = enforce(&[("a".into(), limit), ("b".into(), over)]).expect_err("over").to_string();
        assert!(message.contains("b takes 96001 bytes, allowed 96000"), "{message}");
        assert!(!message.contains("a takes"), "{message}");
    }
}

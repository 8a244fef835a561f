//! A controller's log lines: which image they came from, where its table of strings is kept, and
//! what they say.
//!
//! A controller sends its log as numbers (defmt): the strings stay behind in the image's ELF file,
//! in a table that fits this one build and no other. The linker writes a hash of the whole image
//! into it (`.note.gnu.build-id`); its first eight bytes are the *build id*. The controller says it
//! in `Info`, and a table is kept as [`FOLDER`]`/`[`file_name`]. So whoever has changed a line and
//! flashed the result can never be shown the text of another build.
#![forbid(unsafe_code)]

#[cfg(feature = "example")]
pub mod example;
mod line;
#[cfg(not(feature = "decode"))]
#[path = "no_strings.rs"]
mod strings;
#[cfg(feature = "decode")]
mod strings;
mod table;

use object::Object;

pub use line::Line;
pub use table::{Table, TableError};

/// The folder of tables that `cargo xtask firmware` fills, inside cargo's target directory.
pub const FOLDER: &str = "log-tables";

/// What the table of a build is called.
pub fn file_name(build: u64) -> String {
    format!("{build:016x}.elf")
}

/// The build id of an image; `None` when these bytes are no ELF image or hold no id.
pub fn build_id(image: &[u8]) -> Option<u64> {
    let file = object::File::parse(image).ok()?;
    let id = file.build_id().ok()??;
    Some(u64::from_be_bytes(*id.first_chunk()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_image_has_no_build_id() {
        assert_eq!(build_id(b""), None);
        assert_eq!(build_id(b"\x7fELF and then nothing of the kind"), None);
    }

    #[test]
    fn a_build_id_is_written_as_it_is_shown() {
        assert_eq!(file_name(0x00ab_cdef_0123_4567), "00abcdef01234567.elf");
    }
}

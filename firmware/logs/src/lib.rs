//! A controller's log lines: identification of their image, storage of its string table, and
//! decoding.
//!
//! A controller sends its log as numbers (defmt). The strings remain in the image's ELF file, in a
//! table that matches only this build. The linker writes a hash of the whole image into the file
//! (`.note.gnu.build-id`); its first eight bytes are the *build id*. The controller reports it in
//! `Info`, and a table is stored as [`FOLDER`]`/`[`file_name`]. Therefore, after a change of a log
//! line and flashing, text of another build can never be shown.
#![forbid(unsafe_code)]

#[cfg(feature = "example")]
pub mod example;
mod table;

use object::Object;

pub use table::{Line, Table, TableError};

/// The folder for tables filled by `cargo xtask firmware`, inside cargo's target directory.
pub const FOLDER: &str = "log-tables";

/// File name of a build's table.
pub fn file_name(build: u64) -> String {
    format!("{build:016x}.elf")
}

/// The build id of an image; `None` when these bytes are not an ELF image or contain no id.
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

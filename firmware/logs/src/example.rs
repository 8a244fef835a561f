//! For tests: an image with a few log strings, and lines encoded as by a controller.

use object::write::{Object, Symbol, SymbolSection};
use object::{Architecture, BinaryFormat, Endianness, SectionKind, SymbolFlags, SymbolKind, SymbolScope};

/// `"{}"` with one number of 32 bits, at level warn.
pub const WARNING: u16 = 1;
/// `"shot {=u32} of {=str}"`, at level info.
pub const SHOT: u16 = 2;
/// Prefix of [`SHOT`] and [`WARNING`]: microseconds since the start.
const TIMESTAMP: u16 = 3;

/// An image with this build id, whose table contains the strings above.
///
/// # Panics
/// When the ELF writer rejects it.
pub fn image(build: u64) -> Vec<u8> {
    let mut object = Object::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little);
    let mut note = [&4_u32.to_le_bytes()[..], &20_u32.to_le_bytes(), &3_u32.to_le_bytes(), b"GNU\0"].concat();
    note.extend(build.to_be_bytes());
    note.extend([0; 12]);
    let section = object.add_section(Vec::new(), b".note.gnu.build-id".to_vec(), SectionKind::Note);
    object.append_section_data(section, &note, 4);
    let section = object.add_section(Vec::new(), b".defmt".to_vec(), SectionKind::ReadOnlyData);
    object.append_section_data(section, &[0; 16], 1);
    let string = |tag: &str, data: &str| {
        format!(
            r#"{{"package":"example","tag":"{tag}","data":"{data}","disambiguator":"1","crate_name":"example"}}"#
        )
    };
    for (place, name) in [
        (WARNING, string("defmt_warn", "pressure {=u32}")),
        (SHOT, string("defmt_info", "shot {=u32} of {=str}")),
        (TIMESTAMP, string("defmt_timestamp", "{=u64:us}")),
        (8, "_defmt_encoding_ = rzcobs".into()),
        (9, "_defmt_version_ = 4".into()),
    ] {
        object.add_symbol(Symbol {
            name: name.into_bytes(),
            value: u64::from(place),
            size: 1,
            kind: SymbolKind::Data,
            scope: SymbolScope::Linkage,
            weak: false,
            section: SymbolSection::Section(section),
            flags: SymbolFlags::None,
        });
    }
    object.write().expect("a well-formed image")
}

/// An encoded line: the string's index, the time and the arguments, in rzCOBS with a terminating
/// zero.
pub fn line(string: u16, at_us: u64, arguments: &[u8]) -> Vec<u8> {
    let plain = [&string.to_le_bytes()[..], &at_us.to_le_bytes(), arguments].concat();
    let (mut out, mut run, mut zeros) = (Vec::new(), 0_u8, 0_u8);
    for byte in plain {
        if byte != 0 {
            out.push(byte);
        } else if run < 7 {
            zeros |= 1 << run;
        } else {
            out.push((run - 7) | 0x80);
            run = 0;
            continue;
        }
        run += 1;
        match run {
            7 if zeros != 0 => out.push(zeros),
            134 => out.push(0xFF),
            _ => continue,
        }
        (run, zeros) = (0, 0);
    }
    match run {
        0 => {}
        1..=6 => out.push((zeros | (0xFF << run)) & 0x7F),
        _ => out.push((run - 7) | 0x80),
    }
    out.push(0);
    out
}

/// The arguments of [`SHOT`].
///
/// # Panics
/// When the text is longer than 4 GB.
pub fn shot(number: u32, of: &str) -> Vec<u8> {
    let length = u32::try_from(of.len()).expect("short");
    [&number.to_le_bytes()[..], &length.to_le_bytes(), of.as_bytes()].concat()
}

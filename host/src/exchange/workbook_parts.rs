//! Checks the claims of a workbook before its reader acts on them.
//!
//! A workbook is an archive of texts. Its reader allocates as many shared texts as one attribute
//! claims, and keeps the inflated texts in memory. Both are checked here by inflating every part
//! once and discarding it.

use std::io::{Cursor, Read};

use memchr::memmem;
use zip::ZipArchive;

use crate::foreign::megabytes;

/// Most bytes of all inflated parts together; the paper's workbook has 70 kB.
const MOST_BYTES: u64 = 4 << 20;

/// Most parts of a workbook.
const MOST_PARTS: usize = 1000;

/// Most bytes of a cell or range reference that are examined.
const LONGEST_PLACE: usize = 64;

/// Refuses a workbook that would take disproportionate memory.
///
/// # Errors
/// The part and the cause.
pub(super) fn refuse_lies(bytes: &[u8]) -> Result<(), String> {
    // a file that is no archive may have the old xls format, whose sector chains the reader would
    // follow without limit
    if !bytes.starts_with(b"PK") {
        return Err("it is no .xlsx workbook (a zip archive of tables)".into());
    }
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    if archive.len() > MOST_PARTS {
        return Err(format!("it has {} parts, at most {MOST_PARTS} are read", archive.len()));
    }
    let mut left = MOST_BYTES;
    for at in 0..archive.len() {
        let mut part = archive.by_index(at).map_err(|error| error.to_string())?;
        let name: String = part.name().map(|name| name.chars().take(80).collect()).unwrap_or_default();
        let of_part = |what: &str| format!("its part `{}` {what}", name.escape_debug());
        let mut text = Vec::new();
        part.by_ref().take(left + 1).read_to_end(&mut text).map_err(|error| of_part(&error.to_string()))?;
        left = left.checked_sub(text.len() as u64).ok_or_else(|| {
            of_part(&format!(
                "makes its parts larger than {} in all: save the geometry's sheets as a workbook of their own",
                megabytes(MOST_BYTES)
            ))
        })?;
        let is_text = [".xml", ".rels"].iter().any(|end| name.to_ascii_lowercase().ends_with(end));
        if is_text && memchr::memchr(0, &text).is_some() {
            return Err(of_part("is not in UTF-8: save the workbook again"));
        }
        if let Some(cell) = places(&text).find(|cell| is_no_place(cell)) {
            let cell: String = String::from_utf8_lossy(cell).chars().take(20).collect();
            return Err(of_part(&format!(
                "calls a cell `{}`, beyond the last column XFD: save the workbook again",
                cell.escape_debug()
            )));
        }
        if let Some(claimed) = claims(&text).find(|claimed| *claimed > text.len() as u64) {
            return Err(of_part(&format!(
                "says that it has {claimed} texts, in {} bytes: save the workbook again",
                text.len()
            )));
        }
    }
    Ok(())
}

/// The values of every attribute `r` and `ref`: cells, and the first and last cell of a range.
fn places(text: &[u8]) -> impl Iterator<Item = &[u8]> + '_ {
    let of = |name: &'static [u8]| {
        memmem::find_iter(text, name).filter_map(move |at| {
            let own = at.checked_sub(1).is_some_and(|before| text[before].is_ascii_whitespace());
            let behind = text[at + name.len()..].trim_ascii_start().strip_prefix(b"=")?.trim_ascii_start();
            let said = behind.strip_prefix(b"\"").or_else(|| behind.strip_prefix(b"'"))?;
            // limited to the length of a range reference, so that an unclosed quote does not make
            // every search scan the rest
            let said = &said[..said.len().min(LONGEST_PLACE)];
            own.then(|| &said[..memchr::memchr2(b'"', b'\'', said).unwrap_or(said.len())])
        })
    };
    of(b"r").chain(of(b"ref")).flat_map(|said| said.split(|byte| *byte == b':'))
}

/// Whether a reference has more letters or digits than the last cell, XFD1048576; the reader would
/// overflow while it multiplies them up.
fn is_no_place(cell: &[u8]) -> bool {
    let letters = cell.iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
    let figures = cell[letters..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    letters > 3 || figures > 7
}

/// The value of every `uniqueCount`; saturates where the number does not fit.
fn claims(text: &[u8]) -> impl Iterator<Item = u64> + '_ {
    const NAME: &[u8] = b"uniqueCount";
    memmem::find_iter(text, NAME).map(|at| {
        let behind = &text[at + NAME.len()..];
        let digits = behind
            .iter()
            .skip_while(|byte| byte.is_ascii_whitespace() || b"=\"'+".contains(byte))
            .take_while(|byte| byte.is_ascii_digit());
        digits.fold(0u64, |sum, byte| sum.saturating_mul(10).saturating_add(u64::from(byte - b'0')))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use zip::write::SimpleFileOptions;

    fn of(parts: &[(&str, &[u8])]) -> Vec<u8> {
        let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, text) in parts {
            zip.start_file(*name, SimpleFileOptions::default()).expect("a part");
            zip.write_all(text).expect("written");
        }
        zip.finish().expect("closed").into_inner()
    }

    #[test]
    fn claims_and_bombs_are_refused_with_their_part() {
        let good = of(&[("xl/sharedStrings.xml", b"<sst uniqueCount=\"3\"><si><t>a</t></si></sst>")]);
        assert_eq!(refuse_lies(&good), Ok(()));
        let cells = b"<dimension ref=\"A1:XFD1048576\"/><c r=\"B2\" t=\"inlineStr\"/><hyperlink ref='C3' r:id=\"rId12345678\"/>";
        assert_eq!(refuse_lies(&of(&[("xl/worksheets/sheet1.xml", cells)])), Ok(()));
        for (name, text, wanted) in [
            ("xl/sharedStrings.xml", &b"<sst uniqueCount = '900000000000'/>"[..], "900000000000 texts"),
            ("xl/sharedStrings.xml", b"<sst count='1' uniqueCount='+999'/>", "999 texts"),
            ("xl/worksheets/sheet1.xml", b"<dimension ref=\"A1:AinlineStr\">", "`AinlineStr`"),
            ("xl/worksheets/sheet1.xml", b"<c t='s' r = 'ABCDEFGHIJ1'>", "`ABCDEFGHIJ1`"),
            ("xl/worksheets/sheet1.xml", b"<row r=\"99999999999\">", "`99999999999`"),
            ("xl/a.xml", b"<\0s\0s\0t\0", "UTF-8"),
            ("xl/worksheets/sheet1.xml", &vec![b' '; 5_000_000], "larger than"),
        ] {
            let said = refuse_lies(&of(&[(name, text)])).expect_err("a lie");
            assert!(said.contains(name) && said.contains(wanted), "{said}");
        }
        assert!(refuse_lies(b"\xd0\xcf\x11\xe0").is_err());
    }
}

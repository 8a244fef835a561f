//! Sheets of a workbook, or csv files of a folder, as rows of cells. Only the requested tables are
//! read, cell by cell, up to the size that a geometry can have.
//!
//! A workbook's claims are checked before its reader acts on them. A workbook is an archive of
//! texts. Its reader allocates as many shared texts as one attribute claims, and keeps the inflated
//! texts in memory. Both are checked here by inflating every part once and discarding it.

use crate::untrusted_input::megabytes;
use crate::{advice, untrusted_input};
use calamine::{DataRef, Reader, Xlsx};
use memchr::memmem;
use std::collections::BTreeMap;
use std::io::{BufReader, Cursor, ErrorKind, Read};
use std::path::Path;
use zip::ZipArchive;

/// A cell: text as written, or a number.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum SheetCell {
    Empty,
    Text(String),
    Number(f64),
}

/// Rows of one sheet, each with its row number in the spreadsheet.
pub(super) type Table = Vec<(usize, Vec<SheetCell>)>;

/// The requested tables, and the names of all tables found.
#[derive(Debug, Default)]
pub(super) struct Tables {
    pub named: BTreeMap<String, Table>,
    pub available: Vec<String>,
}

/// Most rows of a table; a row is a channel or an impact.
const MOST_ROWS: usize = 10_000;
/// Most columns; a geometry has about ten.
const MOST_COLUMNS: usize = 256;
/// Most cells of all tables together, and most bytes of text in them.
const MOST_CELLS: usize = 500_000;
const MOST_TEXT: usize = 8 << 20;
/// Largest workbook, bytes.
const MOST_BYTES: u64 = 8 << 20;
/// Most sheets that a message lists.
const MOST_NAMED: usize = 40;

/// What may still be read, over all tables.
struct Room {
    cells: usize,
    text: usize,
}

impl Room {
    const ALL: Room = Room { cells: MOST_CELLS, text: MOST_TEXT };

    /// Puts a cell into a row. `at` returns the place for an error message.
    fn put(
        &mut self,
        row: &mut Vec<SheetCell>,
        column: usize,
        cell: SheetCell,
        at: impl Fn() -> String,
    ) -> Result<(), String> {
        let of_geometry =
            "a geometry has a row for each channel or impact: clear the cells next to its table";
        if column >= MOST_COLUMNS {
            return Err(format!("{}: column {} of at most {MOST_COLUMNS}; {of_geometry}", at(), column + 1));
        }
        let added = (column + 1).saturating_sub(row.len());
        let text = if let SheetCell::Text(text) = &cell { text.len() } else { 0 };
        let (Some(cells), Some(text)) = (self.cells.checked_sub(added), self.text.checked_sub(text)) else {
            let most = megabytes(MOST_TEXT as u64);
            return Err(format!("{}: more than {MOST_CELLS} cells, or {most} of text; {of_geometry}", at()));
        };
        (self.cells, self.text) = (cells, text);
        if added > 0 {
            row.resize(column + 1, SheetCell::Empty);
        }
        row[column] = cell;
        Ok(())
    }
}

fn too_many_rows(at: &str) -> String {
    format!(
        "{at}: more than {MOST_ROWS} rows; a geometry has a row for each channel or impact: clear the cells below its table"
    )
}

/// Reads the wanted sheets of a workbook, or returns why it cannot be read.
pub(super) fn workbook_tables(path: &Path, wanted: &[&str]) -> Result<Tables, String> {
    let bytes = untrusted_input::bytes(path, MOST_BYTES).map_err(|error| told(&error))?;
    refuse_lies(&bytes)?;
    let mut workbook: Xlsx<_> = Xlsx::new(Cursor::new(bytes)).map_err(|error| error.to_string())?;
    let mut room = Room::ALL;
    let mut found = Tables::default();
    found.available.extend(workbook.sheet_names().into_iter().take(MOST_NAMED));
    for sheet in wanted {
        if !workbook.sheet_names().iter().any(|name| name == sheet) {
            continue;
        }
        let of_sheet = |error: calamine::XlsxError| format!("sheet `{sheet}`: {error}");
        let mut cells = match workbook.worksheet_cells_reader(sheet) {
            Ok(cells) => cells,
            // a sheet that contains a chart
            Err(calamine::XlsxError::NotAWorksheet(_)) => continue,
            Err(error) => return Err(of_sheet(error)),
        };
        let mut table: Table = Vec::new();
        let mut read = 0;
        while let Some(cell) = cells.next_cell().map_err(of_sheet)? {
            let (row, column) = (cell.get_position().0 as usize + 1, cell.get_position().1 as usize);
            let at = || format!("sheet `{sheet}`, row {row}");
            read += 1;
            if read > MOST_CELLS {
                return Err(format!("{}: more than {MOST_CELLS} cells", at()));
            }
            let cell = of_workbook(cell.get_value(), &room);
            if cell.is_err() {
                return Err(format!("{}: more than {} of text in all", at(), megabytes(MOST_TEXT as u64)));
            }
            let Ok(Some(cell)) = cell else { continue };
            match table.last() {
                Some((last, _)) if *last == row => {}
                Some((last, _)) if *last > row => {
                    return Err(format!("{}: it is below row {last}: save the workbook again", at()));
                }
                _ if table.len() >= MOST_ROWS => return Err(too_many_rows(&at())),
                _ => table.push((row, Vec::new())),
            }
            if let Some((_, cells)) = table.last_mut() {
                room.put(cells, column, cell, at)?;
            }
        }
        found.named.insert((*sheet).into(), table);
    }
    Ok(found)
}

/// A text longer than the remaining limit.
struct TooLong;

/// The contents of a cell; `None` if it is blank. Many cells may refer to one text that the
/// workbook stores once, so its length is checked before it is copied.
fn of_workbook(data: &DataRef<'_>, room: &Room) -> Result<Option<SheetCell>, TooLong> {
    let text = |text: &str| match text.len() <= room.text {
        true if text.trim().is_empty() => Ok(None),
        true => Ok(Some(SheetCell::Text(text.into()))),
        false => Err(TooLong),
    };
    match data {
        DataRef::Empty => Ok(None),
        DataRef::Float(value) => Ok(Some(SheetCell::Number(*value))),
        DataRef::Int(value) => Ok(Some(SheetCell::Number(*value as f64))),
        DataRef::String(owned) => text(owned),
        DataRef::SharedString(shared) => text(shared),
        other => text(&calamine::Data::from(other.clone()).to_string()),
    }
}

/// Reads the wanted csv files of a folder, named by their stems, or returns why they cannot be
/// read.
pub(super) fn csv_tables(path: &Path, wanted: &[&str]) -> Result<Tables, String> {
    let mut room = Room::ALL;
    let mut left = untrusted_input::TABLE;
    let mut found = Tables::default();
    for entry in std::fs::read_dir(path).map_err(|error| told(&error))? {
        let file = entry.map_err(|error| told(&error))?.path();
        if file.extension().is_none_or(|e| !e.eq_ignore_ascii_case("csv")) {
            continue;
        }
        let Some(sheet) = file.file_stem().and_then(|s| s.to_str()) else { continue };
        if found.available.len() < MOST_NAMED {
            found.available.push(sheet.into());
        }
        if wanted.contains(&sheet) {
            let of_file = |what: String| format!("{}: {what}", file.display());
            let text = untrusted_input::text(&file, left).map_err(|error| of_file(told(&error)))?;
            left -= text.len() as u64;
            let table = csv_table(&text, &mut room).map_err(of_file)?;
            found.named.insert(sheet.to_string(), table);
        }
    }
    found.available.sort_unstable();
    if found.available.is_empty() {
        return Err(
            "the folder has no .csv tables; they are named Channels_A.csv, Impacts_A.csv and so on".into()
        );
    }
    Ok(found)
}

fn csv_table(text: &str, room: &mut Room) -> Result<Table, String> {
    let delimiter = delimiter(text);
    // the csv reader allocates every column of a row before they can be counted
    let wide = |line: &str| line.bytes().filter(|byte| *byte == delimiter).count() >= MOST_COLUMNS;
    if let Some(at) = text.split('\n').position(wide) {
        return Err(format!(
            "row {}: column {} of at most {MOST_COLUMNS}; a geometry has some ten columns: clear the cells next to its table",
            at + 1,
            MOST_COLUMNS + 1
        ));
    }
    let from = BufReader::new(text.as_bytes().take(text.len() as u64));
    let mut reader =
        csv::ReaderBuilder::new().delimiter(delimiter).has_headers(false).flexible(true).from_reader(from);
    let mut table: Table = Vec::new();
    // line numbers are counted from the previous row: counting from the start for every row would
    // take quadratic time
    let (mut counted, mut line) = (0, 1);
    for record in reader.records() {
        let record = record.map_err(|error| error.to_string())?;
        // The reader's own line number is one too small in files with CR LF; its byte position may
        // be at line ends before the record.
        let byte = record.position().map_or(0, |p| p.byte() as usize).max(counted);
        let ends = text.as_bytes()[byte..].iter().take_while(|byte| matches!(byte, b'\r' | b'\n')).count();
        let end = byte + ends;
        line += text[counted..end].matches('\n').count();
        counted = end;
        let at = || format!("row {line}");
        if table.len() >= MOST_ROWS {
            return Err(too_many_rows(&at()));
        }
        let mut cells = Vec::new();
        for (column, text) in record.iter().enumerate() {
            let cell = match text.trim_start_matches('\u{feff}').trim() {
                "" => SheetCell::Empty,
                // the first line with which a spreadsheet program declares its delimiter
                text if table.is_empty() && text.to_lowercase().starts_with("sep=") => SheetCell::Empty,
                text => match decimal(text, delimiter) {
                    Some(number) => SheetCell::Number(number),
                    None => SheetCell::Text(text.into()),
                },
            };
            room.put(&mut cells, column, cell, at)?;
        }
        table.push((line, cells));
    }
    Ok(table)
}

/// The delimiter of a table, from the line of its headings: a comma, or a semicolon or a tab where
/// there are more of these.
pub(crate) fn delimiter(text: &str) -> u8 {
    let heading = text.lines().find(|line| line.contains([',', ';', '\t'])).unwrap_or_default();
    let count = |delimiter: u8| heading.bytes().filter(|byte| *byte == delimiter).count();
    [b',', b';', b'\t'].into_iter().rev().max_by_key(|delimiter| count(*delimiter)).unwrap_or(b',')
}

/// Parses a number with a decimal comma, in a table whose delimiter is not a comma.
fn decimal(text: &str, delimiter: u8) -> Option<f64> {
    let comma = delimiter != b',' && text.matches(',').count() == 1 && !text.contains('.');
    let digits =
        text.bytes().all(|byte| byte.is_ascii_digit() || matches!(byte, b',' | b'-' | b'+' | b'e' | b'E'));
    if comma && digits { text.replace(',', ".").parse().ok() } else { None }
}

fn told(error: &std::io::Error) -> String {
    match error.kind() {
        // the caller's message says what to give instead
        ErrorKind::NotFound => error.to_string(),
        _ => format!("{error}; {}", advice::reading(error)),
    }
}

/// Most bytes of all inflated parts together; the paper's workbook has 70 kB.
const MOST_WORKBOOK_BYTES: u64 = 4 << 20;

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
    let mut left = MOST_WORKBOOK_BYTES;
    for at in 0..archive.len() {
        let mut part = archive.by_index(at).map_err(|error| error.to_string())?;
        let name: String = part.name().map(|name| name.chars().take(80).collect()).unwrap_or_default();
        let of_part = |what: &str| format!("its part `{}` {what}", name.escape_debug());
        let mut text = Vec::new();
        part.by_ref().take(left + 1).read_to_end(&mut text).map_err(|error| of_part(&error.to_string()))?;
        left = left.checked_sub(text.len() as u64).ok_or_else(|| {
            of_part(&format!(
                "makes its parts larger than {} in all: save the geometry's sheets as a separate workbook",
                megabytes(MOST_WORKBOOK_BYTES)
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

    #[test]
    fn rows_keep_their_numbers_with_either_end_of_line_and_breaks_in_quotes() {
        for end in ["\n", "\r\n"] {
            let text = ["a,b", "1,2", "\"x", "y\",3", "", "4,5", ""].join(end);
            let rows: Vec<usize> =
                csv_table(&text, &mut Room { ..Room::ALL }).expect("a table").iter().map(|r| r.0).collect();
            assert_eq!(rows, [1, 2, 3, 6], "{end:?}");
        }
    }

    #[test]
    fn a_long_table_takes_no_longer_for_each_row() {
        let begun = std::time::Instant::now();
        let text = "1,2,3,4,5,6,7,8,9,10\n".repeat(MOST_ROWS);
        assert_eq!(csv_table(&text, &mut Room { ..Room::ALL }).expect("a table").len(), MOST_ROWS);
        assert!(begun.elapsed().as_secs() < 2);
        let said = csv_table(&format!("{text}1\n"), &mut Room { ..Room::ALL }).expect_err("one too many");
        assert!(said.contains("row 10001") && said.contains("clear"), "{said}");
        let said = csv_table(&",".repeat(300), &mut Room { ..Room::ALL }).expect_err("too wide");
        assert!(said.contains("row 1: column 257"), "{said}");
    }
}

#[cfg(test)]
mod workbook_parts_tests {
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

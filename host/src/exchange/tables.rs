//! Sheets of a workbook, or csv files of a folder, as plain rows of cells.

use calamine::{Data, Reader, Xlsx, open_workbook};
use std::collections::BTreeMap;
use std::path::Path;

/// A cell: text as it stands, or a number.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell {
    Empty,
    Text(String),
    Number(f64),
}

/// Rows of one sheet with the spreadsheet's row number of each.
pub(super) type Table = Vec<(usize, Vec<Cell>)>;

/// All sheets of a workbook, or why it cannot be read.
pub(super) fn workbook_tables(path: &Path) -> Result<BTreeMap<String, Table>, String> {
    let mut workbook: Xlsx<_> = open_workbook(path).map_err(|e: calamine::XlsxError| e.to_string())?;
    let mut tables = BTreeMap::new();
    for sheet in workbook.sheet_names() {
        let range = workbook.worksheet_range(&sheet).map_err(|e| format!("sheet `{sheet}`: {e}"))?;
        let first = range.start().map_or(0, |(row, _)| row as usize);
        let rows = range
            .rows()
            .enumerate()
            .map(|(i, row)| (first + i + 1, row.iter().map(cell).collect()))
            .collect();
        tables.insert(sheet, rows);
    }
    Ok(tables)
}

fn cell(data: &Data) -> Cell {
    match data {
        Data::Empty => Cell::Empty,
        Data::Float(v) => Cell::Number(*v),
        Data::Int(v) => Cell::Number(*v as f64),
        Data::String(text) if text.trim().is_empty() => Cell::Empty,
        Data::String(text) => Cell::Text(text.clone()),
        other => Cell::Text(other.to_string()),
    }
}

/// All csv files of a folder, named by their stems, or why they cannot be read.
pub(super) fn csv_tables(path: &Path) -> Result<BTreeMap<String, Table>, String> {
    let mut tables = BTreeMap::new();
    for entry in std::fs::read_dir(path).map_err(|e| e.to_string())? {
        let file = entry.map_err(|e| e.to_string())?.path();
        if file.extension().is_none_or(|e| !e.eq_ignore_ascii_case("csv")) {
            continue;
        }
        let Some(sheet) = file.file_stem().and_then(|s| s.to_str()) else { continue };
        let text = std::fs::read_to_string(&file).map_err(|e| format!("{}: {e}", file.display()))?;
        let mut reader =
            csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(text.as_bytes());
        let mut table: Table = Vec::new();
        for record in reader.records() {
            let record = record.map_err(|e| format!("{}: {e}", file.display()))?;
            // The reader's own line number lags by one in files with CR LF; its byte position may stand on
            // the previous line's LF, which is counted then.
            let byte = record.position().map_or(0, |p| p.byte() as usize);
            let row = 1 + text.bytes().take(byte + 1).filter(|&b| b == b'\n').count();
            let cells = record
                .iter()
                .map(|text| match text.trim_start_matches('\u{feff}').trim() {
                    "" => Cell::Empty,
                    text => Cell::Text(text.into()),
                })
                .collect();
            table.push((row, cells));
        }
        tables.insert(sheet.to_string(), table);
    }
    if tables.is_empty() {
        return Err(
            "the folder has no .csv tables; they are named Channels_A.csv, Impacts_A.csv and so on".into()
        );
    }
    Ok(tables)
}

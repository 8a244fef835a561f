//! Data set 151: the file's header. Seven lines of texts, dates and versions.

use super::lines::{Lines, Wrong, integer, unless_none};
use crate::lines::{Output, integers, label};

/// The program that wrote the file, and when. Dates and times are stored as written: `21-Nov-26`,
/// `14:30:00`.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Header {
    /// Name of the model's file.
    pub model: String,
    /// Description of the model.
    pub description: String,
    /// The program that made the database.
    pub database_program: String,
    /// Date and time when the database was made.
    pub created: [String; 2],
    /// Two version numbers of the database.
    pub versions: [i64; 2],
    /// 0 universal, 1 archive, 2 other.
    pub file_type: i64,
    /// Date and time when the database was last saved.
    pub saved: [String; 2],
    /// The program that wrote the file.
    pub program: String,
    /// Date and time when the file was written.
    pub written: [String; 2],
}

pub(super) fn read(mut lines: Lines<'_>) -> Result<Header, Wrong> {
    let model = lines.text("the model's file name")?.label();
    let description = lines.text("the description")?.label();
    let database_program = lines.text("the program of the database")?.label();
    let fourth = lines.text("the date of the database")?;
    let [date, time, first, second, kind] = fourth.columns([10; 5]);
    let number = |field: &str| {
        integer(field).ok_or_else(|| fourth.wrong(format!("`{field}` is not a version number or file type")))
    };
    let versions = [number(&first)?, number(&second)?];
    let file_type = number(&kind)?;
    let saved = lines.text("the date of saving")?.columns([10; 2]);
    let program = lines.text("the program that wrote the file")?.label();
    let written = lines.text("the date of writing")?.columns([10; 2]);
    let dates = |pair: [String; 2]| pair.map(|text| unless_none(&text));
    Ok(Header {
        model,
        description,
        database_program,
        created: dates([date, time]),
        versions,
        file_type,
        saved: dates(saved),
        program,
        written: dates(written),
    })
}

pub(super) fn write(header: &Header, out: &mut Output) -> Result<(), String> {
    out.open(151, "");
    out.label("the model's file name", &header.model)?;
    out.label("the description", &header.description)?;
    out.label("the program of the database", &header.database_program)?;
    let dates = |pair: &[String; 2]| {
        Ok::<_, String>(label("the date", &pair[0], 10)? + &label("the time", &pair[1], 10)?)
    };
    let numbers = [header.versions[0], header.versions[1], header.file_type];
    out.line(&(dates(&header.created)? + &integers("a version", &numbers, 10)?));
    out.line(&dates(&header.saved)?);
    out.label("the program that wrote the file", &header.program)?;
    out.line(&dates(&header.written)?);
    out.close();
    Ok(())
}

//! Data about the whole campaign: its plans, notes and log.

use rusqlite::{Connection, OptionalExtension};

use super::Store;
use super::error::StoreError;
use super::table::{Row, table};
use crate::campaign::plan::{Plan, measured_again};

table! {
    /// A plan; the last one is in effect.
    pub(super) struct PlanText {
        "plan" {
            "id INTEGER PRIMARY KEY",
            /// Start of its validity, RFC 3339.
            utc: String = "utc TEXT NOT NULL",
            /// The name of the file that it came from.
            source: String = "source TEXT NOT NULL",
            /// Its complete text.
            text: String = "text TEXT NOT NULL",
        }
    }
}

table! {
    /// A line of the log.
    pub(super) struct LogLine {
        "log" {
            "id INTEGER PRIMARY KEY",
            /// Time, RFC 3339.
            utc: String = "utc TEXT NOT NULL",
            /// The event.
            text: String = "text TEXT NOT NULL",
        }
    }
}

/// Current time in the format of the file: RFC 3339, UTC.
pub fn utc_now() -> String {
    jiff::Timestamp::now().to_string()
}

/// Stores the plan in `text`, which is in effect from now on.
pub(super) fn write_plan(connection: &Connection, text: &str, source: &str) -> rusqlite::Result<()> {
    PlanText { utc: utc_now(), source: source.into(), text: text.into() }.insert(connection, &[])
}

/// Adds a line to the log.
pub(super) fn write_log(connection: &Connection, text: &str) -> rusqlite::Result<()> {
    LogLine { utc: utc_now(), text: text.into() }.insert(connection, &[])
}

/// Writes a note about the whole campaign.
fn write_meta(connection: &Connection, key: &str, value: &str) -> rusqlite::Result<()> {
    connection.execute("INSERT OR REPLACE INTO meta VALUES (?1, ?2)", [key, value]).map(|_| ())
}

/// Key of the note with the accepted changes of the structure: a JSON list of sentences.
const STRUCTURES: &str = "structure_changes";

/// Key of the note with what was measured again: a JSON list of sentences.
const MEASURED_AGAIN: &str = "measured_again";

impl Store {
    /// Notes that the campaign continues on another structure, and the evidence for it.
    pub(crate) fn note_another_structure(&self, what: &str) -> Result<(), StoreError> {
        let text = self.with_sentence(STRUCTURES, what)?;
        self.set_meta(STRUCTURES, &text)?;
        self.log(&format!("another structure was accepted: {what}"))
    }

    /// Evidence of a changed structure, for each time that it was accepted.
    ///
    /// # Errors
    /// The note cannot be read.
    pub fn structure_changes(&self) -> Result<Vec<String>, StoreError> {
        self.sentences(STRUCTURES)
    }

    /// What was measured again, for each time that it was entered.
    ///
    /// # Errors
    /// The note cannot be read.
    pub fn measured_again(&self) -> Result<Vec<String>, StoreError> {
        self.sentences(MEASURED_AGAIN)
    }

    fn sentences(&self, key: &str) -> Result<Vec<String>, StoreError> {
        let read = |text: String| {
            serde_json::from_str(&text).map_err(|error| self.content(format!("the note {key}: {error}")))
        };
        Ok(self.meta(key)?.map(read).transpose()?.unwrap_or_default())
    }

    /// The note with one more sentence, after the present time.
    fn with_sentence(&self, key: &str, sentence: &str) -> Result<String, StoreError> {
        let mut all = self.sentences(key)?;
        all.push(format!("{}: {sentence}", utc_now()));
        serde_json::to_string(&all).map_err(|error| self.content(error.to_string()))
    }

    /// Takes over the plan in `text`, which errors call `source`, as far as it states places and
    /// what is known beforehand: they were measured again. Records and cells stay, and so do the
    /// earlier plans. Returns what is stated differently, a sentence each.
    ///
    /// # Errors
    /// The plan is wrong, or differs in something else, or in nothing.
    pub fn measure_again(&self, text: &str, source: &str, reason: &str) -> Result<Vec<String>, StoreError> {
        Plan::parse_new(text, source)?;
        let changes = measured_again(&self.plan_text()?.0, text).map_err(|what| StoreError::PlanChange {
            path: self.path.clone(),
            source_name: source.into(),
            what,
        })?;
        let entry = format!("{reason}: {}", changes.join("; "));
        let note = self.with_sentence(MEASURED_AGAIN, &entry)?;
        self.change("entering what was measured again", |connection| {
            write_plan(connection, text, source)?;
            write_meta(connection, MEASURED_AGAIN, &note)?;
            write_log(connection, &format!("measured again ({source}): {entry}"))
        })?;
        Ok(changes)
    }

    /// The current plan.
    pub fn plan(&self) -> Result<Plan, StoreError> {
        let (text, source) = self.plan_text()?;
        Ok(Plan::parse(&text, &source)?)
    }

    /// Every plan that the file has had, with its id; the last one is in effect.
    ///
    /// # Errors
    /// The file cannot be read, or a text is not a valid plan.
    pub fn plans(&self) -> Result<Vec<(i64, Plan)>, StoreError> {
        let sql = format!("SELECT {}, id FROM plan ORDER BY id", PlanText::list());
        let read = |row: &rusqlite::Row<'_>| Ok((row.get("id")?, PlanText::read(row)?));
        let texts: Vec<(i64, PlanText)> = self.all(&sql, [], read, "reading the plans")?;
        texts.into_iter().map(|(id, plan)| Ok((id, Plan::parse(&plan.text, &plan.source)?))).collect()
    }

    /// The plan's text and the name of the file that it came from.
    pub fn plan_text(&self) -> Result<(String, String), StoreError> {
        let sql = format!("SELECT {} FROM plan ORDER BY id DESC LIMIT 1", PlanText::list());
        let plan = self.connection.query_row(&sql, [], PlanText::read);
        plan.map(|plan| (plan.text, plan.source)).map_err(self.failed("reading the plan"))
    }

    /// A note about the whole campaign.
    pub fn meta(&self, key: &str) -> Result<Option<String>, StoreError> {
        self.connection
            .query_row("SELECT value FROM meta WHERE key = ?1", [key], |row| row.get(0))
            .optional()
            .map_err(self.failed("reading notes"))
    }

    /// Writes a note about the whole campaign.
    pub fn set_meta(&self, key: &str, value: &str) -> Result<(), StoreError> {
        self.change("writing notes", |connection| write_meta(connection, key, value))
    }

    /// The lines of the log after line `after`, in order: id, time (RFC 3339, UTC), text.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn log_lines(&self, after: i64) -> Result<Vec<(i64, String, String)>, StoreError> {
        self.all(
            "SELECT id, utc, text FROM log WHERE id > ?1 ORDER BY id",
            [after],
            |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)),
            "reading the log",
        )
    }

    /// A number that changes whenever another connection, of this process or another, has written
    /// to the file.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn data_version(&self) -> Result<i64, StoreError> {
        self.connection
            .query_row("PRAGMA data_version", [], |row| row.get(0))
            .map_err(self.failed("asking whether the file has changed"))
    }

    /// Adds a line to the campaign's log.
    pub fn log(&self, text: &str) -> Result<(), StoreError> {
        self.change("writing the log", |connection| write_log(connection, text))
    }
}

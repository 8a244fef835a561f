//! Records in the campaign file: stored once, read back checked, never changed.

use rusqlite::params;

use super::codec;
use super::judge::Kind;
use super::rows::{Damage, NewRecord, RecordRow, Samples, seal};
use super::store::{Store, utc_now};
use super::store_error::StoreError;
use crate::device::recording::Recording;

/// The columns that [`RecordRow::read`] reads.
const COLUMNS: &str = "id, cell, attempt, session, utc, epoch, first_scan, trigger_index, scans, channels, shot, gaps, \
                       verdict, measure, limit_value, sentence, crc32, \
                       (SELECT verdict FROM overrules WHERE record = records.id ORDER BY id DESC LIMIT 1)";

impl Store {
    /// Stores one record for good; returns its id.
    pub fn insert(&self, record: &NewRecord) -> Result<i64, StoreError> {
        let Recording { epoch, first_scan, trigger_index, channels, codes, shot, .. } = &record.recording;
        let blob = codec::encode(codes, *channels)
            .map_err(|error| self.content(format!("a record could not be compressed: {error}")))?;
        let json = |text: Result<String, serde_json::Error>| {
            text.map_err(|error| self.content(format!("a record could not be written: {error}")))
        };
        let (crc, scans) = (codec::checksum(codes), record.recording.scans());
        let shot_text = json(serde_json::to_string(shot))?;
        let gaps = json(serde_json::to_string(&record.recording.gaps))?;
        let judged = &record.judgement;
        let row = RecordRow {
            id: 0,
            cell: record.cell,
            attempt: record.attempt,
            session: record.session,
            utc: record.utc.clone(),
            epoch: *epoch,
            first_scan: *first_scan,
            trigger_index: *trigger_index,
            scans,
            channels: *channels,
            shot: *shot,
            gaps: record.recording.gaps.clone(),
            verdict: judged.kind,
            measure: judged.measure,
            limit: judged.limit,
            sentence: judged.sentence.clone(),
            crc,
            overruled: None,
        };
        self.connection
            .execute(
                "INSERT INTO records (cell, attempt, session, utc, epoch, first_scan, trigger_index, scans, channels, \
                 pulse_us, peak_n, shot, gaps, verdict, measure, limit_value, sentence, crc32, seal, samples) \
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19, ?20)",
                params![
                    row.cell,
                    row.attempt,
                    row.session,
                    row.utc,
                    row.epoch,
                    row.first_scan,
                    row.trigger_index,
                    row.scans,
                    row.channels,
                    shot.pulse_us,
                    shot.peak_n,
                    shot_text,
                    gaps,
                    judged.kind.name(),
                    judged.measure,
                    judged.limit,
                    judged.sentence,
                    crc,
                    seal(&row),
                    blob,
                ],
            )
            .map_err(self.failed("storing a record"))?;
        Ok(self.connection.last_insert_rowid())
    }

    /// Gives a cell up, with the reason.
    pub fn give_up(&self, cell: i64, reason: &str) -> Result<(), StoreError> {
        self.connection
            .execute("UPDATE cells SET given_up = ?2 WHERE id = ?1", params![cell, reason])
            .map(|_| ())
            .map_err(self.failed("giving a cell up"))
    }

    /// Overrules a record's verdict; the first one stays in the file too.
    pub fn overrule(&self, record: i64, verdict: Kind, reason: &str) -> Result<(), StoreError> {
        self.connection
            .execute(
                "INSERT INTO overrules (record, utc, verdict, reason) VALUES (?1, ?2, ?3, ?4)",
                params![record, utc_now(), verdict.name(), reason],
            )
            .map(|_| ())
            .map_err(self.failed("overruling a verdict"))
    }

    /// Every record without its samples, in order of measurement.
    pub fn records(&self) -> Result<Vec<RecordRow>, StoreError> {
        let sql = format!("SELECT {COLUMNS} FROM records ORDER BY id");
        self.all(&sql, [], RecordRow::read, "reading records")
    }

    /// The samples of one record, checked against their checksum.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] names the record.
    pub fn samples(&self, record: &RecordRow) -> Result<Samples, StoreError> {
        let blob: Vec<u8> = self
            .connection
            .query_row("SELECT samples FROM records WHERE id = ?1", [record.id], |row| row.get(0))
            .map_err(self.failed("reading samples"))?;
        let codes = codec::decode(&blob, record.channels, record.scans, record.crc)
            .map_err(|source| StoreError::Damaged { path: self.path.clone(), record: record.id, source })?;
        Ok(Samples { codes, channels: record.channels, trigger_index: record.trigger_index })
    }

    /// Bytes of all samples as stored, and as raw codes.
    pub fn sample_bytes(&self) -> Result<(u64, u64), StoreError> {
        let sql =
            "SELECT coalesce(sum(length(samples)), 0), coalesce(sum(2 * scans * channels), 0) FROM records";
        self.connection
            .query_row(sql, [], |row| Ok((row.get(0)?, row.get(1)?)))
            .map_err(self.failed("measuring the file"))
    }

    /// Checks the file's structure and every record's checksum; what is damaged is named.
    pub fn verify(&self) -> Result<Vec<Damage>, StoreError> {
        let mut damage = Vec::new();
        let said: Vec<String> =
            self.all("PRAGMA integrity_check", [], |row| row.get(0), "checking the file's structure")?;
        if said != ["ok"] {
            damage.extend(said.into_iter().map(|what| Damage { record: None, what }));
        }
        let ids: Vec<(i64, u32)> = self.all(
            "SELECT id, seal FROM records ORDER BY id",
            [],
            |row| Ok((row.get(0)?, row.get(1)?)),
            "reading records",
        )?;
        for (id, stored) in ids {
            let mut damaged = |what: String| damage.push(Damage { record: Some(id), what });
            let sql = format!("SELECT {COLUMNS} FROM records WHERE id = ?1");
            match self.all(&sql, [id], RecordRow::read, "reading a record") {
                Err(error) => damaged(error.to_string()),
                Ok(rows) => match rows.first() {
                    None => damaged("the record's row cannot be found".into()),
                    Some(row) if seal(row) != stored => damaged("its description was changed".into()),
                    Some(row) => match self.samples(row) {
                        Ok(_) => {}
                        Err(StoreError::Damaged { source, .. }) => damaged(source.to_string()),
                        Err(other) => damaged(other.to_string()),
                    },
                },
            }
        }
        Ok(damage)
    }
}

#[cfg(test)]
#[path = "store_tests.rs"]
mod tests;

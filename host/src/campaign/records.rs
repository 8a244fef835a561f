//! Records in the campaign file: stored once, read back checked, never changed.

use rusqlite::types::Value;
use rusqlite::{Row, params};

use super::codec::{self, CodecError};
use super::judge::Kind;
use super::rows::{Counters, Damage, NewRecord, Overrule, RecordRow, Samples};
use super::seal;
use super::store::{Store, utc_now};
use super::store_error::StoreError;
use crate::device::recording::Recording;

/// The index that knows every record's cell and attempt without its row.
const INDEX: &str = "sqlite_autoindex_records_1";

impl Store {
    /// Stores one record for good, and with it the link's `counters` so far; returns its id.
    pub fn insert(&self, record: &NewRecord, counters: &Counters) -> Result<i64, StoreError> {
        let Recording { epoch, first_scan, trigger_index, channels, codes, shot, .. } = &record.recording;
        let bytes = codec::encode(codes, *channels)
            .map_err(|error| self.content(format!("a record could not be compressed: {error}")))?;
        let json = |text: Result<String, serde_json::Error>| {
            text.map_err(|error| self.content(format!("a record could not be written: {error}")))
        };
        let whole = |number: u64| Value::Integer(number.cast_signed());
        let judged = &record.judgement;
        let shot_text = json(serde_json::to_string(shot))?;
        let gaps = json(serde_json::to_string(&record.recording.gaps))?;
        let counters_text = json(serde_json::to_string(counters))?;
        let store = || {
            // this is the only writer
            let id: i64 =
                self.connection
                    .query_row("SELECT coalesce(max(id), 0) + 1 FROM records", [], |row| row.get(0))?;
            let values = [
                Value::Integer(id),
                Value::Integer(record.cell),
                Value::Integer(record.attempt.into()),
                Value::Integer(record.session),
                Value::Text(record.utc.clone()),
                Value::Integer((*epoch).into()),
                whole(*first_scan),
                whole(*trigger_index as u64),
                whole(record.recording.scans() as u64),
                whole(*channels as u64),
                Value::Integer(shot.pulse_us.into()),
                Value::Real(shot.peak_n.into()),
                Value::Text(shot_text.clone()),
                Value::Text(gaps.clone()),
                Value::Text(judged.kind.name().into()),
                Value::Real(judged.measure),
                Value::Real(judged.limit),
                Value::Text(judged.sentence.clone()),
                Value::Integer(codec::checksum(codes).into()),
                // the seal of version 1
                Value::Integer(0),
                Value::Real(judged.peak_n),
                record.utc_error_s.map_or(Value::Null, Value::Real),
                Value::Integer(crc32fast::hash(&bytes).into()),
            ];
            let transaction = self.connection.unchecked_transaction()?;
            seal::insert(&transaction, &values, &bytes)?;
            transaction
                .prepare_cached("INSERT OR REPLACE INTO links VALUES (?1, ?2)")?
                .execute(params![record.session, counters_text])?;
            transaction.commit()?;
            Ok(id)
        };
        store().map_err(self.failed("storing a record"))
    }

    /// Gives a cell up, with the reason.
    pub fn give_up(&self, cell: i64, reason: &str) -> Result<(), StoreError> {
        self.connection
            .execute("UPDATE cells SET given_up = ?2 WHERE id = ?1", params![cell, reason])
            .map(|_| ())
            .map_err(self.failed("giving a cell up"))
    }

    /// Notes that a cell is done with fewer good hits than wanted, and why.
    pub fn settle(&self, cell: i64, reason: &str) -> Result<(), StoreError> {
        self.connection
            .execute("UPDATE cells SET settled = ?2 WHERE id = ?1", params![cell, reason])
            .map(|_| ())
            .map_err(self.failed("closing a cell"))
    }

    /// Overrules a record's verdict; the first one stays in the file too. A cell that a refusal leaves with less than it
    /// was settled with is open again.
    pub fn overrule(&self, record: i64, verdict: Kind, reason: &str) -> Result<(), StoreError> {
        let write = || {
            let transaction = self.connection.unchecked_transaction()?;
            transaction.execute(
                "INSERT INTO overrules (record, utc, verdict, reason) VALUES (?1, ?2, ?3, ?4)",
                params![record, utc_now(), verdict.name(), reason],
            )?;
            if verdict != Kind::Good {
                transaction.execute(
                    "UPDATE cells SET settled = NULL WHERE id = (SELECT cell FROM records WHERE id = ?1)",
                    [record],
                )?;
            }
            transaction.commit()
        };
        write().map_err(self.failed("overruling a verdict"))
    }

    /// Has a cell struck anew: its good records are dropped, and it is open again. Returns how many were dropped.
    pub fn redo(&self, cell: i64, reason: &str) -> Result<usize, StoreError> {
        let good: Vec<i64> = self
            .records()?
            .into_iter()
            .filter(|record| record.cell == cell && record.standing() == Kind::Good)
            .map(|record| record.id)
            .collect();
        for record in &good {
            self.overrule(*record, Kind::Dropped, reason)?;
        }
        self.connection
            .execute("UPDATE cells SET settled = NULL, given_up = NULL WHERE id = ?1", [cell])
            .map_err(self.failed("opening a cell again"))?;
        Ok(good.len())
    }

    /// Every time that a person overruled a verdict: record, when, what, why.
    pub fn overrules(&self) -> Result<Vec<Overrule>, StoreError> {
        let read = |row: &Row<'_>| {
            Ok(Overrule { record: row.get(0)?, utc: row.get(1)?, verdict: row.get(2)?, reason: row.get(3)? })
        };
        self.all(
            "SELECT record, utc, verdict, reason FROM overrules ORDER BY id",
            [],
            read,
            "reading overrules",
        )
    }

    /// Every record without its samples, in order of measurement. One whose description is damaged says so
    /// ([`RecordRow::damage`]).
    pub fn records(&self) -> Result<Vec<RecordRow>, StoreError> {
        Ok(self.places()?.into_iter().map(|place| self.record_at(place)).collect())
    }

    /// One record without its samples.
    ///
    /// # Errors
    /// There is none of that id.
    pub fn record(&self, id: i64) -> Result<RecordRow, StoreError> {
        let place = self.places()?.into_iter().find(|place| place.0 == id);
        place.map(|place| self.record_at(place)).ok_or_else(|| {
            self.content(format!("there is no record {id}: `jointrig campaign show` lists them"))
        })
    }

    /// (id, cell, attempt) of every record, from the index: so that a damaged row hides no other.
    fn places(&self) -> Result<Vec<(i64, i64, u32)>, StoreError> {
        let read = |row: &Row<'_>| Ok((row.get(0)?, row.get(1)?, row.get(2)?));
        let sql = format!("SELECT id, cell, attempt FROM records INDEXED BY {INDEX} ORDER BY id");
        self.all(&sql, [], read, "reading the index of records").or_else(|_| {
            self.all("SELECT id, cell, attempt FROM records ORDER BY id", [], read, "reading records")
        })
    }

    fn record_at(&self, (id, cell, attempt): (i64, i64, u32)) -> RecordRow {
        let unreadable = |what| RecordRow::unreadable(id, cell, attempt, what);
        let mut columns = seal::COLUMNS.join(", ");
        let join = if self.version > 1 {
            "LEFT JOIN seals s ON s.record = r.id"
        } else {
            columns = columns.replace("s.peak_n", "NULL").replace("s.utc_error_s", "NULL");
            columns = columns.replace("s.bytes_crc32", "NULL");
            ""
        };
        let seal = if self.version > 1 { "s.seal" } else { "NULL" };
        let sql = format!(
            "SELECT {columns}, {seal}, \
             (SELECT verdict FROM overrules WHERE record = r.id ORDER BY id DESC LIMIT 1) \
             FROM records r {join} WHERE r.id = ?1"
        );
        match self.all(&sql, [id], RecordRow::read, "reading a record") {
            Ok(mut rows) => match rows.pop() {
                Some(row) if self.version > 1 && row.bytes_crc.is_none() => {
                    RecordRow { damage: Some("its seal is missing".into()), ..row }
                }
                // the index and the row must agree on where it belongs
                Some(row) if (row.cell, row.attempt) != (cell, attempt) => {
                    unreadable("its place was changed".into())
                }
                Some(row) => row,
                None => unreadable("its row cannot be found".into()),
            },
            Err(StoreError::Sqlite { source, .. }) => unreadable(format!("its row cannot be read: {source}")),
            Err(other) => unreadable(other.to_string()),
        }
    }

    /// The samples of one record, checked against their checksums.
    ///
    /// # Errors
    /// [`StoreError::Damaged`] names the record.
    pub fn samples(&self, record: &RecordRow) -> Result<Samples, StoreError> {
        let damaged = |source| StoreError::Damaged { path: self.path.clone(), record: record.id, source };
        let read =
            self.connection.query_row("SELECT samples FROM records WHERE id = ?1", [record.id], |row| {
                row.get::<_, Vec<u8>>(0)
            });
        let bytes = read.map_err(|error| damaged(CodecError::Unreadable(error.to_string())))?;
        // a flipped bit in the compressor's padding changes no code, and yet the file is not what was stored
        let found = crc32fast::hash(&bytes);
        if let Some(stored) = record.bytes_crc.filter(|stored| *stored != found) {
            return Err(damaged(CodecError::Bytes { found, stored }));
        }
        let codes = codec::decode(&bytes, record.channels, record.scans, record.crc).map_err(damaged)?;
        Ok(Samples { codes, channels: record.channels, trigger_index: record.trigger_index })
    }

    /// The bytes that hold a record's samples in the file, unchecked.
    pub fn stored_bytes(&self, id: i64) -> Result<Vec<u8>, StoreError> {
        self.connection
            .query_row("SELECT samples FROM records WHERE id = ?1", [id], |row| row.get(0))
            .map_err(self.failed("reading samples"))
    }

    /// Bytes of all samples as stored, and as raw codes.
    pub fn sample_bytes(&self) -> Result<(u64, u64), StoreError> {
        let levels = if self.version >= super::schema::WITH_LEVELS {
            "UNION ALL SELECT length(samples), 2 * scans * channels FROM levels"
        } else {
            ""
        };
        let sql = format!(
            "SELECT coalesce(sum(stored), 0), coalesce(sum(raw), 0) FROM \
             (SELECT length(samples) AS stored, 2 * scans * channels AS raw FROM records {levels})"
        );
        self.connection
            .query_row(&sql, [], |row| Ok((row.get(0)?, row.get(1)?)))
            .map_err(self.failed("measuring the file"))
    }

    /// Checks the file's structure and every record's checksum; what is damaged is named.
    pub fn verify(&self) -> Result<Vec<Damage>, StoreError> {
        let mut damage = Vec::new();
        match self.all("PRAGMA integrity_check", [], |row| row.get::<_, String>(0), "checking") {
            Ok(said) if said == ["ok"] => {}
            Ok(said) => damage.extend(said.into_iter().map(|what| Damage { record: None, what })),
            Err(error) => damage.push(Damage { record: None, what: error.to_string() }),
        }
        for record in self.records()? {
            let what = match (record.damage.clone(), self.samples(&record)) {
                (Some(what), _) => what,
                (None, Err(StoreError::Damaged { source, .. })) => source.to_string(),
                (None, Err(other)) => other.to_string(),
                (None, Ok(_)) => continue,
            };
            damage.push(Damage { record: Some(record.id), what });
        }
        damage.extend(self.verify_levels()?);
        for row in self.frf_rows()? {
            if let Err(error) = self.frf_of(row.id) {
                damage.push(Damage { record: None, what: error.to_string() });
            }
        }
        Ok(damage)
    }
}

#[cfg(test)]
#[path = "store_tests.rs"]
mod tests;

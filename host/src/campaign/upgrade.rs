//! A campaign file of an older version, brought up step by step in one transaction.

use rusqlite::params;
use rusqlite::types::Value;

use super::rows::RecordRow;
use super::schema::{STEPS, VERSION};
use super::seal;
use super::store::Store;

impl Store {
    /// Takes the steps that this file has not taken yet.
    pub(super) fn bring_up(&mut self) -> rusqlite::Result<()> {
        if self.version >= VERSION {
            return Ok(());
        }
        // read as the old version: what is damaged stays damaged
        let damaged: Vec<i64> = if self.version == 1 { self.damaged_records()? } else { Vec::new() };
        let transaction = self.connection.transaction()?;
        for step in &STEPS[self.version as usize..] {
            transaction.execute_batch(step)?;
        }
        if self.version == 1 {
            seal_all(&transaction, &damaged)?;
        }
        transaction.pragma_update(None, "user_version", VERSION)?;
        transaction.execute(
            "INSERT INTO log (utc, text) VALUES (?1, ?2)",
            params![
                super::store::utc_now(),
                format!("brought up from version {} to {VERSION}", self.version)
            ],
        )?;
        transaction.commit()?;
        self.version = VERSION;
        Ok(())
    }

    fn damaged_records(&self) -> rusqlite::Result<Vec<i64>> {
        let whole = |row: &RecordRow| row.damage.is_none() && self.samples(row).is_ok();
        let records = self.records().map_err(|_| rusqlite::Error::QueryReturnedNoRows)?;
        Ok(records.iter().filter(|row| !whole(row)).map(|row| row.id).collect())
    }
}

/// Seals the records of version 1. They keep the device's peak, and nobody knows how well their time was known; one that
/// is damaged gets a seal that does not fit.
fn seal_all(connection: &rusqlite::Connection, damaged: &[i64]) -> rusqlite::Result<()> {
    let of_record = seal::COLUMNS.iter().filter(|name| name.starts_with("r."));
    let columns = of_record.copied().collect::<Vec<_>>().join(", ");
    let mut ids = connection.prepare("SELECT id FROM records ORDER BY id")?;
    let ids = ids.query_map([], |row| row.get(0))?.collect::<rusqlite::Result<Vec<i64>>>()?;
    let sql = format!("SELECT {columns}, r.samples FROM records r WHERE r.id = ?1");
    for id in ids {
        let count = seal::COLUMNS.len() - 3;
        let (mut values, bytes_crc) = connection.query_row(&sql, [id], |row| {
            let values = (0..count).map(|place| row.get::<_, Value>(place));
            let bytes: Vec<u8> = row.get(count)?;
            Ok((values.collect::<rusqlite::Result<Vec<Value>>>()?, crc32fast::hash(&bytes)))
        })?;
        let found = [values[11].clone(), Value::Null, Value::Integer(bytes_crc.into())];
        values.extend(found.clone());
        let seal = seal::of_values(&values);
        let seal = if damaged.contains(&id) { !seal } else { seal };
        seal::insert_seal(connection, &values[0], &found, seal)?;
    }
    Ok(())
}

//! What is damaged in a campaign file.

use super::Store;
use super::error::StoreError;

/// Something that is damaged in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// The record, or the file as a whole.
    pub record: Option<i64>,
    /// What is wrong.
    pub what: String,
}

impl Store {
    /// Checks the file's structure and every record's checksum; what is damaged is named.
    pub fn verify(&self) -> Result<Vec<Damage>, StoreError> {
        let of_file = |what: String| Damage { record: None, what };
        let mut damage: Vec<Damage> = self.lacks_its_log()?.map(of_file).into_iter().collect();
        match self.all("PRAGMA integrity_check", [], |row| row.get::<_, String>(0), "checking") {
            Ok(said) if said == ["ok"] => {}
            Ok(said) => damage.extend(said.into_iter().map(of_file)),
            Err(error) => damage.push(of_file(error.to_string())),
        }
        for record in self.records()? {
            let (id, what) = match record {
                Err(damaged) => (damaged.place.id, damaged.what),
                Ok(row) => match self.samples(&row) {
                    Ok(_) => continue,
                    Err(StoreError::Damaged { what, .. }) => (row.id, what),
                    Err(other) => (row.id, other.to_string()),
                },
            };
            damage.push(Damage { record: Some(id), what });
        }
        for row in self.frf_rows()? {
            damage.extend(self.frf_of(row.id).err().map(|error| of_file(error.to_string())));
        }
        for level in self.levels()? {
            let what = match level {
                Err(damaged) => Some(damaged.to_string()),
                Ok(row) => self.level_samples(&row).err().map(|error| error.to_string()),
            };
            damage.extend(what.map(of_file));
        }
        Ok(damage)
    }
}

//! Finds damage in a campaign file.

use std::collections::HashSet;

use super::error::StoreError;
use super::{Store, chain, own_schema};

/// One finding of damage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Damage {
    /// The record; `None` for the file as a whole.
    pub record: Option<i64>,
    /// What is wrong.
    pub what: String,
}

impl Damage {
    fn of_file(what: String) -> Self {
        Self { record: None, what }
    }
}

/// Rows already reported as damaged, by table and key.
type Named = HashSet<(String, String)>;

impl Store {
    /// Checks the file's structure, every checksum, and every row against the chain; returns the
    /// damage found.
    pub fn verify(&self) -> Result<Vec<Damage>, StoreError> {
        let mut damage: Vec<Damage> = self.lacks_its_log()?.map(Damage::of_file).into_iter().collect();
        match self.all("PRAGMA integrity_check", [], |row| row.get::<_, String>(0), "checking") {
            Ok(said) if said == ["ok"] => {}
            Ok(said) => damage.extend(said.into_iter().map(Damage::of_file)),
            Err(error) => damage.push(Damage::of_file(error.to_string())),
        }
        let missing = own_schema::missing(&self.connection).map_err(self.failed("checking"))?;
        damage.extend(missing.into_iter().map(|name| Damage::of_file(format!("it lacks `{name}`"))));
        let mut named = Named::new();
        damage.extend(self.damaged_samples(&mut named)?);
        damage.extend(self.behind_our_back(&named)?);
        Ok(damage)
    }

    /// Records, levels and FRFs whose own checksums do not match.
    fn damaged_samples(&self, named: &mut Named) -> Result<Vec<Damage>, StoreError> {
        let mut damage = Vec::new();
        let mut name = |tables: &[&str], id: i64| {
            named.extend(tables.iter().map(|table| ((*table).to_owned(), id.to_string())));
        };
        for record in self.records()? {
            let (id, what) = match record {
                Err(damaged) => (damaged.place.id, damaged.what),
                Ok(row) => match self.samples(&row) {
                    Ok(_) => continue,
                    Err(StoreError::Damaged { what, .. }) => (row.id, what),
                    Err(other) => (row.id, other.to_string()),
                },
            };
            name(&["records", "seals"], id);
            damage.push(Damage { record: Some(id), what });
        }
        for row in self.frf_rows()? {
            if let Err(error) = self.frf_of(row.id) {
                name(&["frfs"], row.id);
                damage.push(Damage::of_file(error.to_string()));
            }
        }
        for level in self.levels()? {
            let (id, what) = match level {
                Err(damaged) => (damaged.id, Some(damaged.to_string())),
                Ok(row) => (row.id, self.level_samples(&row).err().map(|error| error.to_string())),
            };
            if let Some(what) = what {
                name(&["levels"], id);
                damage.push(Damage::of_file(what));
            }
        }
        Ok(damage)
    }

    /// Rows that were changed outside jointrig, except those already reported. A file of version 1
    /// has no chain.
    fn behind_our_back(&self, named: &Named) -> Result<Vec<Damage>, StoreError> {
        if !self.has_chain()? {
            return Ok(Vec::new());
        }
        Ok(match chain::check(&self.connection) {
            Ok(wrong) => wrong
                .into_iter()
                .filter(|behind| behind.row.as_ref().is_none_or(|row| !named.contains(row)))
                .map(|behind| Damage::of_file(behind.what))
                .collect(),
            Err(error) => vec![Damage::of_file(format!("the chain of rows cannot be read: {error}"))],
        })
    }

    /// Table and key of every row, in the order in which they were stored; empty for a file without
    /// a chain.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn history(&self) -> Result<Vec<(String, String)>, StoreError> {
        if !self.has_chain()? {
            return Ok(Vec::new());
        }
        chain::history(&self.connection).map_err(self.failed("reading the chain"))
    }

    /// Whether rows are chained: in files from version 2 onwards.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn has_chain(&self) -> Result<bool, StoreError> {
        let version: i32 = self
            .connection
            .pragma_query_value(None, "user_version", |row| row.get(0))
            .map_err(self.failed("checking"))?;
        let there = self.connection.table_exists(None, "chain").map_err(self.failed("checking"))?;
        Ok(there || version > super::OLDEST)
    }
}

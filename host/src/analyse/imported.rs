//! Imported FRFs, used for a configuration that was not measured in this campaign.

use super::cell::Measurements;
use super::missing::Missing;
use crate::campaign::store::frf_table::ImportedFrf;
use crate::structure::Structure;

/// The imported FRFs of a configuration that has no averaged cell, if there are any.
///
/// # Errors
/// They cannot be read; or hits were measured as well, which take precedence.
pub fn of<M: Measurements>(
    measurements: &M,
    configuration: Structure,
    cells: usize,
) -> Result<Option<ImportedFrf>, Missing> {
    match measurements.imported(configuration) {
        Err(error) => Err(Missing::ImportUnreadable { configuration, told: error.to_string() }),
        Ok(Some(found)) if cells > 0 => {
            Err(Missing::ImportUnused { configuration, file: found.source, cells })
        }
        Ok(found) => Ok(found),
    }
}

//! The FRF matrix of one configuration with its noise: assembled from the averaged cells, or from
//! imported FRFs if the configuration was not measured in this campaign.

use super::averages::{CellAverage, FORCE_LINES};
use super::cell::Measurements;
use super::findings::{ConfigurationFindings, ImportedFrom};
use super::missing::Missing;
use super::{assemble, chosen};
use crate::campaign::store::frf_table::ImportedFrf;
use crate::results::UsableBand;
use crate::spectra::usable_band;
use crate::structure::Structure;
use crate::substructuring::Frf;
use crate::substructuring::geometry::Configuration;

/// Results for one configuration.
#[derive(Debug)]
pub struct ConfigurationFrfs {
    /// The part for the findings.
    pub measured: ConfigurationFindings,
    /// Its FRFs; `None` if nothing was measured.
    pub frf: Option<Frf>,
    /// Missing data.
    pub missing: Vec<Missing>,
}

/// Assembles the configuration from its averaged cells, `own`; the plan has `planned` cells.
pub fn of<M: Measurements>(
    measurements: &M,
    configuration: Structure,
    points: &Configuration,
    own: &[CellAverage],
    planned: usize,
) -> ConfigurationFrfs {
    let mut missing = Vec::new();
    match imported_frfs(measurements, configuration, own.len()) {
        Err(why) => missing.push(why),
        Ok(None) => {}
        Ok(Some(found)) => {
            let measured = ConfigurationFindings {
                configuration,
                records: Vec::new(),
                usable_band: None,
                frfs: chosen::of_matrix(configuration, points, &found.frf),
                noise_floor: None,
                imported: Some(ImportedFrom {
                    file: found.source,
                    utc: found.utc,
                    with_variance: found.frf.variance().is_some(),
                }),
            };
            return ConfigurationFrfs { measured, frf: Some(found.frf), missing };
        }
    }
    missing.extend(holes(configuration, planned, own));
    let quantity = measurements.quantity();
    let measured = ConfigurationFindings {
        configuration,
        records: own.iter().flat_map(|c| c.records.iter().copied()).collect(),
        usable_band: force_band(configuration, own),
        frfs: chosen::of_cells(configuration, points, own, quantity),
        noise_floor: chosen::noise_floor(configuration, points, own, quantity),
        imported: None,
    };
    let assembled = assemble::assemble(configuration, points, own, quantity);
    if assembled.measured.is_some() {
        let (impacts, responses) = (assembled.impacts_left_out, assembled.responses_left_out);
        if !impacts.is_empty() {
            missing.push(Missing::ImpactsLeftOut { configuration, names: impacts });
        }
        if !responses.is_empty() {
            missing.push(Missing::ResponsesLeftOut { configuration, names: responses });
        }
    }
    ConfigurationFrfs { measured, frf: assembled.measured, missing }
}

fn holes(configuration: Structure, planned: usize, own: &[CellAverage]) -> Vec<Missing> {
    let absent = planned.saturating_sub(own.len());
    let hole = if planned == 0 {
        Some(Missing::NotInPlan(configuration))
    } else if own.is_empty() {
        Some(Missing::NotMeasured { configuration, planned })
    } else {
        (absent > 0).then_some(Missing::CellsWithoutHit { configuration, absent, planned })
    };
    let cells = own.iter().filter(|c| c.records.len() == 1).count();
    let single = (cells > 0).then_some(Missing::SingleHits { configuration, cells });
    hole.into_iter().chain(single).collect()
}

/// Band in which the mean force of a configuration's hits is within 6 dB of its level.
fn force_band(configuration: Structure, own: &[CellAverage]) -> Option<UsableBand> {
    let first = own.first()?;
    let alike = || own.iter().filter(|c| c.force_spectrum.len() == first.force_spectrum.len());
    let count = alike().count() as f64;
    let mean: Vec<f64> = (0..first.force_spectrum.len())
        .map(|l| alike().map(|c| c.force_spectrum[l]).sum::<f64>() / count)
        .collect();
    let frequency_hz: Vec<f64> = (0..mean.len())
        .map(|block| first.step_hz * ((block * FORCE_LINES) as f64 + 0.5 * (FORCE_LINES - 1) as f64))
        .collect();
    let band_hz = usable_band(&frequency_hz, &mean, 6.0)?;
    Some(UsableBand { configuration: configuration.into(), band_hz })
}

/// The imported FRFs of a configuration that has no averaged cell, if there are any.
///
/// # Errors
/// They cannot be read; or hits were measured as well, which take precedence.
pub fn imported_frfs<M: Measurements>(
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

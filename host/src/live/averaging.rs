//! Spectra of single hits, and the average of a cell's kept hits as it grows: one hit is read at a time, and each only once.

use jointrig_protocol::channel::{Quantity, Role};
use std::sync::{Mutex, PoisonError};

use crate::analyse::{AnalysedLength, LINES_HZ};
use crate::campaign::plan::Plan;
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::record_row::RecordRow;
use crate::report::cell_records::Shown;
use crate::spectra::{
    CrossSpectra, FrfSettings, ImpactRecords, MotionQuantity, SpectraError, Windowing, estimate,
};

/// The newest hits that are averaged. Plans ask for some ten; this bounds the time of a cell that was hit for hours.
const MOST_HITS: usize = 64;

/// Why a hit has no spectra.
#[derive(Debug, thiserror::Error)]
pub enum NoSpectra {
    /// It is not there, or the file cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// It has no pulse, or does not fit to the others.
    #[error(transparent)]
    Spectra(#[from] SpectraError),
    /// No force, or no response.
    #[error("its session has no channel for the hammer's force, or none for the response")]
    NoChannel,
    /// The response is no motion.
    #[error("the vibrometer's channels measure no motion")]
    NoMotion,
}

/// Spectra of one hit, as that of a cell: force, and the response's channels as displacements, m.
///
/// # Errors
/// It cannot be read, or has no pulse.
pub fn of_hit(store: &Store, plan: &Plan, cell: i64, row: &RecordRow) -> Result<CrossSpectra, NoSpectra> {
    let shown = Shown::of(store, cell, row)?.ok_or(NoSpectra::NoChannel)?;
    let channels = store.channels(row.session)?;
    let places = store.response_places(cell, row, &channels)?;
    let (Some(force), Some(places)) = (channels.place(Role::HammerForce), places) else {
        return Err(NoSpectra::NoChannel);
    };
    let quantity = match channels.channels[places[0]].quantity {
        Quantity::Velocity => MotionQuantity::Velocity,
        Quantity::Displacement => MotionQuantity::Displacement,
        Quantity::Acceleration => MotionQuantity::Acceleration,
        Quantity::Force | Quantity::Voltage => return Err(NoSpectra::NoMotion),
    };
    let analysed = AnalysedLength::of(store, plan)?.samples(row, shown.rate_hz);
    let cut = |signal: &[f64]| -> Vec<f64> {
        signal[analysed.start.min(signal.len())..analysed.end.min(signal.len())].to_vec()
    };
    let records = ImpactRecords {
        fs_hz: shown.rate_hz,
        force_n: vec![cut(&shown.force_n)],
        response: vec![shown.response.iter().map(|signal| cut(signal)).collect()],
        quantity,
    };
    let delay = |place: usize| f64::from(channels.channels[place].delay_ns) * 1e-9;
    let settings = FrfSettings {
        windowing: Windowing { sigma_per_s: plan.window.get_ref().exponential_per_s, ..Windowing::default() },
        delay_s: places.iter().map(|place| delay(*place) - delay(force)).collect(),
        ..FrfSettings::default()
    };
    Ok(estimate(&records, &[true], &settings)?.converted(quantity, MotionQuantity::Displacement))
}

/// The average of a cell's kept hits.
#[derive(Debug, Clone, PartialEq)]
pub struct Average {
    /// The cell.
    pub(super) cell: i64,
    /// The records that were asked for, the oldest first.
    pub(super) records: Vec<i64>,
    /// Their spectra at the analysis' lines; none before the first hit that can be used.
    pub spectra: Option<CrossSpectra>,
    /// What is said of records that cannot be used.
    pub left_out: Vec<String>,
}

impl Average {
    fn add(&mut self, store: &Store, plan: &Plan, cell: i64, row: &RecordRow) -> Result<(), StoreError> {
        let added = of_hit(store, plan, cell, row).and_then(|hit| {
            let hit = hit.band(LINES_HZ[0], LINES_HZ[1]);
            match &mut self.spectra {
                Some(sum) => sum.add(&hit)?,
                none => *none = Some(hit),
            }
            Ok(())
        });
        self.records.push(row.id);
        match added {
            Err(NoSpectra::Store(error)) if !matches!(error, StoreError::Damaged { .. }) => Err(error),
            Err(error) => {
                self.left_out.push(format!("record {}: {error}", row.id));
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }
}

/// The average that was asked for last: the next hit of that cell is added to it.
#[derive(Debug, Default)]
pub struct Averages {
    last: Mutex<Option<Average>>,
}

impl Averages {
    /// The average of the newest kept hits of a cell.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn of_cell(&self, store: &Store, cell: i64) -> Result<Average, StoreError> {
        let kept: Vec<RecordRow> =
            store.records_for(cell)?.into_iter().flatten().filter(RecordRow::kept).collect();
        let kept = &kept[kept.len().saturating_sub(MOST_HITS)..];
        // whoever panicked left none or a whole one
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        let known = last
            .take()
            .filter(|known| known.cell == cell)
            .filter(|known| kept.iter().map(|row| row.id).collect::<Vec<_>>().starts_with(&known.records));
        let mut average =
            known.unwrap_or(Average { cell, records: Vec::new(), spectra: None, left_out: Vec::new() });
        let plan = store.plan()?;
        for row in &kept[average.records.len()..] {
            average.add(store, &plan, cell, row)?;
        }
        *last = Some(average.clone());
        Ok(average)
    }
}

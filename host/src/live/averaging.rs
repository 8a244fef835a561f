//! Spectra of single hits, and the growing average of a cell's kept hits: hits are read one at a
//! time, and each only once.

use jointrig_protocol::channel::{Quantity, Role};
use std::sync::{Mutex, PoisonError};

use crate::analyse::{AnalysedLength, LINES_HZ};
use crate::campaign::plan::Plan;
use crate::campaign::store::Store;
use crate::campaign::store::error::StoreError;
use crate::campaign::store::record_table::RecordRow;
use crate::report::cell_records::Shown;
use crate::spectra::{
    CrossSpectra, FrfSettings, ImpactRecords, MotionQuantity, SpectraError, Windowing, estimate,
};

/// Most hits that are averaged, the newest. Plans ask for about ten; this bounds the computing time
/// for a cell with very many hits.
const MOST_HITS: usize = 64;

/// Why a hit has no spectra.
#[derive(Debug, thiserror::Error)]
pub enum NoSpectra {
    /// The hit does not exist, or the file cannot be read.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// It has no pulse, or does not match the other hits.
    #[error(transparent)]
    Spectra(#[from] SpectraError),
    /// There is no force or no response.
    #[error("its session has no channel for the hammer's force, or none for the response")]
    NoChannel,
    /// The response is not a motion.
    #[error("the vibrometer's channels measure no motion")]
    NoMotion,
}

/// Spectra of one hit, assigned to a cell: force, and the response's channels as displacements, m.
///
/// # Errors
/// The record cannot be read, or has no pulse.
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
    /// The requested records, the oldest first.
    pub(super) records: Vec<i64>,
    /// Their spectra at the analysis' lines; `None` before the first usable hit.
    pub spectra: Option<CrossSpectra>,
    /// Messages about records that cannot be used.
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

/// The average requested last: only the new hits of the same cell are added.
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
        // valid even after a poisoned lock: it holds nothing or a complete average
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

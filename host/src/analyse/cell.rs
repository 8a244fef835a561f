//! The interface between a campaign and the stages of its analysis: its geometry, its cells, the
//! kept hits of one cell in SI units; the options of the analysis, and its progress.

use crate::campaign::plan::level::{Level, Moment};
use crate::campaign::store::frf_table::ImportedFrf;
use crate::contact::{Bulk, ContactPriors};
use crate::hysteresis::HysteresisRecord;
use crate::results::MAIN_BAND;
use crate::spectra::MotionQuantity;
use crate::structure::Structure;
use crate::substructuring::Band;
use crate::substructuring::geometry::{Geometry, Grouping};

/// One impact position with one response location.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CellName {
    /// The structure.
    pub configuration: Structure,
    /// The impact's name.
    pub impact: String,
    /// The response location's name.
    pub response: String,
}

/// The kept hits of a cell. Signals are as recorded: delays are stated, not corrected.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cell {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// Kept hits.
    pub hits: Vec<Hit>,
    /// Messages about kept records that cannot be used.
    pub left_out: Vec<String>,
}

/// Delays of the signals at the contact relative to the hammer's force, s.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ContactDelays {
    /// Vibrometer on specimen A.
    pub specimen_a: f64,
    /// Vibrometer on specimen B.
    pub specimen_b: f64,
    /// Load cells.
    pub load_cells: f64,
}

/// One kept hit. Its delays are those of the session that recorded it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Hit {
    /// The record's id in the campaign file.
    pub record: i64,
    /// Whether it was struck for another cell, whose hits also fill this cell.
    pub of_row: bool,
    /// Hammer force, N.
    pub force_n: Vec<f64>,
    /// The channels at the response location, SI: the scanning vibrometer's x, y and z, or the
    /// plan's axes.
    pub response: Vec<Vec<f64>>,
    /// Their delays relative to the hammer's force, s.
    pub response_delay_s: Vec<f64>,
    /// The signals at the contact, if the rig has them.
    pub contact: Option<ContactSignals>,
    /// The load cells' sum of a rig without vibrometers next to the contact.
    pub load_cells: Option<LoadCellSignal>,
}

/// Sum of the load cells during one hit, where no vibrometers measure next to the contact.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LoadCellSignal {
    /// Sum of the load cells, N.
    pub tangential_n: Vec<f64>,
    /// Its delay relative to the hammer's force, s.
    pub delay_s: f64,
}

/// The signals at the contact during one hit.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ContactSignals {
    /// Velocity of specimen A along z, m/s.
    pub specimen_a_m_per_s: Vec<f64>,
    /// Velocity of specimen B along z, m/s.
    pub specimen_b_m_per_s: Vec<f64>,
    /// Sum of the load cells, N.
    pub tangential_n: Vec<f64>,
    /// Their delays relative to the hammer's force.
    pub delay_s: ContactDelays,
}

/// Mass of a fixed sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorMass {
    /// The response point that it is fixed to.
    pub point: String,
    /// The part that the point is on.
    pub grouping: Grouping,
    /// Its mass, kg.
    pub mass_kg: f64,
}

/// The cell in which a free body of known mass is struck along the sliding direction.
#[derive(Debug, Clone, PartialEq)]
pub struct MassCell {
    /// The cell.
    pub name: CellName,
    /// The body's mass, kg.
    pub mass_kg: f64,
    /// Relative standard deviation of the mass, and of hits beside its centre of gravity.
    pub sigma: f64,
    /// Index of the response's axis along the sliding direction.
    pub axis: usize,
    /// Whether the vibrometers of the spots are aimed at it too.
    pub lasers: bool,
}

/// The cells that show what passes beside the contact: A is struck with the joint open, then
/// closed.
#[derive(Debug, Clone, PartialEq)]
pub struct OpenAndClosed {
    /// The cell with the joint open.
    pub open: CellName,
    /// The cell with the joint closed.
    pub closed: CellName,
    /// Index of each response's axis along the sliding direction.
    pub axes: [usize; 2],
}

/// A level of the shaker.
#[derive(Debug, Clone, PartialEq)]
pub struct ShakerLevel {
    /// Its id in the campaign file.
    pub id: i64,
    /// Before or after the hammer's cells.
    pub moment: Moment,
    /// Nominal excitation.
    pub level: Level,
    /// The signals at the contact, aligned in time.
    pub record: HysteresisRecord,
}

/// Prior knowledge of contact and static arm.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct KnownContact {
    /// The normal load, N.
    pub normal_load_n: Option<f64>,
    /// Stiffness to ground parallel to the load cells, relative to theirs.
    pub parallel_path: Option<f64>,
    /// Effective mass of the static arm at the contact, kg.
    pub effective_mass_kg: Option<f64>,
}

/// Interface through which the analysis accesses a campaign. Cells are read one at a time, from
/// several threads.
pub trait Measurements: Sync {
    /// Why a cell cannot be read.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Positions and directions of all points.
    fn geometry(&self) -> &Geometry;

    /// Damping of the exponential window according to the plan, 1/s.
    fn sigma_per_s(&self) -> f64;

    /// Quantity measured by the scanning vibrometer.
    fn quantity(&self) -> MotionQuantity;

    /// The plan's cells.
    fn cells(&self) -> Vec<CellName>;

    /// Cells that were abandoned, with the reason.
    fn given_up(&self) -> Vec<(CellName, String)> {
        Vec::new()
    }

    /// The session in which a record was made.
    fn session_of(&self, _record: i64) -> Option<i64> {
        None
    }

    /// FRFs of a configuration that were measured elsewhere.
    ///
    /// # Errors
    /// They are damaged, or the file cannot be read.
    fn imported(&self, _structure: Structure) -> Result<Option<ImportedFrf>, Self::Error> {
        Ok(None)
    }

    /// The shaker's levels, and messages about those that cannot be used.
    fn shaker_levels(&self) -> (Vec<ShakerLevel>, Vec<String>) {
        (Vec::new(), Vec::new())
    }

    /// Prior knowledge of contact and static arm.
    fn known_contact(&self) -> KnownContact {
        KnownContact::default()
    }

    /// Positions measured by the vibrometers near the contact, on A and on B, m; `None` if not
    /// stated.
    fn spots_m(&self) -> Option<[[f64; 3]; 2]> {
        None
    }

    /// What is stated of the bulk of specimens A and B.
    fn specimens(&self) -> [Option<Bulk>; 2] {
        [None; 2]
    }

    /// Prior knowledge of positions, angles, gains and delays.
    fn contact_priors(&self) -> ContactPriors {
        ContactPriors::default()
    }

    /// Whether a sensor is fixed to this response point; otherwise the vibrometer visits it.
    fn is_fixed(&self, _point: &str) -> bool {
        false
    }

    /// Whether on B alone the vibrometers near the contact are aimed at this response point too.
    fn has_all_lasers(&self, _point: &str) -> bool {
        false
    }

    /// The cell in which a free body of known mass is struck, if the plan has one. It is not one of
    /// [`Measurements::cells`].
    fn known_mass(&self) -> Option<MassCell> {
        None
    }

    /// The cells that show what passes beside the contact, if the plan has them. The one with the
    /// joint open is not one of [`Measurements::cells`].
    fn open_joint(&self) -> Option<OpenAndClosed> {
        None
    }

    /// The masses of the fixed sensors, as far as the plan states them.
    fn sensor_masses(&self) -> Vec<SensorMass> {
        Vec::new()
    }

    /// Standard deviation of this response point's position along each axis, m; `None` if the
    /// priors of its kind apply.
    fn point_sigma_m(&self, _point: &str) -> Option<f64> {
        None
    }

    /// Calls `look` with the kept hits of a cell, one at a time, and with their sampling rate, Hz;
    /// never if the cell was not measured. Its own hits come before those of the cell whose hits
    /// fill it. The signals at the contact may be omitted if `contact` is false. The hit is
    /// borrowed, and its buffers may be reused for the next one. Returns messages about kept
    /// records that cannot be used.
    ///
    /// # Errors
    /// The file cannot be read, or the hits differ in rate. `look` may have been called for some of
    /// them by then.
    fn each_hit(
        &self,
        cell: &CellName,
        contact: bool,
        look: &mut dyn FnMut(&Hit, f64),
    ) -> Result<Vec<String>, Self::Error>;

    /// All kept hits of a cell, from [`Measurements::each_hit`].
    ///
    /// # Errors
    /// As for `each_hit`.
    fn read(&self, cell: &CellName, contact: bool) -> Result<Cell, Self::Error> {
        let mut whole = Cell::default();
        let left_out = self.each_hit(cell, contact, &mut |hit, fs_hz| {
            whole.fs_hz = fs_hz;
            whole.hits.push(hit.clone());
        })?;
        Ok(Cell { left_out, ..whole })
    }
}

/// The bands over which means are computed, Hz; the first is the main one.
pub const BANDS: [Band; 3] =
    [MAIN_BAND, Band { low_hz: 100.0, high_hz: 800.0 }, Band { low_hz: 100.0, high_hz: 300.0 }];

/// Additional results requested, and prior knowledge.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Wanted {
    /// Replicates of the bootstrap over hits; 0 for none.
    pub replicates: usize,
    /// Prior knowledge of contact and static arm.
    pub known: KnownContact,
    /// Whether the FRFs of every pair are kept in the findings.
    pub frfs: bool,
}

/// Progress of the analysis: cells done, and total number of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Cells done.
    pub done: usize,
    /// Total number of cells.
    pub total: usize,
}

//! What the analysis asks of a campaign: its geometry, its cells, and the kept hits of one cell in SI units.

use crate::campaign::plan::level::{Level, Moment};
use crate::campaign::store::frf_table::ImportedFrf;
use crate::contact::ContactPriors;
use crate::hysteresis::HysteresisRecord;
use crate::spectra::MotionQuantity;
use crate::structure::Structure;
use crate::substructuring::geometry::Geometry;

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

/// The kept hits of a cell. Signals are as they were recorded: delays are told, not corrected.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Cell {
    /// Sampling rate, Hz.
    pub fs_hz: f64,
    /// Kept hits.
    pub hits: Vec<Hit>,
    /// What is said about records that were kept and cannot be used.
    pub left_out: Vec<String>,
}

/// How late the signals at the contact are against the hammer's force, s.
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
    /// Whether it was struck for another cell, whose row it fills.
    pub of_row: bool,
    /// Hammer force, N.
    pub force_n: Vec<f64>,
    /// The channels at the response location, SI: the scanning vibrometer's x, y and z, or as the plan's axes say.
    pub response: Vec<Vec<f64>>,
    /// How late these are against the hammer's force, s.
    pub response_delay_s: Vec<f64>,
    /// The signals at the contact, where the rig has them.
    pub contact: Option<ContactSignals>,
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
    /// How late they are against the hammer's force.
    pub delay_s: ContactDelays,
}

/// A level of the shaker.
#[derive(Debug, Clone, PartialEq)]
pub struct ShakerLevel {
    /// Its id in the campaign file.
    pub id: i64,
    /// Before or after the hammer's cells.
    pub moment: Moment,
    /// What was ordered.
    pub level: Level,
    /// The signals at the contact, in step.
    pub record: HysteresisRecord,
}

/// What is known of contact and static arm beforehand.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct KnownContact {
    /// The normal load, N.
    pub normal_load_n: Option<f64>,
    /// Stiffness to ground beside the load cells, over theirs.
    pub parallel_path: Option<f64>,
    /// Effective mass of the static arm at the contact, kg.
    pub effective_mass_kg: Option<f64>,
}

/// A campaign as the analysis sees it. Cells are read one at a time, from several threads.
pub trait Measurements: Sync {
    /// Why a cell cannot be read.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Where everything is.
    fn geometry(&self) -> &Geometry;

    /// Damping of the exponential window that the plan asks for, 1/s.
    fn sigma_per_s(&self) -> f64;

    /// What the scanning vibrometer measures.
    fn quantity(&self) -> MotionQuantity;

    /// The plan's cells.
    fn cells(&self) -> Vec<CellName>;

    /// Cells that were given up, with the reason.
    fn given_up(&self) -> Vec<(CellName, String)> {
        Vec::new()
    }

    /// FRFs of a configuration that were measured elsewhere.
    ///
    /// # Errors
    /// They are damaged, or the file cannot be read.
    fn imported(&self, _structure: Structure) -> Result<Option<ImportedFrf>, Self::Error> {
        Ok(None)
    }

    /// The shaker's levels, and complaints about those that cannot be used.
    fn shaker_levels(&self) -> (Vec<ShakerLevel>, Vec<String>) {
        (Vec::new(), Vec::new())
    }

    /// What is known of contact and static arm beforehand.
    fn known_contact(&self) -> KnownContact {
        KnownContact::default()
    }

    /// Where the vibrometers beside the contact look, on A and on B, m; none where nobody says.
    fn spots_m(&self) -> Option<[[f64; 3]; 2]> {
        None
    }

    /// What is known beforehand of positions, angles, gains and delays.
    fn contact_priors(&self) -> ContactPriors {
        ContactPriors::default()
    }

    /// How well the place of this response point is known, standard deviation along each axis, m; none where the priors of its kind hold.
    fn point_sigma_m(&self, _point: &str) -> Option<f64> {
        None
    }

    /// Shows `look` the kept hits of a cell, one at a time, with their sampling rate, Hz; none if it was not measured. Its own come before
    /// those of the cell whose hits fill it. The signals at the contact may be left out where `contact` does not ask for them.
    /// A hit is lent: the next one may take its memory. Returns what is said about records that were kept and cannot be used.
    ///
    /// # Errors
    /// The file cannot be read, or the hits differ in rate. Some of them may have been shown then.
    fn each_hit(
        &self,
        cell: &CellName,
        contact: bool,
        look: &mut dyn FnMut(&Hit, f64),
    ) -> Result<Vec<String>, Self::Error>;

    /// All kept hits of a cell, as [`Measurements::each_hit`] shows them.
    ///
    /// # Errors
    /// As of `each_hit`.
    fn read(&self, cell: &CellName, contact: bool) -> Result<Cell, Self::Error> {
        let mut whole = Cell::default();
        let left_out = self.each_hit(cell, contact, &mut |hit, fs_hz| {
            whole.fs_hz = fs_hz;
            whole.hits.push(hit.clone());
        })?;
        Ok(Cell { left_out, ..whole })
    }
}

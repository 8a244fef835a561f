//! From kept hits to spectra, one cell at a time; the time signals are gone when the cell is done.

use super::cell::{Cell, CellName, ContactDelays, Hit};
use crate::contact::{BAND, LEVEL_LINES, SIGMA_PER_S};
use crate::spectra::{
    self, CrossSpectra, FrfSettings, ImpactRecords, MotionQuantity, SpectraError, Windowing,
};

/// The lines that are used, Hz: those below carry rigid-body drift and the mains' subharmonics, not the joint; those above are in
/// no band.
pub const LINES_HZ: [f64; 2] = [10.0, 1000.0];

/// Lines in one value of a cell's force spectrum.
pub const FORCE_LINES: usize = 16;

/// Spectra of one cell on s = σ + iω, as measured (not yet receptances).
#[derive(Debug, Clone)]
pub struct CellAverage {
    /// Which cell.
    pub name: CellName,
    /// The records averaged.
    pub records: Vec<i64>,
    /// The response, along each of its channels.
    pub spectra: CrossSpectra,
    /// Auto-spectrum of the force up to half the sampling rate, N² s²: means of [`FORCE_LINES`] lines each. All lines of all cells
    /// would be most of what an analysis remembers.
    pub force_spectrum: Vec<f64>,
    /// Distance of lines, Hz.
    pub step_hz: f64,
    /// v_A, v_B and T at the contact, where asked for and measured.
    pub contact: Option<CrossSpectra>,
    /// The response, v_A, v_B and T with the heavy damping that the contact is read with, where asked for and measured.
    pub damped: Option<CrossSpectra>,
    /// As `damped` with the plan's light damping: what the shaker's levels are corrected by.
    pub light: Option<CrossSpectra>,
}

/// What of a cell is wanted beside its FRFs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Asked {
    /// The spectra at the contact.
    pub contact: bool,
    /// The same, and the response, as the contact's own stiffness is read from.
    pub damped: bool,
}

/// Sums up the hits of a cell. Hits of sessions with other delays are brought in
/// step with the force before they are added.
///
/// # Errors
/// No hit, or hits that do not fit together.
pub fn average(
    name: CellName,
    cell: Cell,
    sigma_per_s: f64,
    quantity: MotionQuantity,
    asked: Asked,
    lines_hz: [f64; 2],
) -> Result<CellAverage, SpectraError> {
    let measured = cell.hits.iter().all(|h| h.contact.is_some());
    let axes = cell.hits.first().map_or(0, |hit| hit.response.len());
    let (contact, damped) = (asked.contact && measured, asked.damped && measured);
    let records: Vec<i64> = cell.hits.iter().map(|h| h.record).collect();
    let mut alike: Vec<(Vec<f64>, ImpactRecords)> = Vec::new();
    for hit in cell.hits {
        let (delay_s, force_n, outputs) = signals(hit, contact || damped);
        let place = alike.iter().position(|(own, _)| *own == delay_s).unwrap_or(alike.len());
        if place == alike.len() {
            let none = ImpactRecords { fs_hz: cell.fs_hz, force_n: vec![], response: vec![], quantity };
            alike.push((delay_s, none));
        }
        alike[place].1.force_n.push(force_n);
        alike[place].1.response.push(outputs);
    }
    let lines = if damped {
        [lines_hz[0].min(LEVEL_LINES.low_hz), lines_hz[1].max(LEVEL_LINES.high_hz)]
    } else {
        lines_hz
    };
    let (all, force) = summed(&alike, sigma_per_s, lines)?;
    let damped =
        if damped { Some(summed(&alike, SIGMA_PER_S, [BAND.low_hz, BAND.high_hz])?.0) } else { None };
    let light = damped.is_some().then(|| all.band(LEVEL_LINES.low_hz, LEVEL_LINES.high_hz));
    let step_hz = force.frequency_hz().get(1).copied().unwrap_or(0.0);
    let mean = |lines: &[f64]| lines.iter().sum::<f64>() / lines.len() as f64;
    let force_spectrum = force.force_spectrum().chunks(FORCE_LINES).map(mean).collect();
    let kept = all.band(lines_hz[0], lines_hz[1]);
    Ok(CellAverage {
        name,
        records,
        spectra: kept.of_outputs(0..axes),
        force_spectrum,
        step_hz,
        contact: contact.then(|| kept.of_outputs(axes..axes + 3)),
        damped,
        light,
    })
}

/// All hits, those that are late by the same times estimated together: the spectra at those lines, and the force at all lines.
fn summed(
    alike: &[(Vec<f64>, ImpactRecords)],
    sigma_per_s: f64,
    lines_hz: [f64; 2],
) -> Result<(CrossSpectra, CrossSpectra), SpectraError> {
    let mut all: Option<(CrossSpectra, CrossSpectra)> = None;
    for (delay_s, records) in alike {
        let settings = FrfSettings {
            windowing: Windowing { sigma_per_s, ..Windowing::default() },
            delay_s: delay_s.clone(),
            band_hz: Some(lines_hz),
            ..FrfSettings::default()
        };
        let sums = spectra::estimate::summed(records, &vec![true; records.force_n.len()], &settings)?;
        let (own, force) = (sums.finish(sigma_per_s, delay_s)?, sums.force(sigma_per_s)?);
        match &mut all {
            Some((sum, sum_of_force)) => {
                sum.add(&own)?;
                sum_of_force.add(&force)?;
            }
            None => all = Some((own, force)),
        }
    }
    all.ok_or(SpectraError::NoHits)
}

/// How late the responses are, the force, and the responses: the location's channels, and with `contact` v_A, v_B and T.
fn signals(hit: Hit, contact: bool) -> (Vec<f64>, Vec<f64>, Vec<Vec<f64>>) {
    let (mut delay_s, mut outputs) = (hit.response_delay_s, hit.response);
    if let (true, Some(c)) = (contact, hit.contact) {
        let ContactDelays { specimen_a, specimen_b, load_cells } = c.delay_s;
        delay_s.extend([specimen_a, specimen_b, load_cells]);
        outputs.extend([c.specimen_a_m_per_s, c.specimen_b_m_per_s, c.tangential_n]);
    }
    (delay_s, hit.force_n, outputs)
}

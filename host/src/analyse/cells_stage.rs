//! Reads and averages the cells, one at a time on each thread, without keeping their signals.
//!
//! What is kept of single hits: the spectra that the bootstrap needs (the assembly's interface
//! cells in the main band), and the response per newton, which shows whether the contact slips
//! under the hammer.

use super::averages::{Asked, CellAverage, CellSums, LINES_HZ};
use super::cell::Progress;
use super::cell::{CellName, Hit, Measurements};
use super::impact_loops;
use super::impact_loops::ImpactLoop;
use super::missing::Missing;
use crate::hysteresis::contact_drift::ContactDrift;
use crate::hysteresis::hammer_slip::{CellHits, HammerSlip, HitResponse, HitSignals};
use crate::results::MAIN_BAND;
use crate::spectra::{Pulse, SpectraError, Summing, Windowing};
use crate::structure::Structure;
use crate::substructuring::averaged;
use crate::substructuring::geometry::{Configuration, Geometry, Grouping, Point};
use num_complex::Complex;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Results of the cells, in their order.
#[derive(Debug, Default)]
pub struct Cells {
    /// FRFs of the cells that have a kept hit.
    pub averages: Vec<CellAverage>,
    /// Spectra of single hits, if requested.
    pub hits: Vec<averaged::CellHits>,
    /// The loops of the hits that move the contact.
    pub loops: Vec<ImpactLoop>,
    /// The response of each of these hits per newton, cell by cell.
    pub at_contact: Vec<HitAtContact>,
    /// Data that could not be used.
    pub missing: Vec<Missing>,
}

/// Reads and averages all of `names`; with `keep_hits`, also returns the spectra of single hits.
pub fn read_all<M: Measurements>(
    measurements: &M,
    names: &[CellName],
    keep_hits: bool,
    progress: &(dyn Fn(Progress) + Sync),
) -> Cells {
    let done = AtomicUsize::new(0);
    let cells: Vec<Cells> = names
        .par_iter()
        .map(|name| {
            let cell = read(measurements, name, keep_hits);
            progress(Progress { done: done.fetch_add(1, Ordering::Relaxed) + 1, total: names.len() });
            cell
        })
        .collect();
    let mut all = Cells::default();
    for cell in cells {
        all.averages.extend(cell.averages);
        all.hits.extend(cell.hits);
        all.loops.extend(cell.loops);
        all.at_contact.extend(cell.at_contact);
        all.missing.extend(cell.missing);
    }
    all
}

/// Reads and averages one cell; see [`read_all`].
pub fn read<M: Measurements>(measurements: &M, name: &CellName, keep_hits: bool) -> Cells {
    let mut found = Cells::default();
    let records = |told: String| Missing::Records { cell: name.clone(), told };
    let geometry = measurements.geometry();
    let moves_contact = counts_for_contact(geometry, name);
    let (drives, damped) = (drives_the_cells(geometry, name), super::contact_answer::reads(geometry, name));
    let sigma_per_s = measurements.sigma_per_s();
    let mut sums: Option<CellSums> = None;
    let mut unfit = None;
    let mut each = keep_hits.then(|| HitSpectra::of(name, &geometry.ajb, sigma_per_s)).flatten();
    let read = measurements.each_hit(name, moves_contact || drives || damped, &mut |hit, fs_hz| {
        // the contact signals of a hit count once, in the cell that was struck; a cell's own hits
        // come first
        let sums = sums.get_or_insert_with(|| {
            let asked = Asked { contact: !hit.of_row && (moves_contact || drives), damped };
            CellSums::new(name.clone(), sigma_per_s, asked, LINES_HZ)
        });
        if let Some(signals) = hit.contact.as_ref().filter(|_| moves_contact && !hit.of_row) {
            found.at_contact.extend(of_hit(name, fs_hz, hit));
            match impact_loops::of_hit(hit.record, &name.impact, fs_hz, signals, signals.delay_s) {
                Ok(one) => found.loops.push(one),
                Err(error) => {
                    found.missing.push(Missing::NoLoop { cell: name.clone(), record: hit.record, error });
                }
            }
        }
        if unfit.is_none() {
            unfit = sums.add(hit, fs_hz).err();
        }
        if let Some(each) = &mut each {
            each.add(hit, fs_hz);
        }
    });
    let left_out = match read {
        Ok(left_out) => left_out,
        Err(error) => return Cells { missing: vec![records(error.to_string())], ..Cells::default() },
    };
    found.missing.splice(0..0, left_out.into_iter().map(records));
    let Some(sums) = sums else { return found };
    match each.map_or(Ok(None), HitSpectra::finish) {
        Ok(hits) => found.hits.extend(hits),
        Err(error) => found.missing.push(records(error.to_string())),
    }
    match unfit.map_or_else(|| sums.finish(), Err) {
        Ok(averaged) => found.averages.push(averaged),
        Err(error) => found.missing.push(records(error.to_string())),
    }
    found
}

/// Whether hits at this impact move the contact along z from A's side: hits on B drive the load
/// cells directly, and hits along x cause no motion in z.
fn counts_for_contact(geometry: &Geometry, name: &CellName) -> bool {
    name.configuration == Structure::Ajb
        && geometry.ajb.impacts.iter().any(|p| {
            p.name == name.impact
                && matches!(p.grouping, Grouping::InterfaceA | Grouping::InternalA)
                && p.direction[2].abs() > 0.9
        })
}

/// Whether hits at this impact drive the load cells only through arm B, so that the static arm can
/// be identified from them.
fn drives_the_cells(geometry: &Geometry, name: &CellName) -> bool {
    name.configuration == Structure::B
        && geometry.b.impacts.iter().any(|p| p.name == name.impact && p.grouping == Grouping::InterfaceB)
}

/// The spectra of every hit of a cell of the assembly's interface, which the replicates of the
/// average over positions need one by one.
struct HitSpectra<'a> {
    name: &'a CellName,
    /// The location's channels, in the order of a hit's responses.
    channels: Vec<&'a Point>,
    windowing: Windowing,
    hits: usize,
    /// By line, then hit.
    auto: Vec<Vec<f64>>,
    /// By line, then channel, then hit.
    cross: Vec<Vec<Vec<Complex<f64>>>>,
    /// Whether every hit had these channels.
    complete: bool,
    failed: Option<SpectraError>,
}

impl<'a> HitSpectra<'a> {
    /// `None` for a cell that is not between interface points of the assembly.
    fn of(name: &'a CellName, points: &'a Configuration, sigma_per_s: f64) -> Option<Self> {
        let interface = |p: &&Point| matches!(p.grouping, Grouping::InterfaceA | Grouping::InterfaceB);
        let channels: Vec<&Point> =
            points.channels.iter().filter(interface).filter(|p| p.name == name.response).collect();
        let there = points.impacts.iter().filter(interface).any(|p| p.name == name.impact);
        (name.configuration == Structure::Ajb && !channels.is_empty() && there).then(|| HitSpectra {
            name,
            channels,
            windowing: Windowing { sigma_per_s, ..Windowing::default() },
            hits: 0,
            auto: Vec::new(),
            cross: Vec::new(),
            complete: true,
            failed: None,
        })
    }

    fn add(&mut self, hit: &Hit, fs_hz: f64) {
        self.hits += 1;
        self.complete &= hit.response.len() == self.channels.len();
        if self.complete && self.failed.is_none() {
            self.failed = self.spectra(hit, fs_hz).err();
        }
    }

    fn spectra(&mut self, hit: &Hit, fs_hz: f64) -> Result<(), SpectraError> {
        let band_hz = [MAIN_BAND.low_hz, MAIN_BAND.high_hz];
        let outputs: Vec<&[f64]> = hit.response.iter().map(Vec::as_slice).collect();
        let pulse = Pulse::locate(&hit.force_n).ok_or(SpectraError::NoPulse { hit: 0 })?;
        let mut one = Summing::new(fs_hz, hit.force_n.len(), outputs.len(), self.windowing, band_hz);
        one.add(&hit.force_n, &outputs, &pulse)?;
        let y = one.finish(&hit.response_delay_s)?;
        self.auto.resize(y.lines(), Vec::new());
        self.cross.resize(y.lines(), vec![Vec::new(); self.channels.len()]);
        for l in 0..y.lines() {
            self.auto[l].push(y.force(l));
            for (axis, of_channel) in self.cross[l].iter_mut().enumerate() {
                of_channel.push(y.cross(l, axis));
            }
        }
        Ok(())
    }

    /// `None` for a single hit, or if a hit lacks a channel.
    ///
    /// # Errors
    /// A hit that cannot be transformed.
    fn finish(self) -> Result<Option<averaged::CellHits>, SpectraError> {
        if !self.complete || self.hits < 2 {
            return Ok(None);
        }
        self.failed.map_or(Ok(()), Err)?;
        Ok(Some(averaged::CellHits {
            input: self.name.impact.clone(),
            outputs: self.channels.iter().map(|c| c.description.clone()).collect(),
            auto: self.auto,
            cross: self.cross,
        }))
    }
}

/// The response per newton of one hit that moves the contact.
#[derive(Debug, Clone, PartialEq)]
pub struct HitAtContact {
    /// Its cell: hits of one cell share place, aim and direction.
    pub cell: CellName,
    /// The record's id in the campaign file: records are stored in the order of their hits.
    pub record: i64,
    /// T, v_A and v_B.
    pub response: HitResponse,
}

/// From one hit; `None` if it lacks the contact's signals, or is too short.
pub fn of_hit(cell: &CellName, fs_hz: f64, hit: &Hit) -> Option<HitAtContact> {
    let signals = hit.contact.as_ref()?;
    let delays = signals.delay_s;
    let response = HitResponse::of(&HitSignals {
        fs_hz,
        hammer_n: &hit.force_n,
        contact: [&signals.tangential_n, &signals.specimen_a_m_per_s, &signals.specimen_b_m_per_s],
        delay_s: [delays.load_cells, delays.specimen_a, delays.specimen_b],
    })?;
    Some(HitAtContact { cell: cell.clone(), record: hit.record, response })
}

/// Whether the contact changed from the first hits to the last; they must be ordered by cell.
/// `None` with too few.
pub fn drift_of_the_contact(hits: &[HitAtContact]) -> Option<ContactDrift> {
    let at = |own: &[HitAtContact]| own.iter().map(|hit| hit.record as f64).sum::<f64>() / own.len() as f64;
    let cells: Vec<(f64, CellHits<'_>)> = in_cells(hits).map(|own| (at(own), together(own))).collect();
    ContactDrift::of(&cells)
}

/// The verdict from all hits; they must be ordered by cell.
pub fn slip_under_the_hammer(hits: &[HitAtContact]) -> HammerSlip {
    let cells: Vec<CellHits<'_>> = in_cells(hits).map(together).collect();
    HammerSlip::of(&cells)
}

fn in_cells(hits: &[HitAtContact]) -> impl Iterator<Item = &[HitAtContact]> {
    hits.chunk_by(|a, b| a.cell == b.cell)
}

fn together(cell: &[HitAtContact]) -> CellHits<'_> {
    CellHits { impact: &cell[0].cell.impact, hits: cell.iter().map(|hit| &hit.response).collect() }
}

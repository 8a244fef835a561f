//! From kept hits to averaged FRFs, one cell at a time; the time signals are gone when the cell is done.

use super::cell::{Cell, CellName};
use crate::spectra::{FrfSettings, ImpactRecords, MotionQuantity, SpectraError, Windowing, estimate};
use num_complex::Complex;

/// Lines below this carry rigid-body drift and the mains' subharmonics, not the joint, Hz.
pub const LOWEST_HZ: f64 = 10.0;
/// Lines above this are not used by any band, Hz.
pub const HIGHEST_HZ: f64 = 1000.0;

/// Lines in one value of a cell's force spectrum.
pub const FORCE_LINES: usize = 16;

/// Averaged FRFs of one cell on s = σ + iω, as measured (not yet receptances).
#[derive(Debug, Clone)]
pub struct CellAverage {
    /// Which cell.
    pub name: CellName,
    /// The records averaged.
    pub records: Vec<i64>,
    /// Frequency of each line, Hz.
    pub frequency_hz: Vec<f64>,
    /// H1 of x, y, z \[axis\]\[line\].
    pub h1: [Vec<Complex<f64>>; 3],
    /// Coherence of x, y, z \[axis\]\[line\]; NaN for a single hit.
    pub coherence: [Vec<f64>; 3],
    /// Auto-spectrum of the force up to half the sampling rate, N² s²: means of [`FORCE_LINES`] lines each. All lines of all cells
    /// would be most of what an analysis remembers.
    pub force_spectrum: Vec<f64>,
    /// Distance of lines, Hz.
    pub step_hz: f64,
    /// The contact's spectra, where asked for and measured.
    pub contact: Option<ContactAverage>,
}

/// Spectra of the contact's signals against the hammer's force, summed over hits.
#[derive(Debug, Clone)]
pub struct ContactAverage {
    /// Hits summed.
    pub hits: usize,
    /// S_ff, N² s².
    pub force: Vec<f64>,
    /// Cross-spectra with the force of v_A, v_B and T.
    pub cross: [Vec<Complex<f64>>; 3],
    /// Auto-spectra of v_A, v_B and T.
    pub auto: [Vec<f64>; 3],
}

/// Averages the hits of a cell; `contact` asks for the contact's spectra too.
///
/// # Errors
/// No hit, or hits that do not fit together.
pub fn average(
    name: CellName,
    cell: Cell,
    sigma_per_s: f64,
    quantity: MotionQuantity,
    contact: bool,
) -> Result<CellAverage, SpectraError> {
    let contact = contact && cell.hits.iter().all(|h| h.contact.is_some());
    let delays = cell.contact_delay_s;
    let mut delay_s = cell.response_delay_s.to_vec();
    if contact {
        delay_s.extend([delays.specimen_a, delays.specimen_b, delays.load_cells]);
    }
    let records: Vec<i64> = cell.hits.iter().map(|h| h.record).collect();
    let (mut force_n, mut response) = (Vec::new(), Vec::new());
    for hit in cell.hits {
        force_n.push(hit.force_n);
        let mut outputs = Vec::from(hit.response);
        if let (true, Some(c)) = (contact, hit.contact) {
            outputs.extend([c.specimen_a_m_per_s, c.specimen_b_m_per_s, c.tangential_n]);
        }
        response.push(outputs);
    }
    let used = vec![true; force_n.len()];
    let settings = FrfSettings {
        windowing: Windowing { sigma_per_s, ..Windowing::default() },
        delay_s,
        ..FrfSettings::default()
    };
    let all = estimate(&ImpactRecords { fs_hz: cell.fs_hz, force_n, response, quantity }, &used, &settings)?;
    let step_hz = all.frequency_hz.get(1).copied().unwrap_or(0.0);
    let mean = |lines: &[f64]| lines.iter().sum::<f64>() / lines.len() as f64;
    let force_spectrum = all.s_ff.chunks(FORCE_LINES).map(mean).collect();
    let kept = all.band(LOWEST_HZ, HIGHEST_HZ);
    let output = |o: usize| kept.h1.iter().map(|row| row[o]).collect::<Vec<_>>();
    let coherence = |o: usize| kept.coherence.iter().map(|row| row[o]).collect::<Vec<_>>();
    let contact = contact.then(|| {
        let hits = kept.hits as f64;
        let cross = |o: usize| -> Vec<Complex<f64>> {
            kept.h1.iter().zip(&kept.s_ff).map(|(row, s)| row[o] * s * hits).collect()
        };
        // |H2| = S_xx / |S_xf|
        let auto = |o: usize| -> Vec<f64> {
            kept.h2.iter().zip(cross(o)).map(|(row, s_xf)| row[o].norm() * s_xf.norm()).collect()
        };
        ContactAverage {
            hits: kept.hits,
            force: kept.s_ff.iter().map(|s| s * hits).collect(),
            cross: [cross(3), cross(4), cross(5)],
            auto: [auto(3), auto(4), auto(5)],
        }
    });
    Ok(CellAverage {
        name,
        records,
        h1: [output(0), output(1), output(2)],
        coherence: [coherence(0), coherence(1), coherence(2)],
        frequency_hz: kept.frequency_hz,
        force_spectrum,
        step_hz,
        contact,
    })
}

impl ContactAverage {
    /// Adds the hits of another cell of the same impact (or of another impact, for sums over all).
    pub fn add(&mut self, other: &ContactAverage) {
        self.hits += other.hits;
        let sum = |a: &mut [f64], b: &[f64]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        sum(&mut self.force, &other.force);
        for i in 0..3 {
            sum(&mut self.auto[i], &other.auto[i]);
            self.cross[i].iter_mut().zip(&other.cross[i]).for_each(|(a, b)| *a += b);
        }
    }
}

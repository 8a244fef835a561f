//! From kept hits to spectra, one cell at a time; a hit's time signals are gone when it is in the sums.

use super::cell::{CellName, ContactDelays, Hit};
use crate::contact::{BAND, LEVEL_LINES, SIGMA_PER_S};
use crate::spectra::{CrossSpectra, Pulse, SpectraError, Summing, Windowing};

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

/// The sums over a cell's hits, which come one at a time. Hits of sessions with other delays are summed apart, and brought in step
/// with the force before the sums are added.
pub struct CellSums {
    name: CellName,
    sigma_per_s: f64,
    asked: Asked,
    lines_hz: [f64; 2],
    records: Vec<i64>,
    groups: Vec<Group>,
    /// Channels of the response location.
    axes: usize,
    /// Whether every hit had the signals at the contact.
    at_contact: bool,
}

/// The hits that are late by the same times.
struct Group {
    delay_s: Vec<f64>,
    light: Summing,
    damped: Option<Summing>,
}

impl CellSums {
    /// Of a cell without hits.
    pub fn new(name: CellName, sigma_per_s: f64, asked: Asked, lines_hz: [f64; 2]) -> Self {
        CellSums {
            name,
            sigma_per_s,
            asked,
            lines_hz,
            records: Vec::new(),
            groups: Vec::new(),
            axes: 0,
            at_contact: true,
        }
    }

    /// Adds a hit that was sampled at `fs_hz`.
    ///
    /// # Errors
    /// A hit that does not fit the others, or holds no pulse.
    pub fn add(&mut self, hit: &Hit, fs_hz: f64) -> Result<(), SpectraError> {
        if self.records.is_empty() {
            self.axes = hit.response.len();
            if hit.contact.is_none() {
                // what one hit lacks is told of none
                self.asked = Asked::default();
            }
        }
        let mut delay_s = hit.response_delay_s.clone();
        let mut outputs: Vec<&[f64]> = hit.response.iter().map(Vec::as_slice).collect();
        let nothing = match (self.wants_contact(), &hit.contact) {
            (true, None) => vec![0.0; hit.force_n.len()],
            _ => Vec::new(),
        };
        if self.wants_contact() {
            if let Some(contact) = &hit.contact {
                let ContactDelays { specimen_a, specimen_b, load_cells } = contact.delay_s;
                delay_s.extend([specimen_a, specimen_b, load_cells]);
                outputs.extend([
                    &contact.specimen_a_m_per_s[..],
                    &contact.specimen_b_m_per_s,
                    &contact.tangential_n,
                ]);
            } else {
                // what one hit lacks is told of none
                self.at_contact = false;
                delay_s.extend([0.0; 3]);
                outputs.extend([&nothing[..]; 3]);
            }
        }
        let place = self.groups.iter().position(|group| group.delay_s == delay_s);
        let group = if let Some(place) = place {
            &mut self.groups[place]
        } else {
            let (samples, channels) = (hit.force_n.len(), outputs.len());
            let sums = |sigma_per_s: f64, band_hz: [f64; 2]| {
                let windowing = Windowing { sigma_per_s, ..Windowing::default() };
                Summing::new(fs_hz, samples, channels, windowing, band_hz)
            };
            let light = sums(self.sigma_per_s, self.summed_lines_hz());
            let damped = self.asked.damped.then(|| sums(SIGMA_PER_S, [BAND.low_hz, BAND.high_hz]));
            self.groups.push(Group { delay_s, light, damped });
            let last = self.groups.len() - 1;
            &mut self.groups[last]
        };
        let no_pulse = SpectraError::NoPulse { hit: self.records.len() };
        let pulse = Pulse::locate(&hit.force_n).ok_or(no_pulse)?;
        group.light.add(&hit.force_n, &outputs, &pulse)?;
        if let Some(damped) = &mut group.damped {
            damped.add(&hit.force_n, &outputs, &pulse)?;
        }
        self.records.push(hit.record);
        Ok(())
    }

    /// What the hits give together.
    ///
    /// # Errors
    /// No hit, or hits that do not fit together.
    pub fn finish(self) -> Result<CellAverage, SpectraError> {
        let all = self.together(|group| Some(group.light.finish(&group.delay_s)))?;
        let all = all.ok_or(SpectraError::NoHits)?;
        let force = self.together(|group| Some(group.light.force()))?.ok_or(SpectraError::NoHits)?;
        let damped = if self.at_contact {
            self.together(|group| group.damped.as_ref().map(|sums| sums.finish(&group.delay_s)))?
        } else {
            None
        };
        let light = damped.is_some().then(|| all.band(LEVEL_LINES.low_hz, LEVEL_LINES.high_hz));
        let step_hz = force.frequency_hz().get(1).copied().unwrap_or(0.0);
        let mean = |lines: &[f64]| lines.iter().sum::<f64>() / lines.len() as f64;
        let force_spectrum = force.force_spectrum().chunks(FORCE_LINES).map(mean).collect();
        let kept = all.band(self.lines_hz[0], self.lines_hz[1]);
        let contact =
            (self.asked.contact && self.at_contact).then(|| kept.of_outputs(self.axes..self.axes + 3));
        Ok(CellAverage {
            spectra: kept.of_outputs(0..self.axes),
            name: self.name,
            records: self.records,
            force_spectrum,
            step_hz,
            contact,
            damped,
            light,
        })
    }

    fn wants_contact(&self) -> bool {
        self.asked.contact || self.asked.damped
    }

    /// The lines that the light window's sums must hold.
    fn summed_lines_hz(&self) -> [f64; 2] {
        let [low_hz, high_hz] = self.lines_hz;
        if self.asked.damped {
            [low_hz.min(LEVEL_LINES.low_hz), high_hz.max(LEVEL_LINES.high_hz)]
        } else {
            [low_hz, high_hz]
        }
    }

    /// A part of every group, added.
    fn together(
        &self,
        part: impl Fn(&Group) -> Option<Result<CrossSpectra, SpectraError>>,
    ) -> Result<Option<CrossSpectra>, SpectraError> {
        let mut all: Option<CrossSpectra> = None;
        for own in self.groups.iter().filter_map(part) {
            match &mut all {
                Some(sum) => sum.add(&own?)?,
                None => all = Some(own?),
            }
        }
        Ok(all)
    }
}

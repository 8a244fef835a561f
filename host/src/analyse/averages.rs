//! From kept hits to spectra, one cell at a time; a hit's time signals are not kept once it has
//! been added.

use super::cell::{CellName, ContactDelays, Hit};
use crate::contact::{BAND, LEVEL_LINES, SIGMA_PER_S};
use crate::spectra::{CrossSpectra, Pulse, SpectraError, Summing, Windowing};

/// The lines used, Hz: lower ones contain rigid-body drift and subharmonics of the mains rather
/// than the joint; higher ones are in no band.
pub const LINES_HZ: [f64; 2] = [10.0, 1000.0];

/// Number of lines averaged in one value of a cell's force spectrum.
pub const FORCE_LINES: usize = 16;

/// Spectra of one cell on s = σ + iω, as measured (not yet receptances).
#[derive(Debug, Clone)]
pub struct CellAverage {
    /// The cell.
    pub name: CellName,
    /// The records averaged.
    pub records: Vec<i64>,
    /// The response, for each of its channels.
    pub spectra: CrossSpectra,
    /// Auto-spectrum of the force up to half the sampling rate, N² s²: means of [`FORCE_LINES`]
    /// lines each. Storing all lines of all cells would dominate the memory of an analysis.
    pub force_spectrum: Vec<f64>,
    /// Spacing of the lines, Hz.
    pub step_hz: f64,
    /// v_A, v_B and T at the contact, if requested and measured.
    pub contact: Option<CrossSpectra>,
    /// The response, v_A, v_B and T with the heavy damping used for the contact, if requested and
    /// measured.
    pub damped: Option<CrossSpectra>,
    /// As `damped` but with the plan's light damping, used to correct the shaker's levels.
    pub light: Option<CrossSpectra>,
}

/// Results of a cell requested in addition to its FRFs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Asked {
    /// The spectra at the contact.
    pub contact: bool,
    /// The spectra at the contact and of the response, from which the contact stiffness is
    /// identified.
    pub damped: bool,
}

/// Sums over a cell's hits, which are added one at a time. Hits of sessions with different delays
/// are summed separately, and corrected for their delays before the sums are added.
pub struct CellSums {
    name: CellName,
    sigma_per_s: f64,
    asked: Asked,
    lines_hz: [f64; 2],
    records: Vec<i64>,
    groups: Vec<Group>,
    /// Number of channels of the response location.
    axes: usize,
    /// Whether every hit had the signals at the contact.
    at_contact: bool,
}

/// Hits with the same delays.
struct Group {
    delay_s: Vec<f64>,
    light: Summing,
    damped: Option<Summing>,
}

impl CellSums {
    /// A cell without hits.
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

    /// Adds a hit sampled at `fs_hz`.
    ///
    /// # Errors
    /// A hit that does not match the others, or has no pulse.
    pub fn add(&mut self, hit: &Hit, fs_hz: f64) -> Result<(), SpectraError> {
        if self.records.is_empty() {
            self.axes = hit.response.len();
            if hit.contact.is_none() {
                // omitted if any hit lacks it
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
                // omitted if any hit lacks it
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

    /// The average of all hits.
    ///
    /// # Errors
    /// No hit, or hits that do not match.
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

    /// The lines for which the sums with the light window are needed.
    fn summed_lines_hz(&self) -> [f64; 2] {
        let [low_hz, high_hz] = self.lines_hz;
        if self.asked.damped {
            [low_hz.min(LEVEL_LINES.low_hz), high_hz.max(LEVEL_LINES.high_hz)]
        } else {
            [low_hz, high_hz]
        }
    }

    /// One part of every group, added up.
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

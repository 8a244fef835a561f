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
    /// The response, v_A and v_B if measured, and T, with the heavy damping used for the contact, if
    /// requested and measured.
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
    /// Number of signals at the contact that are summed.
    summed: usize,
    /// Which signals at the contact every hit had.
    at_contact: AtContact,
}

/// The signals at the contact that the hits of a cell have in common.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum AtContact {
    /// v_A, v_B and T.
    All,
    /// T alone: no vibrometer measures next to the contact.
    Force,
    /// None, or not the same in all hits.
    Nothing,
}

impl AtContact {
    fn of(hit: &Hit) -> Self {
        match (&hit.contact, &hit.load_cells) {
            (Some(_), _) => AtContact::All,
            (None, Some(_)) => AtContact::Force,
            (None, None) => AtContact::Nothing,
        }
    }

    /// Number of these signals.
    fn count(self) -> usize {
        match self {
            AtContact::All => 3,
            AtContact::Force => 1,
            AtContact::Nothing => 0,
        }
    }
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
            summed: 0,
            at_contact: AtContact::Nothing,
        }
    }

    /// Adds a hit sampled at `fs_hz`.
    ///
    /// # Errors
    /// A hit that does not match the others, or has no pulse.
    pub fn add(&mut self, hit: &Hit, fs_hz: f64) -> Result<(), SpectraError> {
        let here = AtContact::of(hit);
        if self.records.is_empty() {
            self.axes = hit.response.len();
            self.at_contact = here;
            // omitted if any hit lacks it
            self.asked.contact &= here == AtContact::All;
            self.asked.damped &= here != AtContact::Nothing;
            self.summed = if self.wants_contact() { here.count() } else { 0 };
        }
        if here != self.at_contact {
            self.at_contact = AtContact::Nothing;
        }
        let mut delay_s = hit.response_delay_s.clone();
        let mut outputs: Vec<&[f64]> = hit.response.iter().map(Vec::as_slice).collect();
        // a hit that lacks signals of the earlier ones keeps the number of outputs
        let nothing = vec![0.0; if here.count() < self.summed { hit.force_n.len() } else { 0 }];
        let signals: Vec<(f64, &[f64])> = match (&hit.contact, &hit.load_cells) {
            (Some(contact), _) if self.summed == 3 => {
                let ContactDelays { specimen_a, specimen_b, load_cells } = contact.delay_s;
                vec![
                    (specimen_a, &contact.specimen_a_m_per_s),
                    (specimen_b, &contact.specimen_b_m_per_s),
                    (load_cells, &contact.tangential_n),
                ]
            }
            (Some(contact), _) if self.summed == 1 => {
                vec![(contact.delay_s.load_cells, &contact.tangential_n)]
            }
            (None, Some(force)) if self.summed == 1 => vec![(force.delay_s, &force.tangential_n)],
            _ => vec![(0.0, &nothing); self.summed],
        };
        delay_s.extend(signals.iter().map(|(delay_s, _)| delay_s));
        outputs.extend(signals.iter().map(|(_, signal)| signal));
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
        let damped = if self.at_contact == AtContact::Nothing {
            None
        } else {
            self.together(|group| group.damped.as_ref().map(|sums| sums.finish(&group.delay_s)))?
        };
        let spots = self.at_contact == AtContact::All;
        let light = (damped.is_some() && spots).then(|| all.band(LEVEL_LINES.low_hz, LEVEL_LINES.high_hz));
        let step_hz = force.frequency_hz().get(1).copied().unwrap_or(0.0);
        let mean = |lines: &[f64]| lines.iter().sum::<f64>() / lines.len() as f64;
        let force_spectrum = force.force_spectrum().chunks(FORCE_LINES).map(mean).collect();
        let kept = all.band(self.lines_hz[0], self.lines_hz[1]);
        let contact = (self.asked.contact && spots).then(|| kept.of_outputs(self.axes..self.axes + 3));
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

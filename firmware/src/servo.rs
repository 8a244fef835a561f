//! The shaker's amplitude under control: what a lock-in measures is brought to what was ordered, by
//! the drive.
//!
//! The plant is a structure: its amplitude follows the drive's in proportion, after a delay of some
//! tens of ms (1 % of damping at 208 Hz settles with 77 ms). So the drive is corrected by ratios:
//! after each measurement by a part of what is missing, in logarithms, and by a bounded factor.
//! With measurements of 80 ms or more the delay leaves 0.35 of a change for the next one, and a
//! correction of 0.3 of the error then comes in without swinging: the roots of (z − 1)(z − 0.35) +
//! 0.3 · 0.65 have the magnitude 0.74 and angles below 23°.
//!
//! **A contact that slips** is no such plant. Up to its limit it is stiff; a per cent of drive
//! beyond, it moves several times as far, and the amplitude's logarithm changes up to some hundred
//! times as fast as the drive's. Nothing tells beforehand at which drive that is. So the way up is
//! a climb of small steps with a glance of a few cycles after each, the smaller the less is
//! missing: r times the amplitude is missing, the next step is r/150. Stiff 500 times over, a
//! contact that lets go at that step moves some three times as far as was ordered, however far it
//! was from there. When less than a fiftieth is missing, measurements take over.
//!
//! A glance beyond a ceiling says that the last step went too far: the drive goes back to where it
//! was before, which from then on is the edge. Up to the edge it is corrected as ever; beyond it by
//! strides that begin at a quarter of the step, and divided by the steepness that the last two
//! measurements show.

use heapless::Vec;
use jointrig_protocol::channel::{Channel, Role};
use jointrig_protocol::request::Control;
#[allow(unused_imports, reason = "core has no powf; where std is linked its own is taken")]
use micromath::F32Ext;

use crate::hammer::Scanned;
use crate::lock_in::LockIn;

/// Shortest measurement.
const LEAST_S: f32 = 0.08;
/// Part of the logarithmic error that one measurement corrects.
const PART: f32 = 0.3;
/// Shortest glance between measurements.
const GLANCE_S: f32 = 0.01;
/// An amplitude this many times what was ordered is too far, however short it was looked at.
const CEILING: f32 = 1.25;
/// Part of the logarithmic error that one measurement corrects where the plant is steep.
const STEEP_PART: f32 = 0.35;
/// The steepest plant that is believed.
const STEEPEST: f32 = 200.0;
/// Part of the difference by which a plant that proves less steep is believed to be so.
const FORGETS: f32 = 0.25;
/// Changes of the drive below this part of it tell nothing of the steepness.
const TELLING: f32 = 2e-4;
/// The longest logarithmic correction of a steep plant: ln 1.2.
const STRIDE: f32 = 0.182;
/// What a correction that was too long leaves of the next one's bound, and what one that was not
/// makes of it.
const SHORTER: f32 = 0.25;
/// See [`SHORTER`].
const LONGER: f32 = 1.25;
/// Largest factor of one correction, and its inverse the smallest.
const FACTOR: f32 = 1.2;
/// A step of the climb, for each time that the amplitude is missing.
const STEP: f32 = 1.0 / 150.0;
/// The longest step of the climb.
const LONGEST: f32 = 0.15;
/// A plant whose amplitude changes this much faster than the drive, in logarithms, has let go.
const LETS_GO: f32 = 4.0;
/// With so many times the amplitude missing a glance may still be noise.
const NEAR: f32 = 10.0;
/// The climb is over when no more than this times the amplitude is wanted.
const CLIMBED: f32 = 1.02;
/// The way up begins at this part of the drive's bound: even in a resonance that is far below a
/// small order.
const FIRST_PART: f32 = 0.001;
/// A glance below this part of the one before says that the amplitude falls.
const FALLS: f32 = 0.95;
/// Glances in a row beyond the ceiling: the amplitude runs away, whatever the drive does.
const GLANCES: u8 = 12;
/// Measurements at the drive's bound without reaching the amplitude, until that is told.
const PATIENCE: u8 = 25;

/// One signal that is summed: channel and its factor.
type Term = (u8, f32);

/// Why control cannot go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The amplitude is far beyond what was ordered.
    Runaway,
    /// The drive at its bound does not reach the amplitude.
    Weak,
}

/// What measures: the channels, and the scale of each.
pub struct Gauges<'a> {
    /// Which serves for what.
    pub channels: &'a [Channel],
    /// SI units per code, with its sign, in the same order.
    pub units_per_code: &'a [f32],
}

/// The controller of one order.
pub struct Servo {
    terms: Vec<Term, 2>,
    /// From the sum's amplitude to the controlled one: 1/ω for a displacement out of velocities.
    gain: f32,
    target: f32,
    most_v: f32,
    lock_in: LockIn,
    measured: f32,
    in_vain: u8,
    /// Drive and amplitude of the last measurement.
    last: Option<(f32, f32)>,
    /// On the way up.
    climbs: bool,
    /// What is known since the ceiling was first met.
    steep: Option<Steep>,
    beyond: u8,
}

/// What is known of a steep plant.
#[derive(Clone, Copy)]
struct Steep {
    /// Change of the amplitude's logarithm with the drive's.
    ness: f32,
    /// The longest logarithmic correction beyond the edge.
    stride: f32,
    /// The drive below which the ceiling was not met, V.
    edge_v: f32,
}

impl Servo {
    /// For the channels of this device; `None` when they do not measure what is to be controlled,
    /// or when nothing is.
    pub fn new(gauges: &Gauges<'_>, rate_hz: u32, control: Control, step: u32, most_v: f32) -> Option<Self> {
        let find = |role: Role| {
            let place = gauges.channels.iter().position(|channel| channel.role == role)?;
            Some((place as u8, *gauges.units_per_code.get(place)?))
        };
        let mut terms = Vec::new();
        let (target, gain) = match control {
            Control::Drive => return None,
            Control::Displacement { amplitude_m } => {
                let (a, b) = (find(Role::SpecimenA)?, find(Role::SpecimenB)?);
                let omega = step as f32 / 4_294_967_296.0 * core::f32::consts::TAU * rate_hz as f32;
                // two places for two terms
                terms.push(a).ok()?;
                terms.push((b.0, -b.1)).ok()?;
                (amplitude_m, 1.0 / omega)
            }
            Control::Force { amplitude_n } => {
                terms.push(find(Role::Excitation)?).ok()?;
                (amplitude_n, 1.0)
            }
        };
        let scans = |seconds: f32| (seconds * rate_hz as f32) as u32;
        let lock_in = LockIn::new(scans(GLANCE_S), scans(LEAST_S));
        let (last, steep) = (None, None);
        Some(Self {
            terms,
            gain,
            target,
            most_v,
            lock_in,
            measured: 0.0,
            in_vain: 0,
            last,
            climbs: true,
            steep,
            beyond: 0,
        })
    }

    /// The amplitude that was measured last, m or N.
    pub fn measured(&self) -> f32 {
        self.measured
    }

    /// The first drive, V.
    pub fn first_v(&self) -> f32 {
        FIRST_PART * self.most_v
    }

    /// What of an earlier order's control goes on in this one: the measurement under way is
    /// dropped.
    pub fn continues(&mut self, before: &Self) {
        self.measured = before.measured;
        self.last = before.last;
        self.climbs = before.climbs || self.target > before.target;
        self.steep = before.steep;
    }

    /// Takes one scan; the drive that is now wanted, V, when a measurement is complete.
    ///
    /// # Errors
    /// [`Trouble`], once.
    pub fn feed(
        &mut self,
        block: &impl Scanned,
        scan: usize,
        angle: u32,
        step: u32,
        drive_v: f32,
    ) -> Result<Option<f32>, Trouble> {
        let signal = self
            .terms
            .iter()
            .map(|(channel, factor)| f32::from(block.code(scan, usize::from(*channel))) * factor)
            .sum();
        let Some(seen) = self.lock_in.feed(signal, angle, step) else { return Ok(None) };
        let glance = seen.glance * self.gain;
        if glance > CEILING * self.target {
            return self.retreat(glance, drive_v).map(Some);
        }
        self.beyond = 0;
        let wanted = if self.climbs {
            self.measured = glance;
            let missing = self.target / glance.max(f32::MIN_POSITIVE);
            if let Some(steep) = self.step(glance, drive_v)
                && steep.ness > LETS_GO
                && missing < NEAR
            {
                self.steep = Some(steep);
            }
            self.last = Some((drive_v, glance));
            if missing < CLIMBED || self.steep.is_some() {
                self.climbs = false;
                self.lock_in.restart();
                return Ok(None);
            }
            drive_v * (1.0 + (STEP * missing).min(LONGEST))
        } else {
            let Some(amplitude) = seen.whole else { return Ok(None) };
            self.measured = amplitude * self.gain;
            self.learn(drive_v);
            self.last = Some((drive_v, self.measured));
            drive_v * self.correction(drive_v)
        };
        let wanted = wanted.min(self.most_v);
        self.in_vain = match seen.whole {
            _ if wanted < self.most_v => 0,
            Some(_) => self.in_vain + 1,
            None => self.in_vain,
        };
        if self.in_vain > PATIENCE { Err(Trouble::Weak) } else { Ok(Some(wanted)) }
    }

    /// What the step from the last measurement to this glance tells, if there was one upwards.
    fn step(&self, glance: f32, drive_v: f32) -> Option<Steep> {
        let (last_v, amplitude) = self.last.filter(|(last_v, _)| drive_v > last_v * (1.0 + TELLING))?;
        let step = logarithm(drive_v / last_v);
        let ness = (logarithm(glance / amplitude.max(f32::MIN_POSITIVE)) / step).clamp(1.0, STEEPEST);
        Some(Steep { ness, stride: SHORTER * step, edge_v: last_v })
    }

    /// Back from beyond the ceiling: the drive that is wanted.
    fn retreat(&mut self, glance: f32, drive_v: f32) -> Result<f32, Trouble> {
        let falls = self.beyond > 0 && glance < FALLS * self.measured;
        self.climbs = false;
        self.measured = glance;
        self.lock_in.restart();
        self.beyond += 1;
        if self.beyond > GLANCES {
            return Err(Trouble::Runaway);
        }
        if let Some(steep) = self.step(glance, drive_v) {
            self.steep = Some(steep);
            return Ok(steep.edge_v);
        }
        if falls {
            return Ok(drive_v);
        }
        // even where it was measured last it is too far now
        let Steep { ness, stride, .. } = self.steep.unwrap_or(Steep { ness: 1.0, stride: 0.0, edge_v: 0.0 });
        let back = (logarithm(glance / self.target) / ness).max(stride).min(STRIDE);
        let back_v = drive_v * exponential(-back);
        self.last = None;
        self.steep = Some(Steep { ness, stride: back, edge_v: back_v });
        Ok(back_v)
    }

    /// Sees from two measurements how steep the plant is, once it is known to be.
    fn learn(&mut self, drive_v: f32) {
        let (Some(steep), Some((last_v, amplitude))) = (&mut self.steep, self.last) else { return };
        let step = logarithm(drive_v / last_v);
        if step.abs() > TELLING {
            let seen =
                (logarithm(self.measured / amplitude.max(f32::MIN_POSITIVE)) / step).clamp(1.0, STEEPEST);
            // at the limit itself the plant is stiff one time and steep the next: what is steep is
            // believed at once
            steep.ness = if seen > steep.ness { seen } else { steep.ness + FORGETS * (seen - steep.ness) };
        }
        if drive_v >= steep.edge_v {
            steep.stride = (LONGER * steep.stride).min(STRIDE);
        }
    }

    fn correction(&self, drive_v: f32) -> f32 {
        // noise alone may measure nothing at all
        let ratio = self.target / self.measured.max(f32::MIN_POSITIVE);
        let missing = logarithm(ratio);
        let Some(Steep { ness, stride, edge_v }) = self.steep else {
            return exponential(PART * missing).clamp(1.0 / FACTOR, FACTOR);
        };
        // not by clamp, whose panic for bounds that are no constants can print floats and with that
        // costs 16 kB of flash
        let bound =
            if drive_v < edge_v { logarithm(edge_v / drive_v).max(stride).min(STRIDE) } else { stride };
        exponential((STEEP_PART * missing / ness).max(-stride).min(bound))
    }
}

/// The logarithm by its series around 1 in (r − 1)/(r + 1): good to 1e-4 from a half to 2, to 5 %
/// from an eighth to 8; beyond those it is theirs.
fn logarithm(ratio: f32) -> f32 {
    let ratio = ratio.clamp(0.125, 8.0);
    let y = (ratio - 1.0) / (ratio + 1.0);
    2.0 * (y + y * y * y / 3.0 + y.powi(5) / 5.0)
}

/// The exponential of what is small: to 1e-3 at ± 0.2.
fn exponential(step: f32) -> f32 {
    1.0 + step * (1.0 + step / 2.0)
}

//! Control of the shaker's amplitude: the drive is adjusted until the amplitude measured by a
//! lock-in matches the requested one.
//!
//! The plant is a structure: its amplitude follows the drive's proportionally, after a delay of
//! some tens of ms (with 1 % damping at 208 Hz, it settles with a time constant of 77 ms). The
//! drive is therefore corrected by ratios: after each measurement by a fraction of the missing
//! logarithmic ratio, and by a factor of at most 1.2. With measurements of 80 ms or more, 0.35 of a
//! change is left for the next measurement, and a correction of 0.3 of the error then converges
//! without oscillation: the roots of (z − 1)(z − 0.35) + 0.3 · 0.65 have the magnitude 0.74 and
//! angles below 23°.
//!
//! **A contact that slips** behaves differently. Up to its friction limit it is stiff; with one per
//! cent more drive it moves several times as far, and the logarithm of the amplitude changes up to
//! about a hundred times as fast as that of the drive. The drive at which this happens is not known
//! beforehand. Therefore the amplitude is raised in small steps (the climb), with a glance of a few
//! cycles after each; the less is missing, the smaller the step: when the target is r times the
//! amplitude, the next step is r/150 of the drive. If the stiffness falls by a factor of 500 at
//! that step, the contact moves about three times as far as requested, independently of r. When
//! less than a fiftieth is missing, measurements take over.
//!
//! A glance above the ceiling means that the last step was too large: the drive returns to its
//! previous value, which becomes the edge. Below the edge, a correction may go up to the edge;
//! beyond it, corrections are bounded, initially to a quarter of that step. All of them are divided
//! by the steepness found from the last two measurements.

use heapless::Vec;
use jointrig_protocol::channel::{Channel, Role};
use jointrig_protocol::request::Control;
#[allow(unused_imports, reason = "core has no powf; where std is linked its own is taken")]
use micromath::F32Ext;

use crate::hammer::Scanned;
use crate::lock_in::LockIn;

/// Shortest measurement, s.
const LEAST_S: f32 = 0.08;
/// Fraction of the logarithmic error corrected per measurement.
const PART: f32 = 0.3;
/// Shortest glance between measurements, s.
const GLANCE_S: f32 = 0.01;
/// An amplitude above this multiple of the requested one is too large, even in a short glance.
const CEILING: f32 = 1.25;
/// Fraction of the logarithmic error corrected per measurement when the plant is steep.
const STEEP_PART: f32 = 0.35;
/// Upper bound of the estimated steepness.
const STEEPEST: f32 = 200.0;
/// Fraction of the difference by which the estimate is reduced when the plant proves less steep.
const FORGETS: f32 = 0.25;
/// Relative changes of the drive below this value carry no information about the steepness.
const TELLING: f32 = 2e-4;
/// The largest logarithmic correction of a steep plant: ln 1.2.
const STRIDE: f32 = 0.182;
/// Factor on the bound of the next correction after a correction that was too large ([`SHORTER`]),
/// and after one that was not ([`LONGER`]).
const SHORTER: f32 = 0.25;
/// See [`SHORTER`].
const LONGER: f32 = 1.25;
/// Largest factor of one correction; its inverse is the smallest.
const FACTOR: f32 = 1.2;
/// Relative step of the climb per multiple of the amplitude that is missing.
const STEP: f32 = 1.0 / 150.0;
/// Largest relative step of the climb.
const LONGEST: f32 = 0.15;
/// Steepness above which the contact is considered to slip: the logarithm of the amplitude changes
/// this many times faster than that of the drive.
const LETS_GO: f32 = 4.0;
/// When the target exceeds a glance by this factor or more, the glance may still be noise.
const NEAR: f32 = 10.0;
/// The climb ends when the target is less than this multiple of the amplitude.
const CLIMBED: f32 = 1.02;
/// The climb starts at this fraction of the drive's bound: even in a resonance this is far below a
/// small request.
const FIRST_PART: f32 = 0.001;
/// A glance below this fraction of the previous one means that the amplitude is falling.
const FALLS: f32 = 0.95;
/// Consecutive glances above the ceiling after which the amplitude is considered to run away,
/// independently of the drive.
const GLANCES: u8 = 12;
/// Measurements with the drive at its bound and the amplitude not reached, after which this is
/// reported.
const PATIENCE: u8 = 25;

/// One signal of the sum: channel and factor.
type Term = (u8, f32);

/// Why control cannot go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// The amplitude stays above the ceiling.
    Runaway,
    /// The drive at its bound does not reach the requested amplitude.
    Weak,
}

/// The measuring channels, and the scale of each.
pub struct Gauges<'a> {
    /// The channels, with their roles.
    pub channels: &'a [Channel],
    /// SI units per code, sign included, in the same order.
    pub units_per_code: &'a [f32],
}

/// The controller for one shaker request.
pub struct Servo {
    terms: Vec<Term, 2>,
    /// Factor from the amplitude of the sum to the controlled one: 1/ω for a displacement from
    /// velocities.
    gain: f32,
    target: f32,
    most_v: f32,
    lock_in: LockIn,
    measured: f32,
    in_vain: u8,
    /// Drive and amplitude of the last measurement.
    last: Option<(f32, f32)>,
    /// The climb is in progress.
    climbs: bool,
    /// Known since the ceiling was first exceeded or the contact was found to slip.
    steep: Option<Steep>,
    beyond: u8,
}

/// Properties of a steep plant.
#[derive(Clone, Copy)]
struct Steep {
    /// Steepness: change of the logarithm of the amplitude per change of that of the drive.
    ness: f32,
    /// The largest logarithmic correction beyond the edge.
    stride: f32,
    /// Drive up to which the ceiling is not exceeded, V.
    edge_v: f32,
}

impl Servo {
    /// A controller for the channels of this device; `None` when they do not measure the quantity
    /// to be controlled, or when none is to be controlled.
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
                // capacity for two terms
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

    /// The last measured amplitude, m or N.
    pub fn measured(&self) -> f32 {
        self.measured
    }

    /// The initial drive, V.
    pub fn first_v(&self) -> f32 {
        FIRST_PART * self.most_v
    }

    /// Takes over the state of an earlier request's controller; the current measurement is
    /// discarded.
    pub fn continues(&mut self, before: &Self) {
        self.measured = before.measured;
        self.last = before.last;
        self.climbs = before.climbs || self.target > before.target;
        self.steep = before.steep;
    }

    /// Processes one scan. Returns the required drive, V, when a measurement is complete.
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

    /// Steepness from the step between the last measurement and this glance, if the drive was
    /// increased.
    fn step(&self, glance: f32, drive_v: f32) -> Option<Steep> {
        let (last_v, amplitude) = self.last.filter(|(last_v, _)| drive_v > last_v * (1.0 + TELLING))?;
        let step = logarithm(drive_v / last_v);
        let ness = (logarithm(glance / amplitude.max(f32::MIN_POSITIVE)) / step).clamp(1.0, STEEPEST);
        Some(Steep { ness, stride: SHORTER * step, edge_v: last_v })
    }

    /// Returns from above the ceiling: the required drive.
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
        // even the drive of the last measurement is too large now
        let Steep { ness, stride, .. } = self.steep.unwrap_or(Steep { ness: 1.0, stride: 0.0, edge_v: 0.0 });
        let back = (logarithm(glance / self.target) / ness).max(stride).min(STRIDE);
        let back_v = drive_v * exponential(-back);
        self.last = None;
        self.steep = Some(Steep { ness, stride: back, edge_v: back_v });
        Ok(back_v)
    }

    /// Updates the steepness from two measurements, once the plant is known to be steep.
    fn learn(&mut self, drive_v: f32) {
        let (Some(steep), Some((last_v, amplitude))) = (&mut self.steep, self.last) else { return };
        let step = logarithm(drive_v / last_v);
        if step.abs() > TELLING {
            let seen =
                (logarithm(self.measured / amplitude.max(f32::MIN_POSITIVE)) / step).clamp(1.0, STEEPEST);
            // at the limit, the plant alternates between stiff and steep: an increase is accepted
            // immediately
            steep.ness = if seen > steep.ness { seen } else { steep.ness + FORGETS * (seen - steep.ness) };
        }
        if drive_v >= steep.edge_v {
            steep.stride = (LONGER * steep.stride).min(STRIDE);
        }
    }

    fn correction(&self, drive_v: f32) -> f32 {
        // with noise alone, the measured amplitude may be zero
        let ratio = self.target / self.measured.max(f32::MIN_POSITIVE);
        let missing = logarithm(ratio);
        let Some(Steep { ness, stride, edge_v }) = self.steep else {
            return exponential(PART * missing).clamp(1.0 / FACTOR, FACTOR);
        };
        // not `clamp`: its panic for non-constant bounds can format floats, which takes 16 kB of
        // flash
        let bound =
            if drive_v < edge_v { logarithm(edge_v / drive_v).max(stride).min(STRIDE) } else { stride };
        exponential((STEEP_PART * missing / ness).max(-stride).min(bound))
    }
}

/// Logarithm by its series around 1 in (r − 1)/(r + 1): accurate to 1e-4 between 1/2 and 2, and to
/// 5 % between 1/8 and 8; saturates beyond.
fn logarithm(ratio: f32) -> f32 {
    let ratio = ratio.clamp(0.125, 8.0);
    let y = (ratio - 1.0) / (ratio + 1.0);
    2.0 * (y + y * y * y / 3.0 + y.powi(5) / 5.0)
}

/// Exponential of a small value: accurate to 1e-3 at ± 0.2.
fn exponential(step: f32) -> f32 {
    1.0 + step * (1.0 + step / 2.0)
}

//! The shaker's amplitude under control: what a lock-in measures is brought to what was ordered, by the drive.
//!
//! The plant is a structure: its amplitude follows the drive's in proportion, after a delay of some tens of ms
//! (1 % of damping at 208 Hz settles with 77 ms). So the drive is corrected by ratios: after each measurement by
//! a part of what is missing, in logarithms, and by a bounded factor. With measurements of 80 ms or more the delay leaves
//! 0.35 of a change for the next one, and a correction of 0.3 of the error then comes in without swinging: the
//! roots of (z − 1)(z − 0.35) + 0.3 · 0.65 have the magnitude 0.74 and angles below 23°.
//!
//! **A contact that slips** is no such plant. Up to its limit it is stiff; a per cent of drive beyond, it moves several
//! times as far, and the amplitude's logarithm changes up to some hundred times as fast as the drive's. So every few cycles a glance tells
//! whether the amplitude is beyond a ceiling. If it is, the last correction went too far: the drive goes back to where it was
//! measured last, the next corrections are a quarter as long, and from then on they are divided by the steepness that the last two
//! measurements show.
//!
//! The factor's bound makes the way up slow enough that the delay overshoots by no more than a few per cent: at 1.2 per
//! measurement the amplitude lags by less than one more such step.

use heapless::Vec;
use jointrig_protocol::channel::{Channel, Role};
use jointrig_protocol::limits::MAX_CHANNELS;
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
/// Changes of the drive below this part of it tell nothing of the steepness.
const TELLING: f32 = 2e-4;
/// The longest logarithmic correction of a steep plant: ln 1.2.
const STRIDE: f32 = 0.182;
/// What a correction that was too long leaves of the next one's bound, and what one that was not makes of it.
const SHORTER: f32 = 0.25;
/// See [`SHORTER`].
const LONGER: f32 = 1.25;
/// Largest factor of one correction, and its inverse the smallest.
const FACTOR: f32 = 1.2;
/// The factor while the amplitude is less than [`FAR`] of what was ordered: what the delay still hides is then harmless, and so is
/// the jump of a contact that lets go.
const FACTOR_FAR: f32 = 1.6;
/// See [`FACTOR_FAR`].
const FAR: f32 = 0.05;
/// The way up begins at this part of the drive's bound: even in a resonance that is far below a small order.
const FIRST_PART: f32 = 0.001;
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
    /// Change of the amplitude's logarithm with the drive's, and the longest correction, since the ceiling was first met.
    steep: Option<Steep>,
    beyond: u8,
}

/// What is known of a steep plant.
#[derive(Clone, Copy)]
struct Steep {
    ness: f32,
    stride: f32,
}

impl Servo {
    /// For the channels of this device; `None` when they do not measure what is to be controlled, or when nothing is.
    pub fn new(channels: &[Channel], rate_hz: u32, control: Control, step: u32, most_v: f32) -> Option<Self> {
        let find = |role: Role| {
            let place = channels.iter().take(MAX_CHANNELS).position(|channel| channel.role == role)?;
            Some((place as u8, channels[place].units_per_code() as f32))
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
        Some(Self { terms, gain, target, most_v, lock_in, measured: 0.0, in_vain: 0, last, steep, beyond: 0 })
    }

    /// The amplitude that was measured last, m or N.
    pub fn measured(&self) -> f32 {
        self.measured
    }

    /// The first drive, V.
    pub fn first_v(&self) -> f32 {
        FIRST_PART * self.most_v
    }

    /// What of an earlier order's control goes on in this one: the measurement under way is dropped.
    pub fn continues(&mut self, before: &Self) {
        self.measured = before.measured;
        self.last = before.last;
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
        let Some(amplitude) = seen.whole else { return Ok(None) };
        self.measured = amplitude * self.gain;
        self.learn(drive_v);
        self.last = Some((drive_v, self.measured));
        let wanted = (drive_v * self.correction()).min(self.most_v);
        self.in_vain = if wanted < self.most_v { 0 } else { self.in_vain + 1 };
        if self.in_vain > PATIENCE { Err(Trouble::Weak) } else { Ok(Some(wanted)) }
    }

    /// Back from beyond the ceiling: the drive that is wanted.
    fn retreat(&mut self, glance: f32, drive_v: f32) -> Result<f32, Trouble> {
        self.measured = glance;
        self.lock_in.restart();
        self.beyond += 1;
        if self.beyond > GLANCES {
            return Err(Trouble::Runaway);
        }
        if let Some((last_v, amplitude)) = self.last
            && drive_v > last_v * (1.0 + TELLING)
        {
            let step = logarithm(drive_v / last_v);
            let ness = (logarithm(glance / amplitude.max(f32::MIN_POSITIVE)) / step).clamp(1.0, STEEPEST);
            self.steep = Some(Steep { ness, stride: SHORTER * step });
            return Ok(last_v);
        }
        // even where it was measured last it is too far now
        let back_v = drive_v / FACTOR;
        self.last = None;
        self.steep.get_or_insert(Steep { ness: 1.0, stride: STRIDE });
        Ok(back_v)
    }

    /// Sees from two measurements how steep the plant is, once it is known to be.
    fn learn(&mut self, drive_v: f32) {
        let (Some(steep), Some((last_v, amplitude))) = (&mut self.steep, self.last) else { return };
        let step = logarithm(drive_v / last_v);
        if step.abs() > TELLING {
            let seen =
                (logarithm(self.measured / amplitude.max(f32::MIN_POSITIVE)) / step).clamp(1.0, STEEPEST);
            steep.ness = 0.5 * (steep.ness + seen);
        }
        steep.stride = (LONGER * steep.stride).min(STRIDE);
    }

    fn correction(&self) -> f32 {
        // noise alone may measure nothing at all
        let ratio = self.target / self.measured.max(f32::MIN_POSITIVE);
        if let Some(Steep { ness, stride }) = self.steep {
            let step = STEEP_PART * logarithm(ratio) / ness;
            // not by clamp, whose panic for bounds that are no constants can print floats and with that costs 16 kB of flash
            return exponential(step.max(-stride).min(stride));
        }
        if !(0.5..=2.0).contains(&ratio) {
            return match ratio {
                far if far > 1.0 / FAR => FACTOR_FAR,
                below if below > 1.0 => FACTOR,
                _ => 1.0 / FACTOR,
            };
        }
        exponential(PART * logarithm(ratio)).clamp(1.0 / FACTOR, FACTOR)
    }
}

/// The logarithm by its series around 1 in (r − 1)/(r + 1): good to 1e-4 from a half to 2, to 5 % from an eighth to 8; beyond those
/// it is theirs.
fn logarithm(ratio: f32) -> f32 {
    let ratio = ratio.clamp(0.125, 8.0);
    let y = (ratio - 1.0) / (ratio + 1.0);
    2.0 * (y + y * y * y / 3.0 + y.powi(5) / 5.0)
}

/// The exponential of what is small: to 1e-3 at ± 0.2.
fn exponential(step: f32) -> f32 {
    1.0 + step * (1.0 + step / 2.0)
}

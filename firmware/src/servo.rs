//! The shaker's amplitude under control: what a lock-in measures is brought to what was ordered, by the drive.
//!
//! The plant is a structure: its amplitude follows the drive's in proportion, after a delay of some tens of ms
//! (1 % of damping at 208 Hz settles with 77 ms). So the drive is corrected by ratios: after each measurement by
//! a part of what is missing, in logarithms, and by a bounded factor. With measurements of 80 ms or more the delay leaves
//! 0.35 of a change for the next one, and a correction of 0.3 of the error then comes in without swinging: the
//! roots of (z − 1)(z − 0.35) + 0.3 · 0.65 have the magnitude 0.74 and angles below 23°.
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
/// Largest factor of one correction, and its inverse the smallest.
const FACTOR: f32 = 1.2;
/// The factor while the amplitude is less than [`FAR`] of what was ordered: what the delay still hides is then harmless.
const FACTOR_FAR: f32 = 1.6;
/// See [`FACTOR_FAR`].
const FAR: f32 = 0.25;
/// The way up begins at this part of the drive's bound: even in a resonance that is far below a small order.
const FIRST_PART: f32 = 0.001;
/// An amplitude this many times what was ordered is a runaway.
const RUNAWAY: f32 = 1.5;
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
        let lock_in = LockIn::new((LEAST_S * rate_hz as f32) as u32);
        Some(Self { terms, gain, target, most_v, lock_in, measured: 0.0, in_vain: 0 })
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
        let Some(amplitude) = self.lock_in.feed(signal, angle, step) else { return Ok(None) };
        self.measured = amplitude * self.gain;
        if self.measured > RUNAWAY * self.target {
            return Err(Trouble::Runaway);
        }
        let wanted = (drive_v * self.correction()).min(self.most_v);
        self.in_vain = if wanted < self.most_v { 0 } else { self.in_vain + 1 };
        if self.in_vain > PATIENCE { Err(Trouble::Weak) } else { Ok(Some(wanted)) }
    }

    fn correction(&self) -> f32 {
        // noise alone may measure nothing at all
        let ratio = self.target / self.measured.max(f32::MIN_POSITIVE);
        if !(0.5..=2.0).contains(&ratio) {
            return match ratio {
                far if far > 1.0 / FAR => FACTOR_FAR,
                below if below > 1.0 => FACTOR,
                _ => 1.0 / FACTOR,
            };
        }
        // ratio^PART = e^(PART ln ratio), by the series of ln around 1 in (r − 1)/(r + 1), good to 1e-4 in this range
        let y = (ratio - 1.0) / (ratio + 1.0);
        let ln = 2.0 * (y + y * y * y / 3.0 + y.powi(5) / 5.0);
        (1.0 + PART * ln * (1.0 + PART * ln / 2.0)).clamp(1.0 / FACTOR, FACTOR)
    }
}

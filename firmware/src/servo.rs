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
//!
//! A contact that has begun to slip can soften so far that its resonance comes down to the drive's
//! frequency; then the amplitude creeps past the ceiling, and a drive reduced by the largest
//! correction lets the contact stick again: without a change the same would repeat for ever.
//! Therefore each return from above the ceiling halves the bound of all later corrections.

use crate::hammer::Scanned;
use heapless::Vec;
use jointrig_protocol::channel::{Channel, Role};
use jointrig_protocol::request::Control;
#[allow(
    unused_imports,
    reason = "core has neither powf nor square root; where std is linked its own is taken"
)]
use micromath::F32Ext;

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
/// Smallest bound of a steep plant's corrections, logarithmic.
const LEAST_STRIDE: f32 = STRIDE / 64.0;
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
    /// Upper bound of all corrections and of the stride.
    longest: f32,
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
        let longest = self.steep.map_or(STRIDE, |steep| steep.longest);
        Some(Steep { ness, stride: (SHORTER * step).min(longest), longest, edge_v: last_v })
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
        if let Some(steep) = self.steep.as_mut().filter(|_| self.beyond == 1) {
            steep.longest = (0.5 * steep.longest).max(LEAST_STRIDE);
        }
        if let Some(steep) = self.step(glance, drive_v) {
            self.steep = Some(steep);
            return Ok(steep.edge_v);
        }
        if falls {
            return Ok(drive_v);
        }
        // even the drive of the last measurement is too large now
        let unknown = Steep { ness: 1.0, stride: 0.0, longest: STRIDE, edge_v: 0.0 };
        let Steep { ness, stride, longest, .. } = self.steep.unwrap_or(unknown);
        let back = (logarithm(glance / self.target) / ness).max(stride).min(longest);
        // while the amplitude stays above the ceiling, further each time
        let back_v = drive_v * exponential(-(back * f32::from(self.beyond)).min(STRIDE));
        self.last = None;
        self.steep = Some(Steep { ness, stride: back, longest, edge_v: back_v });
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
            steep.stride = (LONGER * steep.stride).min(steep.longest);
        }
    }

    fn correction(&self, drive_v: f32) -> f32 {
        // with noise alone, the measured amplitude may be zero
        let ratio = self.target / self.measured.max(f32::MIN_POSITIVE);
        let missing = logarithm(ratio);
        let Some(Steep { ness, stride, longest, edge_v }) = self.steep else {
            return exponential(PART * missing).clamp(1.0 / FACTOR, FACTOR);
        };
        // not `clamp`: its panic for non-constant bounds can format floats, which takes 16 kB of
        // flash
        let bound =
            if drive_v < edge_v { logarithm(edge_v / drive_v).max(stride).min(longest) } else { stride };
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

// Lock-in: the amplitude of one frequency in a signal, measured over whole cycles.
//
// The signal is multiplied by the sine and cosine of the drive's angle and summed over whole
// cycles. Components at other frequencies average out; an offset cancels completely. The sums are
// `f32` over some thousands of scans: each addition is accurate to 6e-8 of the sum, which after
// 10⁴ additions is at most 1e-5 of the amplitude, and usually much less.

/// A quarter of a turn.
const QUARTER: u32 = 1 << 30;

/// Sums of the signal times sine and cosine over a number of scans.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    in_phase: f32,
    quadrature: f32,
    scans: u32,
}

impl Sums {
    const NOTHING: Self = Self { in_phase: 0.0, quadrature: 0.0, scans: 0 };

    fn add(&mut self, other: &Self) {
        self.in_phase += other.in_phase;
        self.quadrature += other.quadrature;
        self.scans += other.scans;
    }

    fn amplitude(&self) -> f32 {
        let squares = self.in_phase * self.in_phase + self.quadrature * self.quadrature;
        2.0 * square_root(squares) / self.scans as f32
    }
}

/// Result after some whole cycles, in the signal's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Amplitude over the last few cycles: available early, but coarse.
    pub glance: f32,
    /// Amplitude over the whole measurement, when it is complete.
    pub whole: Option<f32>,
}

/// The sums of the current measurement and of the current glance (short measurement).
#[derive(Clone, Copy, Debug)]
pub struct LockIn {
    glance: Sums,
    whole: Sums,
    glance_scans: u32,
    least_scans: u32,
    /// A cycle has begun since the start: a renewed request arrives within a cycle, and a partial
    /// cycle can have any amplitude.
    begun: bool,
}

impl LockIn {
    /// Measures over the fewest whole cycles that last at least `least_scans` scans, and glances
    /// after the fewest that last at least `glance_scans`.
    pub const fn new(glance_scans: u32, least_scans: u32) -> Self {
        Self { glance: Sums::NOTHING, whole: Sums::NOTHING, glance_scans, least_scans, begun: false }
    }

    /// Discards the sums.
    pub fn restart(&mut self) {
        *self = Self::new(self.glance_scans, self.least_scans);
    }

    /// Adds the signal of one scan at this angle; the next scan's angle is larger by `step`.
    /// Returns a result when a glance or a measurement is complete.
    pub fn feed(&mut self, signal: f32, angle: u32, step: u32) -> Option<Seen> {
        self.begun |= angle < step;
        if !self.begun {
            return None;
        }
        self.glance.in_phase += signal * sine(angle);
        self.glance.quadrature += signal * sine(angle.wrapping_add(QUARTER));
        self.glance.scans += 1;
        let (_, cycle_ends) = angle.overflowing_add(step);
        let complete = self.whole.scans + self.glance.scans >= self.least_scans;
        if !cycle_ends || !(complete || self.glance.scans >= self.glance_scans) {
            return None;
        }
        self.whole.add(&self.glance);
        let glance = core::mem::take(&mut self.glance).amplitude();
        let whole = complete.then(|| core::mem::take(&mut self.whole).amplitude());
        Some(Seen { glance, whole })
    }
}

/// `core` has no square root, and that of micromath is accurate to a few per cent only: one Newton
/// step reduces the error to 1e-3, two to 1e-6.
fn square_root(value: f32) -> f32 {
    if value <= 0.0 {
        return 0.0;
    }
    let mut root = value.sqrt();
    for _ in 0..2 {
        root = 0.5 * (root + value / root);
    }
    root
}

// Sine of an angle in fractions of a turn, for the drive.
//
// micromath's sine is accurate to a thousandth, which would cause harmonics at −60 dB in the
// drive; libm's uses double precision, which a Cortex-M33 computes in software. A polynomial over
// a quarter turn avoids both drawbacks.

/// Taylor coefficients of sin(π/2 · x) in odd powers of x. The first omitted term bounds the error
/// by (π/2)¹¹/11! = 3.6e-6: a ninth of a 16-bit code.
const COEFFICIENTS: [f32; 5] = [1.570_796_4, -0.645_964_1, 0.079_692_63, -0.004_681_754, 0.000_160_441_2];

/// sin of `angle`, in units of 2⁻³² turn. Error below 4e-6.
pub fn sine(angle: u32) -> f32 {
    // −1 to 1 over the half turn around zero; the other half turn is its mirror image
    let quarters = angle.cast_signed();
    let folded = if (-0x4000_0000..=0x4000_0000).contains(&quarters) {
        quarters
    } else {
        i32::MIN.wrapping_sub(quarters)
    };
    let x = folded as f32 / 1_073_741_824.0;
    let square = x * x;
    x * COEFFICIENTS.iter().rev().fold(0.0, |sum, coefficient| sum * square + coefficient)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    fn measured(frequency_hz: f64, signal: impl Fn(f64) -> f64) -> f32 {
        let step = jointrig_protocol::request::Shake::step_of(frequency_hz, 51_200);
        let (mut lock_in, mut angle) = (LockIn::new(512, 4_096), 0_u32);
        for scan in 0..20_000 {
            let turns = f64::from(scan) * f64::from(step) / 4_294_967_296.0;
            if let Some(Seen { whole: Some(amplitude), .. }) = lock_in.feed(signal(turns) as f32, angle, step)
            {
                return amplitude;
            }
            angle = angle.wrapping_add(step);
        }
        panic!("no measurement");
    }

    #[test]
    fn it_finds_the_amplitude_at_any_phase() {
        for phase in [0.0, 0.3, 1.7, 4.0] {
            let sine = |turns: f64| 2.5e-4 * (turns * core::f64::consts::TAU + phase).sin();
            let amplitude = measured(200.0, sine);
            // error of the table-free sine (4e-6) and rounding of the sums
            assert!((amplitude / 2.5e-4 - 1.0).abs() < 2e-5, "{amplitude}");
        }
    }

    #[test]
    fn whole_cycles_that_are_no_whole_scans_cost_little() {
        // a cycle of 169.54 scans: the last one is truncated by less than one scan of about 4200
        let amplitude = measured(302.0, |turns| (turns * core::f64::consts::TAU + 0.7).sin());
        assert!((amplitude - 1.0).abs() < 5e-4, "{amplitude}");
    }

    #[test]
    fn offset_and_harmonics_do_not_count() {
        let amplitude = measured(200.0, |turns| {
            let angle = turns * core::f64::consts::TAU;
            3.0 + angle.sin() + 0.5 * (3.0 * angle).cos()
        });
        assert!((amplitude - 1.0).abs() < 1e-4, "{amplitude}");
    }

    #[test]
    fn a_glance_sees_a_change_that_the_measurement_still_averages() {
        // 256 scans per cycle: two cycles per glance, sixteen per measurement; the amplitude
        // doubles after eight cycles
        let step = jointrig_protocol::request::Shake::step_of(200.0, 51_200);
        let (mut lock_in, mut angle) = (LockIn::new(512, 4_096), 0_u32);
        let mut seen = std::vec::Vec::new();
        for scan in 0..4_096 {
            let size = if scan < 2_048 { 1.0 } else { 2.0 };
            seen.extend(lock_in.feed(size * sine(angle), angle, step));
            angle = angle.wrapping_add(step);
        }
        let glances: std::vec::Vec<i32> =
            seen.iter().map(|seen| (seen.glance * 1e4).round() as i32).collect();
        assert_eq!(glances, [[10_000; 4], [20_000; 4]].as_flattened());
        let whole: std::vec::Vec<f32> = seen.iter().filter_map(|seen| seen.whole).collect();
        assert!(whole.len() == 1 && (whole[0] - 1.5).abs() < 1e-4, "{whole:?}");
    }

    #[test]
    fn what_begins_within_a_cycle_waits_for_the_next_one() {
        // 2048 scans per cycle, of which four fifths remain: as a glance they would be wrong by a
        // seventh
        let step = jointrig_protocol::request::Shake::step_of(25.0, 51_200);
        for phase in [0.0, 0.8, 1.6] {
            let (mut lock_in, mut angle) = (LockIn::new(512, 4_096), step.wrapping_mul(410));
            let mut seen = std::vec::Vec::new();
            for _ in 0..8_192 {
                let turns = f64::from(angle) / 4_294_967_296.0;
                let signal = (turns * core::f64::consts::TAU + phase).sin() as f32;
                seen.extend(lock_in.feed(signal, angle, step));
                angle = angle.wrapping_add(step);
            }
            assert!(seen.len() >= 2 && seen.iter().all(|seen| (seen.glance - 1.0).abs() < 1e-3), "{seen:?}");
        }
    }

    /// One scan of one channel.
    struct Scan(i16);

    impl Scanned for Scan {
        fn first_scan(&self) -> u64 {
            0
        }

        fn scans(&self) -> usize {
            1
        }

        fn code(&self, _scan: usize, _channel: usize) -> i16 {
            self.0
        }
    }

    #[test]
    fn a_slipping_contact_whose_amplitude_creeps_upwards_is_held() {
        use jointrig_protocol::channel::{Name, Quantity};
        let channel = Channel {
            name: Name::new(),
            role: Role::Excitation,
            quantity: Quantity::Force,
            units_per_volt: 1.0,
            range_v: 10.0,
            delay_ns: 0,
            bits: 16,
        };
        let gauges = Gauges { channels: &[channel], units_per_code: &[1e-3] };
        let step = jointrig_protocol::request::Shake::step_of(25.0, 51_200);
        let target = 10.0;
        let control = Control::Force { amplitude_n: target };
        let mut servo =
            Servo::new(&gauges, 51_200, control, step, 10.0).expect("a channel that it can control");
        // stuck up to 2.82 V, and again when the drive falls below 2.5 V; slipping, it follows the
        // drive up to 2.865 V in some cycles, and grows slowly at any drive beyond
        let (mut drive_v, mut amplitude, mut slips) = (servo.first_v(), 0.0_f32, false);
        let (mut angle, mut cycles_outside) = (0_u32, 0);
        for cycle in 0..1000 {
            slips = if slips { drive_v > 2.5 } else { drive_v > 2.82 };
            amplitude = match (slips, drive_v > 2.865) {
                (false, _) => 0.2 * drive_v,
                (true, false) => amplitude + 0.4 * (6.0 + 20.0 * (drive_v - 2.82) - amplitude),
                (true, true) => amplitude.max(6.0) * (1.05 + 10.0 * (drive_v - 2.865)).min(1.2),
            };
            for _ in 0..2048 {
                let block = Scan((1e3 * amplitude * sine(angle)) as i16);
                if let Some(wanted_v) = servo.feed(&block, 0, angle, step, drive_v).expect("no trouble") {
                    drive_v = wanted_v;
                }
                angle = angle.wrapping_add(step);
            }
            cycles_outside += u32::from(cycle >= 500 && (amplitude / target - 1.0).abs() > 0.5);
        }
        assert!(
            cycles_outside == 0,
            "{cycles_outside} of the last 500 cycles, at last {amplitude} at {drive_v} V"
        );
    }

    #[test]
    fn roots_are_roots() {
        for value in [1e-12_f32, 3e-5, 0.7, 2.0, 4e9] {
            assert!((square_root(value) / value.sqrt() - 1.0).abs() < 1e-6, "{value}");
        }
        assert_eq!(square_root(0.0), 0.0);
    }

    #[test]
    fn it_is_the_sine_within_its_bound_all_around() {
        let mut worst = 0.0_f64;
        for angle in (0..=u32::MAX).step_by(99_991) {
            let exact = (f64::from(angle) / 4_294_967_296.0 * core::f64::consts::TAU).sin();
            worst = worst.max((f64::from(sine(angle)) - exact).abs());
        }
        assert!(worst < 4e-6, "{worst}");
    }

    #[test]
    fn quarters_are_exact_enough_and_the_halves_mirror() {
        assert_eq!(sine(0), 0.0);
        assert!((sine(1 << 30) - 1.0).abs() < 4e-6);
        assert!(sine(1 << 31).abs() < 1e-9);
        assert!((sine(3 << 30) + 1.0).abs() < 4e-6);
        for angle in [1_u32, 77_777, 1 << 29, (1 << 30) + 5] {
            assert_eq!(sine(angle), -sine(angle.wrapping_neg()));
        }
    }
}

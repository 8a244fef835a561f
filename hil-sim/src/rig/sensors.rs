//! The sensors and their errors: from true signals to converter codes.
//!
//! code = round(volts / range · 2^(bits-1)), saturating, volts = (delayed signal · polarity +
//! noise) / scale; the codes of all channels have 16 bits, or all are wide
//! ([`jointrig_protocol::block`]). A delay has whole scans and a fraction of one. Noise is drawn
//! for every channel in every scan, present or not, so that a channel's stream does not depend on
//! the others. Cross-talk, gain and skew ([`Flaws`]) are applied before the noise. The errors of a
//! campaign's instruments, also the true positions of the spots, are keyed to (seed, purpose): the
//! same in every cell and configuration, whatever was visited before.
//!
//! Fixed sensors (vibrometers, accelerometers) stay at one point while the hammer moves; each has
//! its own channel after the ten. Their errors are of the same kinds as those of the vibrometers:
//! true position (keyed to the response point as for the 3-D vibrometer, but without the aiming
//! error), gain, skew and noise, and a sensitivity to motion across their direction. Their noise
//! has a separate stream, so that they do not change the ten channels.
//!
//! An accelerometer's signal is c (A x + b f), with the row c of its velocity: it contains the
//! forces of the same moment directly.

use super::channels::{CHANNELS, Channel, FORCE, LOAD_CELLS, Measured, VIBROMETER, is_gauged};
use super::config::{FixedQuantity, FixedSensor, Hammer, RigConfig, Spot, Spots};
use super::force::ForceSegment;
use super::hammer::nominal_width_s;
use super::key::{Stream, normal, stream, uniform};
use super::probe::{Probe, across, shifted};
use super::{config, normalized};
use jointrig_protocol::channel::{NARROW_BITS, split_code};
use nalgebra::DVector;
use num_complex::Complex;
use std::f64::consts::PI;

/// Converts the true signals to codes.
#[derive(Debug, Clone)]
pub struct Sensors {
    /// Bits of the converters.
    bits: u8,
    codes_per_unit: [f64; CHANNELS],
    /// Noise (codes rms) of each channel.
    noise: [f64; CHANNELS],
    delays: Vec<(usize, DelayLine)>,
    cross_talk: Option<[[f64; 3]; 3]>,
    cell: ForceCell,
    /// Whether the first load cell's channel is the sum of all three.
    summed: bool,
    speckle: Option<Speckle>,
    stream: Stream,
}

impl Sensors {
    /// For a response point with or without speckle, with the cell's idle `stream` and a separate
    /// stream for speckle.
    pub fn new(
        config: &RigConfig,
        channels: &[Channel; CHANNELS],
        flaws: &Flaws,
        speckle: Option<Stream>,
        stream: Stream,
    ) -> Self {
        let sensors = &config.sensors;
        let rate_hz = f64::from(config.scan_rate_hz);
        // White up to half the scan rate.
        let white = (rate_hz / 2.0).sqrt();
        let lc = sensors.load_cells.noise_n;
        let vib = sensors.vibrometer.floor * white;
        let mut noise = [
            sensors.force.noise_n,
            vib,
            vib,
            vib,
            sensors.ldv_a.floor * white,
            sensors.ldv_b.floor * white,
            lc,
            lc,
            lc,
            sensors.excitation.noise_n,
        ];
        let mut codes_per_unit = [0.0; CHANNELS];
        for (at, channel) in channels.iter().enumerate() {
            codes_per_unit[at] = flaws.gains[at] * f64::from(channel.polarity) / channel.step();
            noise[at] /= channel.step();
        }
        let late_scans = channels
            .iter()
            .zip(flaws.skews_s)
            .map(|(channel, skew_s)| f64::from(flaws.latency_scans) + (channel.delay_s + skew_s) * rate_hz);
        let delays = late_scans.enumerate().filter(|(_, late)| *late > 0.0);
        Self {
            bits: sensors.bits,
            codes_per_unit,
            noise,
            delays: delays.map(|(at, late)| (at, DelayLine::new(late))).collect(),
            cross_talk: Some(flaws.cross_talk)
                .filter(|parts| parts.as_flattened().iter().any(|part| *part != 0.0)),
            cell: ForceCell::new(&sensors.force, &config.hammer, 1.0 / rate_hz),
            summed: sensors.load_cells.summed,
            speckle: speckle.map(|stream| Speckle::new(&sensors.vibrometer.speckle, rate_hz, stream)),
            stream,
        }
    }

    /// A hit begins: the noise streams restart here.
    pub fn restart(&mut self, stream: Stream, speckle: Stream) {
        self.stream = stream;
        if let Some(it) = &mut self.speckle {
            it.stream = speckle;
            it.lost = false;
        }
    }

    /// What the hammer's force cell reads (N) at the end of a scan, ringing included.
    #[inline]
    pub fn hammer_n(&mut self, hammer: &[ForceSegment], from_s: f64, to_s: f64) -> f64 {
        self.cell.reads(hammer, from_s, to_s)
    }

    /// Converts one scan's true signals: `codes` are 16-bit codes or the upper words of wide codes,
    /// whose lower words go into `lower`.
    #[inline]
    pub fn convert(&mut self, mut signals: [f64; CHANNELS], codes: &mut [i16], lower: &mut [i16]) {
        if let Some(parts) = &self.cross_talk {
            let own = LOAD_CELLS.map(|at| signals[at]);
            for (at, parts) in LOAD_CELLS.into_iter().zip(parts) {
                signals[at] += parts.iter().zip(own).map(|(part, force_n)| part * force_n).sum::<f64>();
            }
        }
        if self.summed {
            signals[LOAD_CELLS[0]] = LOAD_CELLS.iter().map(|at| signals[*at]).sum();
        }
        for (at, line) in &mut self.delays {
            signals[*at] = line.pass(signals[*at]);
        }
        let mut noise = self.noise;
        if let Some(speckle) = &mut self.speckle {
            let (signal, factor) = speckle.next();
            for at in VIBROMETER {
                signals[at] *= signal;
                noise[at] *= factor;
            }
        }
        // A local generator keeps its state in registers over the ten draws.
        let mut stream = self.stream.clone();
        let mut exact = [0.0; CHANNELS];
        for exact in &mut exact {
            *exact = normal(&mut stream);
        }
        self.stream = stream;
        for at in 0..CHANNELS {
            exact[at] = signals[at] * self.codes_per_unit[at] + noise[at] * exact[at];
        }
        if self.bits > NARROW_BITS {
            let words = exact.map(|exact| split_code(wide_code(exact, self.bits), self.bits));
            codes.iter_mut().zip(words).for_each(|(code, [upper, _])| *code = upper);
            lower.iter_mut().zip(words).for_each(|(code, [_, lower])| *code = lower);
            return;
        }
        let rounded = exact.map(code);
        let given = codes.len().min(CHANNELS);
        codes[..given].copy_from_slice(&rounded[..given]);
    }
}

/// The hammer's force cell: reads f + g s²/(s² + 2s/τ + …) f, one light mode above the band.
///
/// The ringing scales with the hit and has no static error. g is chosen so that the initial slope
/// of a half-sine of nominal duration excites a ringing of `ring_fraction` of the peak.
#[derive(Debug, Clone)]
struct ForceCell {
    lambda: Complex<f64>,
    turn: Complex<f64>,
    gain: f64,
    /// s²/((s−λ)(s−λ*)) = 1 + 2 Re(residue/(s−λ)).
    residue: Complex<f64>,
    z: Complex<f64>,
}

impl ForceCell {
    fn new(sensor: &config::ForceSensor, hammer: &Hammer, period_s: f64) -> Self {
        let omega = 2.0 * PI * sensor.ring_hz;
        let lambda = Complex::new(-1.0 / sensor.ring_decay_s, omega);
        Self {
            lambda,
            turn: (lambda * period_s).exp(),
            gain: sensor.ring_fraction * omega * nominal_width_s(hammer) / PI,
            residue: lambda * lambda / Complex::new(0.0, 2.0 * omega),
            z: Complex::ZERO,
        }
    }

    #[inline]
    fn reads(&mut self, hammer: &[ForceSegment], from_s: f64, to_s: f64) -> f64 {
        if hammer.is_empty() && self.z == Complex::ZERO {
            return 0.0;
        }
        self.z *= self.turn;
        let mut force_n = 0.0;
        let mut pushed = false;
        for segment in hammer {
            pushed |= segment.overlap(from_s, to_s).is_some();
            self.z += segment.gained(self.lambda, from_s, to_s);
            force_n += segment.value_n(to_s);
        }
        // 1e-18 N s rings with 1e-13 N: negligible, and set to zero to avoid denormals.
        if !pushed && self.z.norm_sqr() < 1e-36 {
            self.z = Complex::ZERO;
        }
        force_n + self.gain * (force_n + 2.0 * (self.residue * self.z).re)
    }
}

/// A speckled response point: a raised floor, and intermittent dropouts.
#[derive(Debug, Clone)]
struct Speckle {
    begins: f64,
    ends: f64,
    floor_factor: f64,
    dropout_floor_factor: f64,
    lost: bool,
    stream: Stream,
}

impl Speckle {
    fn new(noise: &config::SpeckleNoise, rate_hz: f64, stream: Stream) -> Self {
        Self {
            begins: noise.dropouts_per_s / rate_hz,
            ends: 1.0 / (noise.dropout_s * rate_hz),
            floor_factor: noise.floor_factor,
            dropout_floor_factor: noise.dropout_floor_factor,
            lost: false,
            stream,
        }
    }

    /// Factors of the signal and of the noise in this scan.
    fn next(&mut self) -> (f64, f64) {
        let chance = if self.lost { self.ends } else { self.begins };
        if uniform(&mut self.stream) < chance {
            self.lost = !self.lost;
        }
        if self.lost { (0.0, self.dropout_floor_factor) } else { (1.0, self.floor_factor) }
    }
}

/// Delays a signal: cubic interpolation through the four samples around the delayed time.
#[derive(Debug, Clone)]
pub(super) struct DelayLine {
    past: Vec<f64>,
    at: usize,
    /// Age of the newest of the four samples used, in scans, and the four weights.
    first: usize,
    weights: [f64; 4],
}

impl DelayLine {
    pub(super) fn new(delay_scans: f64) -> Self {
        // The cubic is most accurate in its middle interval; a delay below one scan has no newer
        // sample than the present one.
        let first = (delay_scans.floor() as usize).saturating_sub(1);
        let d = delay_scans - first as f64;
        let mut weights = [1.0; 4];
        for (i, weight) in weights.iter_mut().enumerate() {
            for j in (0..4).filter(|j| *j != i) {
                *weight *= (d - j as f64) / (i as f64 - j as f64);
            }
        }
        // A power of two, so that the index wraps with a mask instead of a division.
        Self { past: vec![0.0; (first + 4).next_power_of_two()], at: 0, first, weights }
    }

    #[inline]
    pub(super) fn pass(&mut self, value: f64) -> f64 {
        let mask = self.past.len() - 1;
        self.past[self.at & mask] = value;
        let newest = self.at.wrapping_sub(self.first);
        let late = (0..4).map(|i| self.weights[i] * self.past[newest.wrapping_sub(i) & mask]).sum();
        self.at = self.at.wrapping_add(1);
        late
    }
}

/// Rounded to the nearest code of a converter of more than 16 bits, saturating.
fn wide_code(exact: f64, bits: u8) -> i32 {
    let half = f64::from(1_u32 << (bits - 1));
    exact.round().clamp(-half, half - 1.0) as i32
}

/// Rounded to the nearest code of 16 bits, saturating.
#[inline]
pub(super) fn code(exact: f64) -> i16 {
    // At 1.5 · 2^52 the last bit of an f64 is one, so the sum rounds and its low bits are the
    // integer. Unlike a cast, this needs no branch, so the ten channels are vectorised. The
    // comparisons map NaN to the lower limit.
    const ONES_PLACE: f64 = 6_755_399_441_055_744.0;
    let above = if exact > -32768.0 { exact } else { -32768.0 };
    let within = if above < 32767.0 { above } else { 32767.0 };
    (within + ONES_PLACE).to_bits() as i16
}

/// Errors of one fixed sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct FixedFlaw {
    /// Its true position and direction.
    pub probe: Probe,
    /// Ratio of its reading to the true value: 1 without error.
    pub gain: f64,
    /// Delay beyond the declared one and the latency (s).
    pub skew_s: f64,
}

/// The errors for the rig `seed`, in the order of the configuration. [`RigConfig::check`] has
/// verified that the points exist.
fn fixed_flaws(seed: u64, config: &RigConfig) -> Vec<FixedFlaw> {
    let errors = config.errors.acting();
    let one = |own: &FixedSensor| {
        let point = config.responses.iter().find(|point| point.name == own.response)?;
        let sigma_m = if point.body.is_specimen() { errors.specimen_point_m } else { errors.position_m };
        let sigma_m = point.sigma_m.filter(|_| !errors.none).unwrap_or(sigma_m);
        let mut place = stream(seed, &["response position", &point.name]);
        let draw = |what: &str| normal(&mut stream(seed, &[what, &own.name]));
        let stated = errors.volts.get(&own.name).copied().unwrap_or(1.0);
        Some(FixedFlaw {
            probe: Probe {
                body: point.body,
                position_m: shifted(errors.moved(&point.name, point.position_m), sigma_m, &mut place),
                direction: errors.tilted(&own.name, sensitive(own, errors.transverse, seed)),
            },
            gain: stated * (1.0 + errors.gain * draw("gain")),
            skew_s: errors.skew_s * draw("skew"),
        })
    };
    config.sensors.fixed.iter().filter_map(one).collect()
}

/// The direction of a fixed sensor with its drawn sensitivities across it: its reading is the
/// motion along this vector, whose length is not one.
fn sensitive(own: &FixedSensor, transverse: f64, seed: u64) -> [f64; 3] {
    let direction = normalized(own.direction);
    if transverse == 0.0 {
        return direction;
    }
    let mut stream = stream(seed, &["transverse", &own.name]);
    across(direction).into_iter().fold(direction, |sum, across| {
        let part = transverse * normal(&mut stream);
        std::array::from_fn(|axis| sum[axis] + part * across[axis])
    })
}

/// Their channels, in the order of the configuration.
pub(super) fn fixed_channels(config: &RigConfig) -> Vec<Channel> {
    let quantity = |own: &FixedSensor| match own.quantity {
        FixedQuantity::Velocity => Measured::Velocity,
        FixedQuantity::Acceleration => Measured::Acceleration,
    };
    let one = |own: &FixedSensor| Channel {
        name: own.name.clone(),
        quantity: quantity(own),
        unit: quantity(own).unit(),
        units_per_volt: own.units_per_volt,
        range_v: config.sensors.range_v,
        bits: config.sensors.bits,
        delay_s: own.delay_s,
        polarity: own.polarity,
        axis: None,
    };
    config.sensors.fixed.iter().map(one).collect()
}

/// Their output rows, in state coordinates (2n).
#[derive(Debug, Clone, Default)]
pub struct FixedRows {
    /// Row of each; zero where the configuration lacks the body.
    pub rows: Vec<DVector<f64>>,
    /// Size of one converter step of each, in its own unit.
    pub steps: Vec<f64>,
}

/// How much an accelerometer reads per newton of the forces of the same moment (m/s² per N): the
/// hammer's, the shaker's, and that by which a slipping contact differs from its stuck spring. Zero
/// for a vibrometer.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Direct {
    pub hammer: f64,
    pub shaker: f64,
    pub joint: f64,
}

/// Converts the true signals to codes.
#[derive(Debug, Clone)]
pub(super) struct FixedSensors {
    bits: u8,
    own: Vec<One>,
    signals: Vec<f64>,
    stream: Stream,
}

#[derive(Debug, Clone)]
struct One {
    codes_per_unit: f64,
    /// Noise (codes rms).
    noise: f64,
    delay: Option<DelayLine>,
}

impl FixedSensors {
    /// With the cell's idle `stream`; all channels are delayed by `latency_scans`.
    pub(super) fn new(config: &RigConfig, flaws: &[FixedFlaw], latency_scans: u32, stream: Stream) -> Self {
        let rate_hz = f64::from(config.scan_rate_hz);
        let one = |((own, channel), flaw): ((&FixedSensor, Channel), &FixedFlaw)| {
            let late = f64::from(latency_scans) + (own.delay_s + flaw.skew_s) * rate_hz;
            One {
                codes_per_unit: flaw.gain * f64::from(own.polarity) / channel.step(),
                // white up to half the scan rate
                noise: own.floor * (rate_hz / 2.0).sqrt() / channel.step(),
                delay: (late > 0.0).then(|| DelayLine::new(late)),
            }
        };
        let own: Vec<One> =
            config.sensors.fixed.iter().zip(fixed_channels(config)).zip(flaws).map(one).collect();
        Self { bits: config.sensors.bits, signals: vec![0.0; own.len()], own, stream }
    }

    /// A hit begins: the noise stream restarts here.
    pub(super) fn restart(&mut self, stream: Stream) {
        self.stream = stream;
    }

    /// Converts one scan: `read` fills in the true signals; `codes` and `lower` as for
    /// [`Sensors::convert`].
    pub(super) fn convert(&mut self, read: impl FnOnce(&mut [f64]), codes: &mut [i16], lower: &mut [i16]) {
        read(&mut self.signals);
        for (at, own) in self.own.iter_mut().enumerate() {
            let signal = match &mut own.delay {
                Some(line) => line.pass(self.signals[at]),
                None => self.signals[at],
            };
            let exact = signal * own.codes_per_unit + own.noise * normal(&mut self.stream);
            let words = if self.bits > NARROW_BITS {
                split_code(wide_code(exact, self.bits), self.bits)
            } else {
                [code(exact), 0]
            };
            for (words, word) in [&mut *codes, &mut *lower].into_iter().zip(words) {
                if let Some(given) = words.get_mut(at) {
                    *given = word;
                }
            }
        }
    }
}

/// Instrument errors of one campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Flaws {
    /// True positions of the single-point vibrometers.
    pub spots: Spots,
    /// Ratio of each channel's reading to the true value: 1 without error.
    pub gains: [f64; CHANNELS],
    /// Delay of each channel beyond the declared one and the latency below (s); negative if it is
    /// early.
    pub skews_s: [f64; CHANNELS],
    /// Whole scans by which all channels are delayed, so that none precedes its cause.
    pub latency_scans: u32,
    /// Errors of the fixed vibrometers.
    pub fixed: Vec<FixedFlaw>,
    /// Fraction of the force of each load cell (column) that each other one (row) reads; the
    /// diagonal is zero.
    pub cross_talk: [[f64; 3]; 3],
}

impl Flaws {
    /// Errors for the rig `seed`.
    pub(super) fn new(seed: u64, config: &RigConfig, channels: &[Channel; CHANNELS]) -> Self {
        let errors = config.errors.acting();
        let draw = |words: &[&str]| normal(&mut stream(seed, words));
        let gains = std::array::from_fn(|at| {
            let sigma = match at {
                FORCE => errors.hammer_gain,
                _ if is_gauged(at) => errors.gain,
                _ => 0.0,
            };
            let stated = errors.volts.get(&channels[at].name).copied().unwrap_or(1.0);
            stated * (1.0 + sigma * draw(&["gain", &channels[at].name]))
        });
        let skews_s = std::array::from_fn(|at| {
            if at == FORCE { 0.0 } else { errors.skew_s * draw(&["skew", &channels[at].name]) }
        });
        let fixed = fixed_flaws(seed, config);
        let name = |cell: usize| channels[LOAD_CELLS[cell]].name.as_str();
        let cross_talk = std::array::from_fn(|reads: usize| {
            std::array::from_fn(|of: usize| {
                let words = ["cross-talk", name(reads), name(of)];
                if reads == of { 0.0 } else { errors.load_cell_cross_talk * draw(&words) }
            })
        });
        let spot = |name: &str, nominal: &Spot| Spot {
            body: nominal.body,
            position_m: shifted(
                errors.moved(name, nominal.position_m),
                errors.spot_m,
                &mut stream(seed, &["spot position", name]),
            ),
        };
        Self {
            spots: Spots {
                ldv_a: spot("ldv_a", &config.spots.ldv_a),
                ldv_b: spot("ldv_b", &config.spots.ldv_b),
                mark: config.spots.mark.clone(),
            },
            gains,
            skews_s,
            latency_scans: latency_scans(
                skews_s.iter().copied().chain(fixed.iter().map(|own| own.skew_s)),
                f64::from(config.scan_rate_hz),
            ),
            fixed,
            cross_talk,
        }
    }
}

/// One scan more than the earliest channel is early, so that the interpolating cubic has a sample
/// on either side; 0 if no channel is skewed.
fn latency_scans(mut skews_s: impl Iterator<Item = f64> + Clone, rate_hz: f64) -> u32 {
    if skews_s.clone().all(|skew| skew == 0.0) {
        return 0;
    }
    let earliest = skews_s.by_ref().fold(0.0_f64, f64::min);
    1 + (-earliest * rate_hz).ceil() as u32
}

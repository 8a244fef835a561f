//! The sensors: from true signals to converter codes.
//!
//! code = round(volts / range · 32768), saturating, volts = (delayed signal · polarity + noise) /
//! scale. Noise is drawn for every channel in every scan, present or not, so that a channel's
//! stream does not depend on the others. Cross-talk, gain and skew ([`Flaws`]) are applied before
//! the noise.

use super::channels::{CHANNELS, Channel, LOAD_CELLS, VIBROMETER};
use super::config;
use super::config::{Hammer, RigConfig};
use super::converter::DelayLine;
use super::converter::code;
use super::flaws::Flaws;
use super::force::ForceSegment;
use super::hammer::nominal_width_s;
use super::key::{Stream, normal, uniform};
use num_complex::Complex;
use std::f64::consts::PI;

/// Converts the true signals to codes.
#[derive(Debug, Clone)]
pub struct Sensors {
    codes_per_unit: [f64; CHANNELS],
    /// Noise (codes rms) of each channel.
    noise: [f64; CHANNELS],
    delays: Vec<(usize, DelayLine)>,
    cross_talk: Option<[[f64; 3]; 3]>,
    cell: ForceCell,
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
            codes_per_unit,
            noise,
            delays: delays.map(|(at, late)| (at, DelayLine::new(late))).collect(),
            cross_talk: Some(flaws.cross_talk)
                .filter(|parts| parts.as_flattened().iter().any(|part| *part != 0.0)),
            cell: ForceCell::new(&sensors.force, &config.hammer, 1.0 / rate_hz),
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

    /// Converts one scan's true signals.
    #[inline]
    pub fn convert(&mut self, mut signals: [f64; CHANNELS], codes: &mut [i16]) {
        if let Some(parts) = &self.cross_talk {
            let own = LOAD_CELLS.map(|at| signals[at]);
            for (at, parts) in LOAD_CELLS.into_iter().zip(parts) {
                signals[at] += parts.iter().zip(own).map(|(part, force_n)| part * force_n).sum::<f64>();
            }
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

//! Checks whether the structure is quiet before a shot: separates residual motion from white noise.
//!
//! Free on its wire, substructure A rings at about 27 Hz for tens of seconds, and the tail of one
//! hit would spoil the FRF of the next. A vibrometer's own noise is white and, over its full band,
//! larger than a relevant tail. Therefore the velocity is averaged over [`DECIMATE`] scans, the
//! variance of these averages is taken over a window, and the contribution of white noise,
//! estimated from the differences of neighbouring scans, is subtracted:
//!
//! ring² = var(averages) − σ²/32,  σ² = mean(difference²)/2
//!
//! The estimate of the noise variance over n averages scatters by σ²/32·√(2/n). Residual motion
//! below three times that value cannot be distinguished from noise and does not delay a shot
//! indefinitely.

use heapless::Vec;
use jointrig_protocol::limits::CHANNEL_CAPACITY;
#[allow(unused_imports, reason = "core has no square root; where std is linked its own is taken")]
use micromath::F32Ext;

/// Scans per average: at 51.2 kHz, components above about 800 Hz do not count as ringing.
pub const DECIMATE: u16 = 32;

#[derive(Clone, Copy, Debug)]
struct Motion {
    place: usize,
    limit_codes: f32,
    last: f32,
    sum: f32,
    /// The first average of the window, subtracted before squaring so that an offset does not
    /// reduce precision.
    origin: f32,
    averages: f32,
    squares: f32,
    differences: f32,
}

/// Evaluates consecutive windows of scans until one is quiet.
#[derive(Clone, Debug)]
pub struct Quiet {
    motions: Vec<Motion, CHANNEL_CAPACITY>,
    window: u16,
    in_average: u16,
    averages: u16,
    started: bool,
    ratio: f32,
}

impl Quiet {
    /// Monitors the channels whose limit (in codes, rms) is above zero, over windows of `window`
    /// averages. Without such a channel or a window, the structure counts as quiet.
    pub fn new(limits_codes: impl Iterator<Item = f32>, window: u16) -> Self {
        let motions = limits_codes
            .take(CHANNEL_CAPACITY)
            .enumerate()
            .filter(|(_, limit)| *limit > 0.0)
            .map(|(place, limit_codes)| Motion {
                place,
                limit_codes,
                last: 0.0,
                sum: 0.0,
                origin: 0.0,
                averages: 0.0,
                squares: 0.0,
                differences: 0.0,
            })
            .collect();
        Self { motions, window, in_average: 0, averages: 0, started: false, ratio: 0.0 }
    }

    /// Whether any channel is monitored.
    pub fn watches(&self) -> bool {
        self.window > 1 && !self.motions.is_empty()
    }

    /// The largest ratio of residual motion to its limit in the last complete window.
    pub fn ratio(&self) -> f32 {
        self.ratio
    }

    /// Adds one scan. At the end of each window, returns whether it was quiet.
    pub fn feed(&mut self, code: &impl Fn(usize) -> i16) -> Option<bool> {
        for motion in &mut self.motions {
            let value = f32::from(code(motion.place));
            if self.started {
                let difference = value - motion.last;
                motion.differences += difference * difference;
            }
            motion.last = value;
            motion.sum += value;
        }
        self.started = true;
        self.in_average += 1;
        if self.in_average < DECIMATE {
            return None;
        }
        self.in_average = 0;
        for motion in &mut self.motions {
            let average = motion.sum / f32::from(DECIMATE);
            motion.sum = 0.0;
            if self.averages == 0 {
                motion.origin = average;
            }
            let deviation = average - motion.origin;
            motion.averages += deviation;
            motion.squares += deviation * deviation;
        }
        self.averages += 1;
        if self.averages < self.window {
            return None;
        }
        Some(self.judge())
    }

    fn judge(&mut self) -> bool {
        let n = f32::from(self.window);
        let scans = n * f32::from(DECIMATE);
        self.ratio = 0.0;
        for motion in &mut self.motions {
            let mean = motion.averages / n;
            let variance = (motion.squares / n - mean * mean).max(0.0);
            let noise = motion.differences / (2.0 * scans) / f32::from(DECIMATE);
            let ring = (variance - noise).max(0.0);
            let allowed = motion.limit_codes * motion.limit_codes + 3.0 * noise * (2.0 / n).sqrt();
            self.ratio = self.ratio.max((ring / allowed).sqrt());
            motion.averages = 0.0;
            motion.squares = 0.0;
            motion.differences = 0.0;
        }
        self.averages = 0;
        self.ratio <= 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ringing of a given amplitude with white noise of a given standard deviation, both in codes.
    fn verdict(amplitude: f32, noise: f32, limit: f32) -> (bool, f32) {
        let mut quiet = Quiet::new([limit].into_iter(), 256);
        let mut state = 12_345_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f32 / 16_777_216.0 - 0.5
        };
        for i in 0.. {
            // the sum of twelve uniform random numbers has variance one
            let white: f32 = (0..12).map(|_| uniform()).sum();
            let phase = (core::f64::consts::TAU * 27.3 * f64::from(i) / 51_200.0) as f32;
            let code = (300.0 + amplitude * phase.sin() + noise * white).round() as i16;
            if let Some(calm) = quiet.feed(&|_| code) {
                return (calm, quiet.ratio());
            }
        }
        unreachable!("every window ends")
    }

    #[test]
    fn noise_alone_is_quiet_whatever_its_level() {
        for noise in [0.0, 1.0, 5.0, 50.0] {
            assert!(verdict(0.0, noise, 0.5).0, "noise {noise}");
        }
    }

    #[test]
    fn ringing_is_seen_under_noise_eight_times_its_size() {
        // amplitude 3 codes is 2.1 rms, four times the limit; the noise's averages scatter by 5/√32
        // = 0.9
        let (calm, ratio) = verdict(3.0, 5.0, 0.5);
        assert!(!calm && ratio > 2.0, "{ratio}");
        assert!(verdict(0.5, 5.0, 0.5).0);
    }

    #[test]
    fn nothing_to_watch_is_known_beforehand() {
        assert!(!Quiet::new([0.0, 0.0].into_iter(), 256).watches());
        assert!(!Quiet::new([1.0].into_iter(), 0).watches());
    }
}

//! Decimation by two: a half-band filter with eleven taps, for a front end that runs at twice the
//! output rate.
//!
//! No firmware image uses it: docs/front-end.md describes its benefit and its cost. The benchmark
//! measures it, so that the figure there is a measured one.
//!
//! The taps are `[3, 0, −25, 0, 150, 256, 150, 0, −25, 0, 3] / 512`, the maximally flat half-band
//! filter of this length. With s = sin(ω/2) and c = cos(ω/2), where ω = 2π at the input rate, its
//! response is c⁶ (1 + 3 s² + 6 s⁴) with a delay of five input samples. Integer arithmetic is
//! exact; only the result is rounded.

/// Channels in a scan.
pub const CHANNELS: usize = 16;
/// Input scans used for one output scan.
pub const TAPS: usize = 11;
/// Input scans in a block: twice the number of output scans.
pub const INPUT: usize = 30;
/// Nonzero taps on either side of the middle tap, from the inside outwards.
const SIDES: [i32; 3] = [150, -25, 3];
/// The middle tap.
const MIDDLE: i32 = 256;
/// Binary scaling of the taps: they are in units of 2⁻⁹.
const SHIFT: u32 = 9;

/// One scan.
pub type Scan = [i16; CHANNELS];

/// The filter state of all channels.
#[derive(Clone, Debug)]
pub struct HalfBand {
    /// The last scans of the previous block, followed by the current block.
    scans: [Scan; TAPS - 1 + INPUT],
}

impl Default for HalfBand {
    fn default() -> Self {
        Self::new()
    }
}

impl HalfBand {
    /// The state after an input of zeros.
    #[must_use]
    pub const fn new() -> Self {
        Self { scans: [[0; CHANNELS]; TAPS - 1 + INPUT] }
    }

    /// Filters a block. Output n is centred in the window of eleven scans that ends with scan 2 n
    /// of the block. Results beyond 16 bits saturate.
    pub fn block(&mut self, input: &[Scan; INPUT], output: &mut [Scan; INPUT / 2]) {
        self.scans.copy_within(INPUT.., 0);
        self.scans[TAPS - 1..].copy_from_slice(input);
        for (number, out) in output.iter_mut().enumerate() {
            let Some(window) = self.scans[2 * number..].first_chunk::<TAPS>() else { return };
            for (channel, code) in out.iter_mut().enumerate() {
                let at = |place: usize| i32::from(window[place][channel]);
                let sides =
                    SIDES[0] * (at(4) + at(6)) + SIDES[1] * (at(2) + at(8)) + SIDES[2] * (at(0) + at(10));
                let sum = MIDDLE * at(5) + sides + (1 << (SHIFT - 1));
                *code = (sum >> SHIFT).clamp(i16::MIN.into(), i16::MAX.into()) as i16;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use std::f64::consts::PI;
    use std::vec::Vec;

    use super::*;

    const RATE_HZ: f64 = 102_400.0;

    /// All taps, scaled to unit gain.
    fn taps() -> [f64; TAPS] {
        let mut taps = [0.0; TAPS];
        taps[5] = f64::from(MIDDLE);
        for (i, tap) in SIDES.into_iter().enumerate() {
            (taps[4 - 2 * i], taps[6 + 2 * i]) = (f64::from(tap), f64::from(tap));
        }
        taps.map(|tap| tap / f64::from(1 << SHIFT))
    }

    /// Frequency response of the taps; real, because they are symmetric about the middle tap.
    fn response(frequency_hz: f64) -> f64 {
        let turn = 2.0 * PI * frequency_hz / RATE_HZ;
        taps().iter().enumerate().map(|(i, tap)| tap * ((i as f64 - 5.0) * turn).cos()).sum()
    }

    fn closed_form(frequency_hz: f64) -> f64 {
        let (s, c) = (PI * frequency_hz / RATE_HZ).sin_cos();
        c.powi(6) * (1.0 + 3.0 * s.powi(2) + 6.0 * s.powi(4))
    }

    fn decibels(ratio: f64) -> f64 {
        20.0 * ratio.abs().log10()
    }

    #[test]
    fn the_response_is_the_closed_form_flat_below_5_khz_and_78_db_down_where_that_aliases() {
        for step in 0..=1024 {
            let frequency_hz = f64::from(step) * 50.0;
            assert!((response(frequency_hz) - closed_form(frequency_hz)).abs() < 1e-12, "{frequency_hz} Hz");
            // the responses of the two half bands add up to one
            assert!((response(frequency_hz) + response(RATE_HZ / 2.0 - frequency_hz) - 1.0).abs() < 1e-12);
        }
        for step in 0..=500 {
            let frequency_hz = f64::from(step) * 10.0;
            assert!(decibels(response(frequency_hz)).abs() < 0.0012, "{frequency_hz} Hz");
            assert!(
                decibels(response(RATE_HZ / 2.0 - frequency_hz)) < -77.5,
                "what aliases to {frequency_hz} Hz"
            );
        }
    }

    /// Filters a signal that is applied to all channels, divided by (1 + channel).
    fn filtered(signal: impl Fn(usize) -> f64, blocks: usize) -> Vec<Scan> {
        let mut filter = HalfBand::new();
        let mut out = Vec::new();
        for block in 0..blocks {
            let scan = |i: usize| {
                let value = signal(block * INPUT + i);
                core::array::from_fn(|channel| (value / (1 + channel) as f64).round() as i16)
            };
            let mut results = [[0; CHANNELS]; INPUT / 2];
            filter.block(&core::array::from_fn(scan), &mut results);
            out.extend(results);
        }
        out
    }

    #[test]
    fn a_sine_comes_out_five_samples_later_and_nothing_of_it_where_it_would_alias() {
        for frequency_hz in [200.0, 1_000.0, 5_000.0] {
            let sine = |i: f64| 20_000.0 * (2.0 * PI * frequency_hz / RATE_HZ * i).sin();
            let out = filtered(|i| sine(i as f64), 20);
            for (number, scan) in out.iter().enumerate().skip(TAPS) {
                // the window of result n ends with sample 2 n
                let due = sine(2.0 * number as f64 - 5.0);
                for (channel, code) in scan.iter().enumerate() {
                    let off = f64::from(*code) - due / (1 + channel) as f64;
                    // one code for rounding at the input, half a code at the output, and 1.2e-4 of
                    // the sine
                    assert!(off.abs() < 1.2 + 2.5, "{frequency_hz} Hz: {off}");
                }
            }
        }
        let alias = |i: usize| 32_000.0 * (2.0 * PI * 47_000.0 / RATE_HZ * i as f64).cos();
        let out = filtered(alias, 20);
        let largest = out.iter().skip(TAPS).flatten().map(|code| code.unsigned_abs()).max();
        assert!(largest <= Some(4), "32000 codes at 47 kHz leave {largest:?}");
    }

    #[test]
    fn blocks_make_no_seam_and_ends_saturate() {
        let noise = |i: usize| f64::from((i as u32).wrapping_mul(2_654_435_761) >> 17) - 16_384.0;
        let out = filtered(noise, 6);
        for (number, scan) in out.iter().enumerate().skip(TAPS) {
            let exact: f64 = taps().iter().enumerate().map(|(i, tap)| tap * noise(2 * number + i - 10)).sum();
            assert!((f64::from(scan[0]) - exact).abs() <= 0.5 + 1e-9, "result {number}");
        }
        // a step from one end of the range to the other overshoots
        let edge = filtered(|i| if i < 40 { -32_768.0 } else { 32_767.0 }, 4);
        assert!(edge.iter().any(|scan| scan[0] == i16::MAX) && edge.iter().any(|scan| scan[0] == i16::MIN));
    }
}

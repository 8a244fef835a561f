//! A record together with its window: transforms apply the weights while reading the samples.

use super::window::{RUN, ResponseWeighting};

/// A record times its window, followed by zeros.
#[derive(Clone, Copy)]
pub struct Windowed<'a> {
    samples: &'a [f64],
    weighting: Option<&'a ResponseWeighting<'a>>,
}

/// Weights of a record without a window.
static ONES: [f64; RUN] = [1.0; RUN];

impl<'a> Windowed<'a> {
    /// A record without a window.
    pub fn plain(samples: &'a [f64]) -> Self {
        Windowed { samples, weighting: None }
    }

    /// A response, SI, with its window.
    pub fn response(samples: &'a [f64], weighting: &'a ResponseWeighting<'a>) -> Self {
        Windowed { samples, weighting: Some(weighting) }
    }

    /// Writes the windowed samples from `first` on into `out`.
    pub(super) fn write(self, first: usize, out: &mut [f64]) {
        if let Some(weighting) = self.weighting {
            return weighting.response_into(self.samples, first, out);
        }
        let kept = self.samples.len().saturating_sub(first).min(out.len());
        let (out, beyond) = out.split_at_mut(kept);
        out.copy_from_slice(self.samples.get(first..first + kept).unwrap_or_default());
        beyond.fill(0.0);
    }

    /// The samples without their weights.
    pub(super) fn samples(self) -> &'a [f64] {
        self.samples
    }

    /// Weights that are common to all runs of the window.
    pub(super) fn places(self) -> &'a [f64] {
        self.weighting.map_or(&ONES, ResponseWeighting::places)
    }

    /// The weights of `count` samples (up to [`RUN`]) from `first` on: a factor, and the index from
    /// which on it multiplies the [places](Windowed::places). `None` if the samples cannot be
    /// weighted uniformly.
    pub(super) fn weights(self, first: usize, count: usize) -> Option<(f64, usize)> {
        if first + count > self.samples.len() {
            return None;
        }
        self.weighting.map_or(Some((1.0, 0)), |weighting| weighting.weights(first))
    }
}

#[cfg(test)]
mod tests {
    use super::super::window::Windowing;
    use super::*;

    #[test]
    fn weights_are_what_is_written() {
        let record: Vec<f64> = (0..3000).map(|i| f64::from(i) + 1.0).collect();
        let window = Windowing { sigma_per_s: 4.0, ..Windowing::default() };
        let decay = window.decay(1000.0, record.len());
        let weighting = window.of_response(&decay, 0.1);
        for record in [Windowed::plain(&record), Windowed::response(&record, &weighting)] {
            for first in [0, 1, 511, 512, 1000, 3000 - RUN] {
                let mut written = [f64::NAN; RUN];
                record.write(first, &mut written);
                let (scale, place) = record.weights(first, RUN).expect("of one kind");
                let places = &record.places()[place..][..RUN];
                for (i, (written, place)) in written.iter().zip(places).enumerate() {
                    let exact = record.samples()[first + i] * (scale * place);
                    // rounding of the weights, which after the end of a run are computed from
                    // different products
                    assert!((written - exact).abs() < 1e-14 * exact, "{}: {written} for {exact}", first + i);
                }
            }
            assert_eq!(record.weights(3000 - RUN + 1, RUN), None);
            let mut beyond = [f64::NAN; 4];
            record.write(2998, &mut beyond);
            assert!(beyond[..2].iter().all(|x| *x != 0.0) && beyond[2..] == [0.0; 2], "{beyond:?}");
            record.write(4000, &mut beyond);
            assert_eq!(beyond, [0.0; 4]);
        }
    }
}

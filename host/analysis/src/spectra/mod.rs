//! Spectra: from impact records to FRFs with coherence and variance.
//!
//! [`pulse`] finds the hit, [`window`] cuts and weights, [`average`] accumulates S_ff, S_xf and
//! S_xx one hit at a time, [`cross_spectra`] stores them and gives FRFs with their scatter by
//! its estimators and the jackknife. [`estimate`](mod@estimate) performs all of this for a set of
//! records, [`odd_hit`](mod@odd_hit) identifies a hit that disagrees with the others, and
//! [`usable_band`] finds the band that the hammer excited. Whether a hit is good
//! is decided elsewhere, from the raw records: the force window hides a second pulse that the
//! response retains.

pub mod average;
pub mod cross_spectra;
pub mod estimate;
pub(crate) mod fft;
pub mod odd_hit;
pub mod pulse;
pub mod window;

pub use crate::frf::MotionQuantity;
pub use average::SpectraAverage;
pub use cross_spectra::CrossSpectra;
pub use estimate::ImpactRecords;
pub use estimate::usable_band;
pub use estimate::{FrfSettings, Origin, Summing, estimate};
pub use odd_hit::{Fit, OddHit, odd_hit};
pub use pulse::{Pulse, reversed_peak_n, several_hits_s};
pub use window::{ForceWeighting, PulseSamples, Windowing};

/// Reasons why records cannot be converted to FRFs.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpectraError {
    /// No hit to average.
    #[error("no hits to average: all were refused, or none were recorded")]
    NoHits,
    /// A hit differs in length from the first.
    #[error("a record has {found} samples, the others {expected}: all records must have the same length")]
    Samples {
        /// Samples found.
        found: usize,
        /// Samples expected.
        expected: usize,
    },
    /// A hit has a different number of responses.
    #[error("a hit has {found} responses, the others {expected}")]
    Responses {
        /// Responses found.
        found: usize,
        /// Responses expected.
        expected: usize,
    },
    /// A value is NaN or infinite.
    #[error("sample {sample} is not a number: refuse the hit")]
    NotFinite {
        /// Index of the first such sample.
        sample: usize,
    },
    /// A hit has no pulse.
    #[error("hit {hit} has no force pulse: refuse it, or give the windows a fixed origin")]
    NoPulse {
        /// Index of the hit.
        hit: usize,
    },
    /// The transform is shorter than the records.
    #[error(
        "a transform of {transform} samples is shorter than the records of {samples}: choose a longer one; the records are padded with zeros"
    )]
    Padding {
        /// Requested length.
        transform: usize,
        /// Length of the records.
        samples: usize,
    },
    /// Spectra that do not match and cannot be added or combined.
    #[error("the spectra differ in their lines, window or responses, so they cannot be combined")]
    Unlike,
    /// The transform failed (unsupported length).
    #[error("Fourier transform: {0}")]
    Transform(String),
}

#[cfg(test)]
mod exactness_tests;

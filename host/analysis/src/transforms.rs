//! FFT plans, kept for each recurring length, because computing a plan's factors takes longer than
//! a transform.

use realfft::{RealFftPlanner, RealToComplex};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

static PLANNER: LazyLock<Mutex<RealFftPlanner<f64>>> = LazyLock::new(|| Mutex::new(RealFftPlanner::new()));

/// The transform of records of `samples` samples. Plans are never discarded, so it is meant for a
/// small number of lengths.
pub(crate) fn forward(samples: usize) -> Arc<dyn RealToComplex<f64>> {
    // the planner is valid even after a poisoned lock
    PLANNER.lock().unwrap_or_else(PoisonError::into_inner).plan_fft_forward(samples)
}

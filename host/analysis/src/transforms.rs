//! Plans of transforms, made once for each length that comes again and again: a plan's factors take longer than a transform.

use realfft::{RealFftPlanner, RealToComplex};
use std::sync::{Arc, LazyLock, Mutex, PoisonError};

static PLANNER: LazyLock<Mutex<RealFftPlanner<f64>>> = LazyLock::new(|| Mutex::new(RealFftPlanner::new()));

/// The transform of records of `samples` samples. Plans are kept: it is for lengths of which there are few.
pub(crate) fn forward(samples: usize) -> Arc<dyn RealToComplex<f64>> {
    // a planner is whole even if a thread that used it panicked
    PLANNER.lock().unwrap_or_else(PoisonError::into_inner).plan_fft_forward(samples)
}

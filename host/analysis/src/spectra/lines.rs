//! Destinations for the lines of a transform.

use super::order::Order;
use crate::vectors::wide;
use num_complex::Complex;
use std::ops::Range;

type C = Complex<f64>;

/// Receives the lines of a transform.
pub(super) trait Lines {
    /// Takes lines of a stretch, by their index in its piece, with one value each; called in a loop
    /// compiled for the processor in use.
    fn take(&mut self, stretch: usize, within: Range<usize>, values: impl Iterator<Item = C>);
}

/// Writes lines in their order.
pub(super) struct Put<'a> {
    pub(super) order: &'a Order,
    pub(super) out: &'a mut [C],
}

impl Lines for Put<'_> {
    #[inline]
    fn take(&mut self, stretch: usize, within: Range<usize>, values: impl Iterator<Item = C>) {
        let own = &mut self.out[self.order.places(stretch, &within)];
        wide(|| own.iter_mut().zip(values).for_each(|(own, value)| *own = value));
    }
}

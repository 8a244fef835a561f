//! Reusable memory for temporary matrices.

use super::number::LaneCell;
use pulp::{NullaryFnOnce, Simd};
use std::cell::RefCell;

/// Provides matrices with cells that are reused: allocating them each time takes as long as some of
/// the products.
pub(crate) struct Pool<S: Simd> {
    pub(crate) simd: S,
    free: RefCell<Vec<Vec<LaneCell<S>>>>,
}

impl<S: Simd> Pool<S> {
    pub(crate) fn new(simd: S) -> Self {
        Pool { simd, free: RefCell::default() }
    }

    /// `count` cells with arbitrary values.
    pub(super) fn cells(&self, count: usize) -> Vec<LaneCell<S>> {
        let mut cells = self.free.borrow_mut().pop().unwrap_or_default();
        if cells.len() < count {
            self.simd.vectorize(Longer { simd: self.simd, cells: &mut cells, count });
        }
        cells.truncate(count);
        cells
    }

    /// Returns cells for reuse.
    pub(super) fn back(&self, cells: Vec<LaneCell<S>>) {
        self.free.borrow_mut().push(cells);
    }
}

struct Longer<'a, S: Simd> {
    simd: S,
    cells: &'a mut Vec<LaneCell<S>>,
    count: usize,
}

impl<S: Simd> NullaryFnOnce for Longer<'_, S> {
    type Output = ();

    #[expect(clippy::inline_always, reason = "must be inlined to use the processor's vectors")]
    #[inline(always)]
    fn call(self) {
        self.cells.resize(self.count, LaneCell::all(self.simd, 0.0));
    }
}

//! FFT scratch buffers, reused because fresh memory costs as much as a transform's first pass over
//! it.

use num_complex::Complex;
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

type C = Complex<f64>;

/// Idle buffers, the most recently returned last.
static IDLE: Mutex<Vec<Vec<C>>> = Mutex::new(Vec::new());

/// Largest total size of idle buffers, complex numbers: 32 MB.
const KEPT_AT_MOST: usize = 1 << 21;

/// A buffer that returns to the pool when dropped. Its initial contents are arbitrary.
pub(super) struct Lent(Vec<C>);

impl Lent {
    /// A buffer of `count` numbers.
    pub(super) fn of(count: usize) -> Lent {
        // the list is valid even after a poisoned lock
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        let place = idle.iter().rposition(|piece| piece.len() == count);
        let piece = place.map(|place| idle.remove(place));
        drop(idle);
        Lent(piece.unwrap_or_else(|| vec![C::default(); count]))
    }

    /// A buffer of `count` zeros.
    pub(super) fn zeros(count: usize) -> Lent {
        let mut own = Lent::of(count);
        own.fill(C::default());
        own
    }
}

impl Drop for Lent {
    fn drop(&mut self) {
        let own = std::mem::take(&mut self.0);
        if own.is_empty() {
            return;
        }
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        idle.push(own);
        // drop the oldest first: their length may not be needed again
        while idle.iter().map(Vec::len).sum::<usize>() > KEPT_AT_MOST {
            idle.remove(0);
        }
    }
}

impl Deref for Lent {
    type Target = [C];

    fn deref(&self) -> &[C] {
        &self.0
    }
}

impl DerefMut for Lent {
    fn deref_mut(&mut self) -> &mut [C] {
        &mut self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_lent_again_and_only_so_much_of_it_kept() {
        let quarter = KEPT_AT_MOST / 4;
        drop((0..9).map(|i| Lent::of(quarter + i)).collect::<Vec<_>>());
        assert!(IDLE.lock().expect("whole").iter().map(Vec::len).sum::<usize>() <= KEPT_AT_MOST);
        let piece = Lent::of(quarter + 100);
        let place = piece.as_ptr();
        drop(piece);
        let lengths: Vec<usize> = IDLE.lock().expect("whole").iter().map(Vec::len).collect();
        assert!(lengths.contains(&(quarter + 100)), "{lengths:?}");
        let again = Lent::of(quarter + 100);
        assert_eq!((again.len(), again.as_ptr()), (quarter + 100, place));
        assert_eq!(Lent::of(0).len(), 0);
    }
}

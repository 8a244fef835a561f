//! Memory of transforms, lent again and again: fresh memory costs as much as a transform's first pass over it.

use num_complex::Complex;
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

type C = Complex<f64>;

/// What nobody uses, the last given back at the end.
static IDLE: Mutex<Vec<Vec<C>>> = Mutex::new(Vec::new());

/// Idle numbers kept at most: 32 MB.
const KEPT_AT_MOST: usize = 1 << 21;

/// Memory that is given back when it is no longer used. It holds other values before.
pub(super) struct Lent(Vec<C>);

impl Lent {
    /// So many numbers.
    pub(super) fn of(count: usize) -> Lent {
        // the list is whole even if a thread that used it panicked
        let mut idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner);
        let place = idle.iter().rposition(|piece| piece.len() == count);
        let piece = place.map(|place| idle.remove(place));
        drop(idle);
        Lent(piece.unwrap_or_else(|| vec![C::default(); count]))
    }

    /// So many zeros.
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
        // the oldest first: their length may not come again
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

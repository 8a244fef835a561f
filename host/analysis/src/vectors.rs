//! Loops over long rows, with the widest vectors that the processor at hand has.
//!
//! What is shipped runs on every x86-64 and every aarch64, so that the compiler may use two numbers at a time; most machines
//! have four. Which a loop gets is found out when it runs. Each number is computed by the same operations either way: results are equal to the
//! last bit.

use pulp::{Arch, NullaryFnOnce};

/// Does `work`, a loop that is inlined with all that it calls, compiled for this processor. A closure of more than a few lines is not
/// inlined: that takes a type with a `call` that always is.
#[inline]
pub(crate) fn wide<T>(work: impl NullaryFnOnce<Output = T>) -> T {
    Arch::new().dispatch(work)
}

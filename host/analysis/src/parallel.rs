//! Loops over lines, hits and outputs: on all cores with the feature `rayon`, sequentially without
//! it.
//!
//! Only maps run in parallel; sums are formed in order afterwards, so results are bit-identical
//! either way.

#[cfg(feature = "rayon")]
pub(crate) use rayon::{current_num_threads as threads, join, prelude};
#[cfg(not(feature = "rayon"))]
pub(crate) use serial::{join, prelude, threads};

/// The same names, implemented without threads.
#[cfg(not(feature = "rayon"))]
mod serial {
    pub(crate) fn threads() -> usize {
        1
    }

    pub(crate) fn join<A, B>(first: impl FnOnce() -> A, second: impl FnOnce() -> B) -> (A, B) {
        (first(), second())
    }

    pub(crate) mod prelude {
        pub(crate) trait IntoSerial: IntoIterator + Sized {
            fn into_par_iter(self) -> Self::IntoIter {
                self.into_iter()
            }
        }

        impl<I: IntoIterator> IntoSerial for I {}

        pub(crate) trait SerialRef {
            fn par_iter<'a>(&'a self) -> <&'a Self as IntoIterator>::IntoIter
            where
                &'a Self: IntoIterator,
            {
                self.into_iter()
            }
        }

        impl<T: ?Sized> SerialRef for T {}

        pub(crate) trait SerialSlice<T> {
            fn par_chunks(&self, size: usize) -> std::slice::Chunks<'_, T>;
            fn par_chunks_mut(&mut self, size: usize) -> std::slice::ChunksMut<'_, T>;
            fn par_iter_mut(&mut self) -> std::slice::IterMut<'_, T>;
        }

        impl<T> SerialSlice<T> for [T] {
            fn par_chunks(&self, size: usize) -> std::slice::Chunks<'_, T> {
                self.chunks(size)
            }

            fn par_chunks_mut(&mut self, size: usize) -> std::slice::ChunksMut<'_, T> {
                self.chunks_mut(size)
            }

            fn par_iter_mut(&mut self) -> std::slice::IterMut<'_, T> {
                self.iter_mut()
            }
        }

        pub(crate) trait Shares: Iterator + Sized {
            /// Without threads the minimum chunk size has no effect.
            fn with_min_len(self, _items: usize) -> Self {
                self
            }
        }

        impl<I: Iterator> Shares for I {}
    }
}

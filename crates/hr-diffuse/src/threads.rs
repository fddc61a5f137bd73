//! Work for many threads, or for one: with the feature `parallel` rayon's iterators, without it those of the standard
//! library under the same names. For extensions, too.

#[cfg(feature = "parallel")]
pub use rayon::{current_num_threads, join, prelude};

/// Threads that work: one.
#[cfg(not(feature = "parallel"))]
#[must_use]
pub fn current_num_threads() -> usize {
    1
}

/// Does one thing and then the other.
#[cfg(not(feature = "parallel"))]
pub fn join<A, B>(a: impl FnOnce() -> A, b: impl FnOnce() -> B) -> (A, B) {
    (a(), b())
}

/// What stands in for rayon's traits.
#[cfg(not(feature = "parallel"))]
pub mod prelude {
    /// Iterators by value.
    pub trait IntoParallelIterator: IntoIterator + Sized {
        /// All in order.
        fn into_par_iter(self) -> Self::IntoIter {
            self.into_iter()
        }
    }

    impl<I: IntoIterator> IntoParallelIterator for I {}

    /// What rayon's iterators do beside.
    pub trait ParallelIterator: Iterator + Sized {
        /// There is nothing to divide.
        #[must_use]
        fn with_min_len(self, _: usize) -> Self {
            self
        }
    }

    impl<I: Iterator> ParallelIterator for I {}

    /// Iterators by reference, and sorting.
    pub trait ParallelSlice<T> {
        /// All in order.
        fn par_iter(&self) -> std::slice::Iter<'_, T>;
        /// All in order.
        fn par_iter_mut(&mut self) -> std::slice::IterMut<'_, T>;
        /// Sorts; what is equal may change places.
        fn par_sort_unstable(&mut self)
        where
            T: Ord;
        /// Sorts by a key; what is equal may change places.
        fn par_sort_unstable_by_key<K: Ord>(&mut self, key: impl FnMut(&T) -> K);
    }

    impl<T> ParallelSlice<T> for [T] {
        fn par_iter(&self) -> std::slice::Iter<'_, T> {
            self.iter()
        }
        fn par_iter_mut(&mut self) -> std::slice::IterMut<'_, T> {
            self.iter_mut()
        }
        fn par_sort_unstable(&mut self)
        where
            T: Ord,
        {
            self.sort_unstable();
        }
        fn par_sort_unstable_by_key<K: Ord>(&mut self, key: impl FnMut(&T) -> K) {
            self.sort_unstable_by_key(key);
        }
    }

    /// Collections that grow.
    pub trait ParallelExtend<T>: Extend<T> {
        /// Appends all in order.
        fn par_extend(&mut self, items: impl IntoIterator<Item = T>) {
            self.extend(items);
        }
    }

    impl<T> ParallelExtend<T> for Vec<T> {}
}

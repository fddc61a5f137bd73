//! Work for many threads, or for one: with the feature `parallel` those of rayon's pool, without it the one that asks. Answers are
//! in order, whatever the number of threads. For extensions, too.
//!
//! Closures pass to the pool as `dyn`, a run of items at a time, so that what divides work is compiled once, not once for each place
//! and extension: with rayon's iterators that was a third of what a solver for another [`LightField`](crate::LightField) took to build.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

#[cfg(feature = "parallel")]
pub use rayon::{current_num_threads, join};

/// Most runs that work is divided into: so many that threads end together though some items take longer than others.
const MOST_RUNS: usize = 256;

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

/// `of` each item, in order; no fewer than `together` of them at a time.
pub fn map<T: Sync, R: Send>(items: &[T], together: usize, of: impl Fn(&T) -> R + Sync) -> Vec<R> {
    map_range(0..items.len(), together, |i| of(&items[i]))
}

/// `of` each number in a range, in order; no fewer than `together` of them at a time.
pub fn map_range<R: Send>(range: Range<usize>, together: usize, of: impl Fn(usize) -> R + Sync) -> Vec<R> {
    let length = run_length(range.len(), together);
    let part = |run: usize| range.start + run * length..range.end.min(range.start + (run + 1) * length);
    if range.len() <= length || current_num_threads() == 1 {
        return range.map(of).collect();
    }
    let runs: Vec<Mutex<Vec<R>>> = range.clone().step_by(length).map(|_| Mutex::default()).collect();
    share(runs.len(), &|run| {
        let done = part(run).map(&of).collect();
        *runs[run].lock().unwrap_or_else(PoisonError::into_inner) = done;
    });
    let mut all = Vec::with_capacity(range.len());
    runs.into_iter().for_each(|run| all.append(&mut run.into_inner().unwrap_or_else(PoisonError::into_inner)));
    all
}

/// `of` each item, which it may change, and its index, in order; no fewer than `together` of them at a time. What is as long as
/// there are links is made this way, in its place.
pub fn map_mut<T: Send, R: Send>(items: &mut [T], together: usize, of: impl Fn(usize, &mut T) -> R + Sync) -> Vec<R> {
    let length = run_length(items.len(), together);
    let of_run = |run: usize, items: &mut [T]| {
        items.iter_mut().enumerate().map(|(i, item)| of(run * length + i, item)).collect::<Vec<R>>()
    };
    if items.len() <= length || current_num_threads() == 1 {
        return of_run(0, items);
    }
    let count = items.len();
    let runs: Vec<_> = items.chunks_mut(length).map(|run| Mutex::new((run, Vec::new()))).collect();
    share(runs.len(), &|run| {
        let (items, done) = &mut *runs[run].lock().unwrap_or_else(PoisonError::into_inner);
        *done = of_run(run, items);
    });
    let mut all = Vec::with_capacity(count);
    runs.into_iter().for_each(|run| all.append(&mut run.into_inner().unwrap_or_else(PoisonError::into_inner).1));
    all
}

/// Sorts; what is equal may change places.
pub fn sort_unstable<T: Ord + Send>(items: &mut [T]) {
    #[cfg(feature = "parallel")]
    rayon::slice::ParallelSliceMut::par_sort_unstable(items);
    #[cfg(not(feature = "parallel"))]
    items.sort_unstable();
}

/// Sorts by a key; what is equal may change places.
pub fn sort_unstable_by_key<T: Send, K: Ord>(items: &mut [T], key: impl Fn(&T) -> K + Sync) {
    #[cfg(feature = "parallel")]
    rayon::slice::ParallelSliceMut::par_sort_unstable_by_key(items, key);
    #[cfg(not(feature = "parallel"))]
    items.sort_unstable_by_key(key);
}

/// Items per run.
fn run_length(count: usize, together: usize) -> usize {
    together.max(count.div_ceil(MOST_RUNS)).max(1)
}

/// Does all runs, on whichever threads there are.
#[cfg(feature = "parallel")]
fn share(runs: usize, work: &(dyn Fn(usize) + Sync)) {
    use rayon::iter::{IntoParallelIterator, ParallelIterator};
    (0..runs).into_par_iter().for_each(work);
}

/// Does all runs.
#[cfg(not(feature = "parallel"))]
fn share(runs: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..runs).for_each(work);
}

#[cfg(test)]
mod tests {
    use super::{MOST_RUNS, map, map_mut, map_range, sort_unstable};

    #[test]
    fn answers_are_in_order() {
        for count in [0, 1, 2, 63, 64, 65, 3 * MOST_RUNS + 1, 100_000] {
            let expected: Vec<usize> = (5..5 + count).map(|i| i * i).collect();
            assert_eq!(map_range(5..5 + count, 64, |i| i * i), expected, "{count} numbers");
            assert_eq!(map(&expected, 1, |&square| square), expected, "{count} items");
            let mut changed = vec![1; count];
            let seen = map_mut(&mut changed, 7, |i, item| {
                *item += (5 + i).pow(2);
                i
            });
            assert_eq!(seen, Vec::from_iter(0..count), "indices of {count} items");
            assert!(
                changed.iter().zip(&expected).all(|(changed, square)| *changed == square + 1),
                "{count} changed items"
            );
            changed.reverse();
            sort_unstable(&mut changed);
            assert!(changed.is_sorted(), "{count} sorted items");
        }
    }
}

//! Work shared by the threads of rayon's pool; without the feature `parallel`, by the caller alone.
//!
//! The caller takes part at once. A thread outside the pool that calls `rayon::join` hands all work over and sleeps,
//! and two pool threads must wake up first: 400 us of work then took 535 us on two cores, and 330 us this way.

use std::marker::PhantomData;
use std::mem::MaybeUninit;
use std::sync::atomic::{AtomicUsize, Ordering};

use threads::run_workers;
pub(crate) use threads::{alone, available_threads, both};

#[cfg(feature = "parallel")]
mod threads {
    use std::cell::Cell;

    thread_local! {
        static IS_ALONE: Cell<bool> = const { Cell::new(false) };
    }

    /// Does work on the caller's thread alone. Who holds a lock must not share work: a thread that waits for others may be given
    /// work that asks for the same lock, and so may the others.
    pub(crate) fn alone<T>(work: impl FnOnce() -> T) -> T {
        struct Reset(bool);
        impl Drop for Reset {
            fn drop(&mut self) {
                IS_ALONE.set(self.0);
            }
        }
        let _reset = Reset(IS_ALONE.replace(true));
        work()
    }

    /// Returns how many threads can work on one call, the caller included.
    pub(crate) fn available_threads() -> usize {
        if IS_ALONE.get() { 1 } else { rayon::current_num_threads() }
    }

    pub(super) fn run_workers(workers: usize, take_pieces: impl Fn(usize) + Sync) {
        rayon::in_place_scope(|scope| {
            let take_pieces = &take_pieces;
            (1..workers).for_each(|worker| scope.spawn(move |_| take_pieces(worker)));
            take_pieces(0);
        });
    }

    /// Does two works at once, if a thread is free for the first.
    pub(crate) fn both(first: impl FnOnce() + Send, second: impl FnOnce()) {
        if available_threads() == 1 {
            first();
            return second();
        }
        rayon::in_place_scope(|scope| {
            scope.spawn(|_| first());
            second();
        });
    }
}

/// The caller alone.
#[cfg(not(feature = "parallel"))]
mod threads {
    pub(crate) fn alone<T>(work: impl FnOnce() -> T) -> T {
        work()
    }

    pub(crate) fn available_threads() -> usize {
        1
    }

    pub(super) fn run_workers(_: usize, take_pieces: impl Fn(usize) + Sync) {
        take_pieces(0);
    }

    pub(crate) fn both(first: impl FnOnce(), second: impl FnOnce()) {
        first();
        second();
    }
}

/// Returns the number of threads that can work on `pieces` pieces. A single piece does not wake, or make, a pool of threads.
pub fn threads_for(pieces: usize) -> usize {
    if pieces < 2 { 1 } else { available_threads() }
}

/// Runs `work(worker, piece)` once for each `piece < pieces`, on at most `workers` threads.
///
/// Two calls with the same `worker` never overlap in time. A panic in `work` reaches the caller after the other
/// threads have ended.
pub fn run(workers: usize, pieces: usize, work: impl Fn(usize, usize) + Sync) {
    let workers = workers.min(pieces);
    if workers <= 1 {
        return (0..pieces).for_each(|piece| work(0, piece));
    }
    let next = AtomicUsize::new(0);
    let take_pieces = |worker: usize| {
        loop {
            let piece = next.fetch_add(1, Ordering::Relaxed);
            if piece >= pieces {
                return;
            }
            work(worker, piece);
        }
    };
    run_workers(workers, take_pieces);
}

/// Returns the part of `0..len` that belongs to `piece` of `pieces` equal ones.
pub(crate) fn piece_range(len: usize, piece: usize, pieces: usize) -> std::ops::Range<usize> {
    len * piece / pieces..len * (piece + 1) / pieces
}

/// A slice whose elements several threads write, each element one thread only. It is borrowed as long as any of them has it.
pub struct SharedSlice<'a, T> {
    start: *mut T,
    len: usize,
    slice: PhantomData<&'a mut [T]>,
}

impl<T> Clone for SharedSlice<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for SharedSlice<'_, T> {}

// SAFETY: the methods' contracts leave each element to one thread at a time.
unsafe impl<T: Send> Send for SharedSlice<'_, T> {}
// SAFETY: as above.
unsafe impl<T: Send> Sync for SharedSlice<'_, T> {}

impl<'a, T> SharedSlice<'a, T> {
    /// Borrows a slice.
    pub fn new(slice: &'a mut [T]) -> Self {
        Self { start: slice.as_mut_ptr(), len: slice.len(), slice: PhantomData }
    }

    /// Writes an element over a value that needs no drop.
    ///
    /// # Safety
    /// `i` is inside the slice, and no other thread uses element `i`.
    #[inline(always)]
    pub unsafe fn write(self, i: usize, value: T) {
        debug_assert!(i < self.len);
        // SAFETY: the caller's promise.
        unsafe { self.start.add(i).write(value) }
    }

    /// Borrows a part of the slice.
    ///
    /// # Safety
    /// `range` is inside the slice, and nobody else uses these elements while the part lives.
    #[inline(always)]
    pub unsafe fn part(self, range: std::ops::Range<usize>) -> &'a mut [T] {
        debug_assert!(range.start <= range.end && range.end <= self.len);
        // SAFETY: the caller's promise.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(range.start), range.end - range.start) }
    }
}

/// Runs `work(own, piece)` once for each `piece < pieces`, on at most as many threads as there are `own` values: each thread
/// has one of them.
pub(crate) fn run_with<T: Send>(own: &mut [T], pieces: usize, work: impl Fn(&mut T, usize) + Sync) {
    let (threads, shared) = (own.len(), SharedSlice::new(own));
    assert!(threads > 0 || pieces == 0, "each thread has a value, and one works at least");
    run(threads, pieces, |worker, piece| {
        // SAFETY: a worker has one piece at a time, and there are as many values as workers.
        work(unsafe { &mut shared.part(worker..worker + 1)[0] }, piece);
    });
}

/// Runs `work(piece, part)` once for each part of a split list, on at most `workers` threads.
pub(crate) fn run_parts<P: Send>(
    workers: usize,
    parts: impl IntoIterator<Item = P>,
    work: impl Fn(usize, P) + Sync,
) {
    // Without a size, so the list takes no memory.
    run_parts_with(&mut vec![(); workers], parts, |(), piece, part| work(piece, part));
}

/// As [`run_parts`]. Each thread has an `own` value, so there are at most as many threads as values.
pub(crate) fn run_parts_with<T: Send, P: Send>(
    own: &mut [T],
    parts: impl IntoIterator<Item = P>,
    work: impl Fn(&mut T, usize, P) + Sync,
) {
    if let [own] = own {
        return parts.into_iter().enumerate().for_each(|(piece, part)| work(own, piece, part));
    }
    let mut parts: Vec<Option<P>> = parts.into_iter().map(Some).collect();
    let (pieces, shared) = (parts.len(), SharedSlice::new(&mut parts));
    run_with(own, pieces, |own, piece| {
        // SAFETY: each piece has a place of its own.
        if let Some(part) = unsafe { shared.part(piece..piece + 1)[0].take() } {
            work(own, piece, part);
        }
    });
}

/// Splits a list into parts of these lengths, one behind the other.
pub(crate) fn split_into<T>(
    mut list: &mut [T],
    lens: impl IntoIterator<Item = usize>,
) -> impl Iterator<Item = &mut [T]> {
    lens.into_iter().map(move |len| list.split_off_mut(..len).expect("parts lie in the list"))
}

pub(crate) fn split_evenly<T>(list: &mut [T], pieces: usize) -> impl Iterator<Item = &mut [T]> {
    let len = list.len();
    split_into(list, (0..pieces).map(move |piece| piece_range(len, piece, pieces).len()))
}

/// Returns `work(piece)` for each `piece < pieces`, in order.
pub fn map<T: Send>(pieces: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let mut results: Vec<Option<T>> = std::iter::repeat_with(|| None).take(pieces).collect();
    run_parts(threads_for(pieces), &mut results, |piece, result| *result = Some(work(piece)));
    results.into_iter().flatten().collect()
}

/// Maximum number of spare elements of a scratch buffer: an eighth of ten million would be a tenth of all memory.
const MAX_SPARE: usize = 1 << 17;

/// Makes `buffer` at least `len` elements long. Its old content is scratch and is not copied.
pub(crate) fn ensure_scratch<T: Copy>(buffer: &mut Vec<T>, len: usize, fill: T) {
    if buffer.capacity() < len {
        empty_room(buffer, len);
    }
    if buffer.len() < len {
        buffer.resize(buffer.capacity(), fill);
    }
}

/// Empties a buffer, and returns room in it for `len` elements.
pub(crate) fn empty_room<T: Copy>(buffer: &mut Vec<T>, len: usize) -> &mut [MaybeUninit<T>] {
    buffer.clear();
    if buffer.capacity() < len {
        buffer.shrink_to(0);
        buffer.reserve_exact(len + (len / 8).min(MAX_SPARE) + 1024);
    }
    &mut buffer.spare_capacity_mut()[..len]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_a_list_are_handed_out_once_each_on_any_number_of_threads() {
        for workers in [1, 2, 5] {
            for pieces in [0, 1, 3, 40] {
                let mut list: Vec<usize> = (0..100).collect();
                let (lens, mut own) = ((0..pieces).map(|piece| piece % 4), vec![0; workers]);
                let used = lens.clone().sum::<usize>();
                run_parts_with(&mut own, split_into(&mut list, lens), |own, piece, part| {
                    assert_eq!(part.len(), piece % 4);
                    *own += part.len();
                    part.iter_mut().for_each(|number| *number += 1000);
                });
                assert_eq!(own.iter().sum::<usize>(), used);
                assert!(
                    list.iter().enumerate().all(|(i, number)| *number == i + 1000 * usize::from(i < used))
                );
                let parts = split_evenly(&mut list, pieces).map(|part| part.len());
                assert_eq!(parts.sum::<usize>(), if pieces == 0 { 0 } else { 100 });
            }
        }
        assert_eq!(split_evenly::<u8>(&mut [], 3).map(|part| part.len()).collect::<Vec<_>>(), [0; 3]);
    }

    #[test]
    fn a_scratch_buffer_has_an_eighth_to_spare_and_a_large_one_less() {
        for (len, most) in [(80_000, 92_000), (10_000_000, 10_140_000)] {
            let mut buffer = Vec::new();
            ensure_scratch(&mut buffer, len, 0u8);
            assert!(buffer.len() > len + len / 100 && buffer.len() < most, "{}", buffer.len());
        }
    }
}

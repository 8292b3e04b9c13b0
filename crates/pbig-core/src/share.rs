//! Work in pieces that threads share, the caller among them.
//!
//! A thread that is none of the pool's, as an app's is, hands everything over where it calls `rayon::join` or a parallel
//! iterator: it sleeps, and two others have to wake. Between the steps of a simulation they are asleep, and twice 200 us of
//! work then took 535 us on two cores. Here the caller begins at once, and who wakes takes of what is left: 330 us. In the end
//! the caller waits for those that were asked, also where other work of the pool keeps them: a pool is for short work.

use rayon::in_place_scope;
use std::sync::{Mutex, PoisonError};

/// Whether there is another thread to share work with.
pub(crate) fn has_threads() -> bool {
    rayon::current_num_threads() > 1
}

/// Does all pieces, in no particular order; with the other threads of the pool if `is_shared`.
#[inline(always)]
pub(crate) fn for_each<T: Send>(
    is_shared: bool,
    pieces: impl ExactSizeIterator<Item = T> + Send,
    work: impl Fn(T) + Sync,
) {
    if !is_shared {
        return pieces.for_each(work);
    }
    let others = pieces.len().saturating_sub(1);
    with(others, || (), pieces, work);
}

/// The same, and the sum of what comes of the pieces.
#[inline(always)]
pub(crate) fn sum<T: Send, S: Default + Send>(
    is_shared: bool,
    pieces: impl ExactSizeIterator<Item = T> + Send,
    work: impl Fn(T) -> S + Sync,
    add: impl Fn(S, S) -> S + Sync,
) -> S {
    if !is_shared {
        return pieces.map(work).fold(S::default(), add);
    }
    let total = Mutex::new(S::default());
    for_each(true, pieces, |piece| {
        let part = work(piece);
        let mut total = total.lock().unwrap_or_else(PoisonError::into_inner);
        *total = add(std::mem::take(&mut total), part);
    });
    total.into_inner().unwrap_or_else(PoisonError::into_inner)
}

/// Does something, and the pieces of something else: the caller begins with the one, other threads with the pieces.
#[inline(always)]
pub(crate) fn beside<T: Send, U>(
    is_shared: bool,
    own: impl FnOnce() -> U,
    pieces: impl ExactSizeIterator<Item = T> + Send,
    work: impl Fn(T) + Sync,
) -> U {
    if !is_shared {
        let done = own();
        pieces.for_each(work);
        return done;
    }
    with(pieces.len(), own, pieces, work)
}

/// As [`beside`], with at most so many other threads.
fn with<T: Send, U>(
    most: usize,
    own: impl FnOnce() -> U,
    pieces: impl Iterator<Item = T> + Send,
    work: impl Fn(T) + Sync,
) -> U {
    let others = most.min(rayon::current_num_threads() - 1);
    let pieces = Mutex::new(pieces);
    let next = || pieces.lock().unwrap_or_else(PoisonError::into_inner).next();
    let help = || {
        while let Some(piece) = next() {
            work(piece);
        }
    };
    in_place_scope(|scope| {
        (0..others).for_each(|_| scope.spawn(|_| help()));
        let done = own();
        help();
        done
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::ThreadPoolBuilder;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicU32, Ordering};

    fn on_pools(work: impl Fn(bool) + Sync) {
        [false, true].into_iter().for_each(&work);
        for threads in [1, 2, 5] {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| work(true));
        }
    }

    #[test]
    fn every_piece_is_done_once_and_all_count() {
        on_pools(|is_shared| {
            for count in [0, 1, 2, 3, 1000] {
                let mut done = vec![0; count];
                let pieces = done.iter_mut().enumerate();
                let work = |(i, done): (usize, &mut u32)| {
                    *done += 1;
                    i
                };
                assert_eq!(sum(is_shared, pieces, work, |a, b| a + b), count * count.saturating_sub(1) / 2);
                assert!(done.iter().all(|&times| times == 1), "{count}");
            }
        });
    }

    #[test]
    fn another_thread_begins_with_the_pieces_while_the_caller_does_something_else() {
        let pool = ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
        let both = Barrier::new(2);
        let meet = || both.wait().is_leader();
        pool.install(|| beside(true, meet, 0..1, |_| _ = meet()));
    }

    #[test]
    fn what_panics_in_a_piece_reaches_the_caller_after_the_others_have_ended() {
        on_pools(|is_shared| {
            let begun = AtomicU32::new(0);
            let work = |i: u32| {
                begun.fetch_add(1, Ordering::Relaxed);
                assert!(i != 3, "the third");
            };
            assert!(catch_unwind(AssertUnwindSafe(|| for_each(is_shared, 0..8, work))).is_err());
            assert!(begun.into_inner() >= 4);
            let own = || -> u32 { panic!("the caller's own work") };
            assert!(catch_unwind(|| beside(is_shared, own, 0..8, |_| ())).is_err());
        });
    }

    #[test]
    fn a_panic_of_the_caller_comes_after_the_pieces_that_have_begun_have_ended() {
        let pool = ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
        let (both, ended) = (Barrier::new(2), AtomicU32::new(0));
        let own = || -> u32 {
            both.wait();
            panic!("the piece is under way")
        };
        let piece = |()| {
            both.wait();
            std::thread::sleep(std::time::Duration::from_millis(50));
            ended.fetch_add(1, Ordering::Relaxed);
        };
        let shared = || beside(true, own, std::iter::once(()), piece);
        assert!(pool.install(|| catch_unwind(AssertUnwindSafe(shared))).is_err());
        assert_eq!(ended.into_inner(), 1);
    }
}

//! An allocator that counts the memory that each thread requests and frees. Tests install it with `#[global_allocator]`. Without that
//! all counts are 0.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The system's allocator, with sums for each thread, because tests run side by side.
pub struct Counting;

thread_local! {
    static HELD: Cell<i64> = const { Cell::new(0) };
    static PEAK: Cell<i64> = const { Cell::new(0) };
    static LARGEST: Cell<usize> = const { Cell::new(0) };
    static REQUESTS: Cell<u64> = const { Cell::new(0) };
}

/// Counts bytes that are asked for and bytes that are given back.
fn count(asked: usize, returned: usize) {
    // Where a thread ends its sums may be gone before the last block is.
    _ = HELD.try_with(|held| held.set(held.get() + asked as i64 - returned as i64));
    _ = HELD.try_with(|held| PEAK.try_with(|peak| peak.set(peak.get().max(held.get()))));
    _ = LARGEST.try_with(|largest| largest.set(largest.get().max(asked)));
    _ = REQUESTS.try_with(|requests| requests.set(requests.get() + u64::from(asked > 0)));
}

// SAFETY: all is left to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size(), 0);
        // SAFETY: the caller's promise.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, old: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size, layout.size());
        // SAFETY: the caller's promise.
        unsafe { System.realloc(old, layout, size) }
    }

    unsafe fn dealloc(&self, old: *mut u8, layout: Layout) {
        count(0, layout.size());
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(old, layout) }
    }
}

/// Returns the bytes that this thread has requested, less those that it has freed.
pub fn held() -> i64 {
    HELD.get()
}

/// Returns the most bytes that this thread has held since the last call.
pub fn peak() -> i64 {
    PEAK.replace(held()).max(held())
}

/// Returns the largest block that this thread has requested since the last call.
pub fn largest() -> usize {
    LARGEST.replace(0)
}

/// Returns the number of requests for memory that this thread has made.
pub fn requests() -> u64 {
    REQUESTS.get()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[global_allocator]
    static COUNTING: Counting = Counting;

    #[test]
    fn what_is_held_is_counted() {
        let (before, asked) = (held(), requests());
        let mut some = std::hint::black_box(vec![1u8; 1000]);
        assert_eq!(held() - before, 1000);
        some.reserve_exact(3000);
        assert_eq!(held() - before, 4000);
        largest();
        assert!(std::hint::black_box(vec![0u8; 5000]).len() == 5000 && largest() == 5000 && largest() < 5000);
        drop(some);
        assert_eq!((held(), peak() - before), (before, 9000));
        assert_eq!(peak(), before);
        // A vector, its growth and another vector; what is given back does not count.
        assert_eq!(requests() - asked, 3);
    }
}

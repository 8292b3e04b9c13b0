//! Pairs without a list: each is handed to a closure where it is found.

use super::{Finder, Sets};
use crate::search::Request;
use crate::{Boxes, CrossPair, Error, Pair};

impl Finder {
    /// Calls `visit` once for every pair of overlapping boxes, in any order, on each thread that finds some. Returns the number of
    /// pairs.
    ///
    /// There is no list, so memory does not grow with the pairs, and [`crate::Limits::max_pairs`] does not apply: each thread
    /// gathers a few thousand pairs before it hands them over. The CPU does the work; no device is asked. A panic in `visit`
    /// reaches the caller when the other threads have ended; the finder stays usable.
    ///
    /// ```
    /// use pbig_core::{Aabb, Finder};
    /// use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
    /// let boxes = [[0.0; 3], [0.5; 3], [0.9; 3]].map(|center| Aabb::from_center(center, [0.5; 3]));
    /// let neighbours = [const { AtomicU32::new(0) }; 3];
    /// let pairs = Finder::default().for_each_pair(&boxes, |pair| {
    ///     neighbours[pair.a as usize].fetch_add(1, Relaxed);
    ///     neighbours[pair.b as usize].fetch_add(1, Relaxed);
    /// })?;
    /// assert_eq!((pairs, neighbours.map(AtomicU32::into_inner)), (3, [2; 3]));
    /// # Ok::<(), pbig_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::TooManyBoxes`], [`Error::FilterCount`] and [`Error::KeyCount`], before any call.
    pub fn for_each_pair<'a>(
        &mut self,
        boxes: impl Into<Boxes<'a>>,
        visit: impl Fn(Pair) + Sync,
    ) -> Result<u64, Error> {
        let all = boxes.into();
        self.begin(&[all])?;
        self.note_no_device();
        let receiver = |pairs: &[Pair]| pairs.iter().for_each(|pair| visit(*pair));
        let config = self.config;
        self.search(&Request { receiver: Some(&receiver), ..Request::of_one(&all, &config) })?;
        self.report.pairs = self.all_pairs.count();
        Ok(self.report.pairs)
    }

    /// Calls `visit` once for every pair of a box of `a` with a box of `b` that overlap, as [`Finder::for_each_pair`] does for one
    /// set. See [`Finder::find_between`] for the sets. Returns the number of pairs.
    ///
    /// # Errors
    /// The errors of [`Finder::for_each_pair`].
    pub fn for_each_pair_between<'a>(
        &mut self,
        a: impl Into<Boxes<'a>>,
        b: impl Into<Boxes<'a>>,
        visit: impl Fn(CrossPair) + Sync,
    ) -> Result<u64, Error> {
        let each = |pairs: &[Pair], sets: &Sets| pairs.iter().for_each(|pair| visit(sets.named(pair)));
        self.search_between(&a.into(), &b.into(), Some(&each))?;
        Ok(self.report.pairs)
    }
}

//! Pairs of a box of one set with a box of another one.

use super::{Finder, Sets};
use crate::pairs::Grouping;
use crate::parallel::{run_parts, threads_for};
use crate::report::{Clock, stage};
use crate::search::{Receiver, Request};
use crate::{Boxes, CrossPair, Error, Order, Pair};

/// Pairs whose ids a thread looks up at a time.
const PIECE: usize = 1 << 16;

impl Finder {
    /// Returns every pair of a box of `a` with a box of `b` that overlap: `CrossPair { a: i, b: j }` for `a[i]` and `b[j]`, in
    /// the order that [`crate::Config::order`] says.
    ///
    /// Boxes of one set are never compared with each other, so a set may be a crowd. Its boxes that miss all of the other set cost
    /// a copy and a comparison or two; a few among many are sorted. [`Boxes`] add filters and keys. The CPU does the work; no device is asked.
    ///
    /// ```
    /// use pbig_core::{Aabb, CrossPair, Finder};
    /// let at = |x: f32| Aabb::from_center([x, 0.0, 0.0], [0.5; 3]);
    /// let (a, b) = ([at(0.0), at(5.0), at(5.0)], [at(9.0), at(5.5)]);
    /// let mut finder = Finder::default();
    /// assert_eq!(finder.find_between(&a, &b)?, [CrossPair { a: 1, b: 1 }, CrossPair { a: 2, b: 1 }]);
    /// # Ok::<(), pbig_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::TooManyBoxes`] and [`Error::TooManyPairs`] (see [`crate::Limits`], which count both sets together),
    /// [`Error::FilterCount`] and [`Error::KeyCount`].
    pub fn find_between<'a>(
        &mut self,
        a: impl Into<Boxes<'a>>,
        b: impl Into<Boxes<'a>>,
    ) -> Result<&[CrossPair], Error> {
        self.pairs_between.clear();
        self.search_between(&a.into(), &b.into(), None)?;
        Ok(self.pairs_between())
    }

    /// Returns the pairs of the last call of [`Finder::find_between`]; none if it failed.
    pub fn pairs_between(&self) -> &[CrossPair] {
        bytemuck::cast_slice(&self.pairs_between)
    }

    /// Returns the list of the last call of [`Finder::find_between`], without a copy.
    ///
    /// ```
    /// use pbig_core::{Aabb, CrossPair, Finder};
    /// let boxes = [Aabb::new([0.0; 3], [1.0; 3])];
    /// let mut finder = Finder::default();
    /// finder.find_between(&boxes, &boxes)?;
    /// assert_eq!(finder.into_pairs_between(), [CrossPair { a: 0, b: 0 }]);
    /// # Ok::<(), pbig_core::Error>(())
    /// ```
    pub fn into_pairs_between(mut self) -> Vec<CrossPair> {
        self.pairs_between.shrink_to_fit();
        bytemuck::cast_vec(self.pairs_between)
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

    /// Finds the pairs of two sets, for a receiver or as a list.
    fn search_between(
        &mut self,
        a: &Boxes<'_>,
        b: &Boxes<'_>,
        visit: Option<Visit<'_>>,
    ) -> Result<(), Error> {
        self.begin(&[*a, *b])?;
        self.note_no_device();
        let mut clock = Clock::start();
        self.sets.take([a, b]);
        self.report.stages.plan = clock.lap();
        let is_sorted = self.config.order == Order::Sorted && visit.is_none();
        let sets = &self.sets;
        let [first, second] = sets.boxes([a, b]);
        let grouping = is_sorted.then(|| Grouping::new(first.len()));
        let hand_over = visit.map(|visit| move |pairs: &[Pair]| visit(pairs, sets));
        let receiver = hand_over.as_ref().map(|hand_over| hand_over as Receiver<'_>);
        let request = Request {
            others: Some(second),
            filters: sets.filters([a, b]),
            keys: sets.keys([a, b]),
            receiver,
            grouping,
            ..Request::of_one(&Boxes::new(first), &self.config)
        };
        let done = self.all_pairs.find(&request, &mut self.store, &mut self.report);
        self.count_invalid();
        self.report.invalid -= self.sets.dropped;
        done?;
        self.report.pairs = self.all_pairs.count();
        if visit.is_none() {
            // The pairs of the last search of one set stay.
            std::mem::swap(&mut self.pairs, &mut self.pairs_between);
            self.emit(grouping);
            std::mem::swap(&mut self.pairs, &mut self.pairs_between);
            self.name_ids();
        }
        Ok(())
    }

    fn name_ids(&mut self) {
        let sets = &self.sets;
        let pieces = self.pairs_between.len().div_ceil(PIECE);
        let name = |_, pairs: &mut [Pair]| {
            for pair in pairs {
                let CrossPair { a, b } = sets.named(pair);
                *pair = Pair { a, b };
            }
        };
        let parts = self.pairs_between.chunks_mut(PIECE);
        stage!(self.report, emit, run_parts(threads_for(pieces), parts, name));
    }
}

/// Receiver of pairs of a search, and of the sets that name them.
type Visit<'a> = &'a (dyn Fn(&[Pair], &Sets) + Sync);

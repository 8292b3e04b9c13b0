//! Queries of a broad phase: its boxes, its pairs, and the report of the last update.

use super::{BroadPhase, Events};
use crate::report::Report;
use crate::search::grid::occupied_cells;
use crate::{Aabb, Algorithm, BoxIndex, Config, OccupiedCell, Pair, ProxyFilter};

impl BroadPhase {
    /// Returns the settings in force.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Returns the events of the last update.
    pub fn events(&self) -> &Events {
        &self.events
    }

    /// Returns the report on the last update.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Returns the number of boxes that were set and not removed, invalid ones included.
    pub fn len(&self) -> usize {
        self.world.present.len()
    }

    /// Returns true if there is no box.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns one more than the largest id that was set since the last [`BroadPhase::clear`]. [`BroadPhase::shrink_to_fit`] may lower it.
    pub fn id_count(&self) -> u32 {
        self.world.ids() as u32
    }

    /// Returns true if a box was set and not removed, valid or not.
    pub fn contains(&self, id: u32) -> bool {
        self.world.contains(id)
    }

    /// Returns the stored (fat) box and the filter, if there is one and it is valid.
    pub fn get(&self, id: u32) -> Option<(Aabb, ProxyFilter)> {
        Some((self.fat_aabb(id)?, *self.filter(id)?))
    }

    /// Returns the filter of a box.
    pub fn filter(&self, id: u32) -> Option<&ProxyFilter> {
        self.world.filters.get(id as usize).filter(|_| self.contains(id))
    }

    /// Returns the stored (fat) box, if there is one and it is valid.
    pub fn fat_aabb(&self, id: u32) -> Option<Aabb> {
        self.world.boxes.get(id as usize).copied().filter(Aabb::is_valid)
    }

    /// Returns all stored (fat) boxes by id; [`Aabb::NOWHERE`] where there is none or an invalid one.
    pub fn fat_aabbs(&self) -> &[Aabb] {
        &self.world.boxes
    }

    /// Returns the ids of changed boxes: stored anew, given another filter, inserted or removed since the last update. In the
    /// order of their first change.
    pub fn changes(&self) -> &[u32] {
        &self.world.changed
    }

    /// Returns the number of pairs: those of the last update, less those of boxes removed since. After a removal, and until
    /// the next update, it looks at all pairs.
    pub fn pair_count(&self) -> usize {
        if self.world.has_removed() { self.pairs().count() } else { self.kept.len() }
    }

    /// Yields the pairs that exist (see [`BroadPhase::pair_count`]), sorted.
    pub fn pairs(&self) -> impl Iterator<Item = Pair> {
        self.kept.iter().filter(|pair| self.exists(pair))
    }

    /// Yields the pairs of one box (see [`BroadPhase::pair_count`]), sorted by the other one. The first call after a
    /// search looks at all pairs, later calls at the pairs of the box.
    pub fn pairs_of(&self, id: u32) -> impl Iterator<Item = Pair> {
        self.kept.partners(id).map(move |other| Pair::new(id, other)).filter(|pair| self.exists(pair))
    }

    /// Returns the number of pairs of a box (see [`BroadPhase::pair_count`]). After a removal, and until the next update, it
    /// looks at all pairs of the box.
    pub fn degree(&self, id: u32) -> u32 {
        if self.world.has_removed() { self.pairs_of(id).count() as u32 } else { self.kept.degree(id) }
    }

    /// Returns true if two boxes are a pair (see [`BroadPhase::pair_count`]).
    pub fn has_pair(&self, pair: Pair) -> bool {
        self.kept.contains(pair) && self.exists(&pair)
    }

    fn exists(&self, pair: &Pair) -> bool {
        !self.world.was_removed(pair.a) && !self.world.was_removed(pair.b)
    }

    /// Returns the tree of all stored (fat) boxes as they are now, for scene queries. The first call after a change brings it up to
    /// date, while other threads that ask wait. The very first sorts the boxes, on the calling thread: about 150 ns a box.
    ///
    /// ```
    /// use pbig_core::{Aabb, BroadPhase, ProxyFilter};
    /// let mut broad_phase = BroadPhase::default();
    /// broad_phase.set(7, Aabb::new([2.0, -1.0, -1.0], [4.0, 1.0, 1.0]), ProxyFilter::ALL)?;
    /// let mut met = vec![];
    /// let origin = Aabb::new([0.0; 3], [0.0; 3]);
    /// broad_phase.index().cast_aabb(&origin, [1.0, 0.0, 0.0], 100.0, |id| {
    ///     met.push(id);
    ///     100.0
    /// });
    /// assert_eq!(met, [7]);
    /// # Ok::<(), pbig_core::Error>(())
    /// ```
    #[inline(always)]
    pub fn index(&self) -> &BoxIndex {
        self.world.tree.get(&self.world)
    }

    /// Returns the occupied cells of a grid like that of the last update with changes, or the leaves of its tree, for pictures. There
    /// are none if it needed neither. Takes time and memory as a search.
    pub fn cells(&self) -> Vec<OccupiedCell> {
        match self.last {
            Algorithm::Grid => occupied_cells(&self.world.boxes),
            Algorithm::Tree | Algorithm::LookUp => self.index().occupied_leaves(),
            _ => Vec::new(),
        }
    }

    /// Returns the ids of all stored (fat) boxes that overlap a box, in no particular order. Filters are ignored.
    ///
    /// ```
    /// use pbig_core::{Aabb, BroadPhase, ProxyFilter};
    /// let mut broad_phase = BroadPhase::default();
    /// broad_phase.set(7, Aabb::new([0.0; 3], [1.0; 3]), ProxyFilter::ALL)?;
    /// let found = broad_phase.overlapping(&Aabb::new([1.0; 3], [2.0; 3]));
    /// assert_eq!(found, [7]);
    /// # Ok::<(), pbig_core::Error>(())
    /// ```
    pub fn overlapping(&self, aabb: &Aabb) -> Vec<u32> {
        let mut ids = Vec::new();
        self.index().overlapping(aabb, |id| ids.push(id));
        ids
    }
}

//! Questions to a broad phase: its boxes, its pairs, and the report of the last update.

use super::{BroadPhase, Events};
use crate::holder::Holder;
use crate::report::Report;
use crate::{Aabb, Config, OccupiedCell, Pair, ProxyFilter};

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
    /// rebuild looks at all pairs, later calls at the pairs of the box.
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

    /// Returns the occupied cells of the grid, or the leaves of the tree, for pictures. There are none if the last update needed
    /// neither or ran on a GPU. Takes time and memory in proportion to the cells.
    pub fn cells(&self) -> Vec<OccupiedCell> {
        match self.holder {
            Holder::Grid => self.store.grid.occupied_cells(),
            Holder::Tree => self.store.tree.occupied_leaves(),
            Holder::Nothing | Holder::Lanes => Vec::new(),
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
        if !aabb.is_valid() {
            return ids;
        }
        if self.overlapping_in_grid(aabb, &mut |id| ids.push(id)) {
            return ids;
        }
        let overlaps = |(_, stored): &(usize, &Aabb)| aabb.overlaps(stored);
        ids.extend(self.world.boxes.iter().enumerate().filter(overlaps).map(|(id, _)| id as u32));
        ids
    }

    /// Answers [`BroadPhase::overlapping`] from the grid. Returns false, and finds nothing, if there is no grid of all boxes: the
    /// last update used none, or boxes have changed since.
    pub fn overlapping_in_grid(&self, aabb: &Aabb, found: &mut dyn FnMut(u32)) -> bool {
        let has_grid = self.holder == Holder::Grid && self.world.changed.is_empty();
        if has_grid && aabb.is_valid() {
            self.store.grid.overlapping(aabb, found);
        }
        has_grid
    }
}

//! What a broad phase knows: boxes, pairs, and what the last update did.

use super::{BroadPhase, Events, flag};
use crate::plan::OccupiedCell;
use crate::report::Report;
use crate::{Aabb, Pair, ProxyFilter};

impl BroadPhase {
    /// The events of the last update.
    pub fn events(&self) -> &Events {
        &self.events
    }

    /// What the last update did.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// How many pairs exist: those of the last update, less those of boxes removed since.
    pub fn pair_count(&self) -> usize {
        if self.pairs.is_whole() {
            self.pairs.listed() + self.near.list.overlapping()
        } else {
            self.pairs().count()
        }
    }

    /// The pairs that exist (see [`BroadPhase::pair_count`]), in no particular order.
    pub fn pairs(&self) -> impl Iterator<Item = Pair> {
        let near = self.near.list.iter().filter(|pair| self.pairs.is_there(*pair));
        self.pairs.iter().chain(near)
    }

    /// The pairs of one box (see [`BroadPhase::pair_count`]), in no particular order. While most boxes change in every
    /// update, and until few have for long, all pairs are looked at.
    pub fn pairs_of(&self, id: u32) -> impl Iterator<Item = Pair> {
        let near = Some(&self.near.list).filter(|_| self.pairs.counted(id) > 0);
        let near = near.into_iter().flat_map(move |list| list.of(id));
        self.pairs.of(id).chain(near.filter(|pair| self.pairs.is_there(*pair)))
    }

    /// How many pairs a box has (see [`BroadPhase::pair_count`]).
    pub fn degree(&self, id: u32) -> u32 {
        if self.pairs.is_whole() { self.pairs.counted(id) } else { self.pairs_of(id).count() as u32 }
    }

    /// Whether two boxes are a pair (see [`BroadPhase::pair_count`]).
    pub fn has_pair(&self, pair: Pair) -> bool {
        let fewer = if self.degree(pair.b) < self.degree(pair.a) { pair.b } else { pair.a };
        self.pairs_of(fewer).any(|one| one == pair)
    }

    /// One more than the largest id that was ever set.
    pub fn id_count(&self) -> u32 {
        self.boxes.len() as u32
    }

    /// Whether a box was set and not removed, valid or not.
    pub fn contains(&self, id: u32) -> bool {
        self.flags.get(id as usize).is_some_and(|flags| flags & flag::PRESENT != 0)
    }

    /// Ids of boxes that the next update will look at: set beyond their margin, given another filter,
    /// or removed since the last one.
    pub fn changes(&self) -> impl Iterator<Item = u32> {
        self.changed.iter().copied()
    }

    /// The filter of a box.
    pub fn filter(&self, id: u32) -> Option<&ProxyFilter> {
        self.filters.get(id as usize).filter(|_| self.contains(id))
    }

    /// The cells of the CPU's grids that boxes lie in (while near pairs do the work, boxes grown by the skin), level by
    /// level, for a picture of them; none where the boxes are searched without grids or on a GPU. Takes time and memory
    /// proportional to the boxes.
    pub fn cells(&self) -> Vec<OccupiedCell> {
        let mut cells = Vec::new();
        if self.has_base || self.near.is_on {
            self.base.map.cells(&mut cells);
        }
        cells
    }

    /// The stored (fat) box, if there is one and it is valid.
    pub fn fat_aabb(&self, id: u32) -> Option<Aabb> {
        self.boxes.get(id as usize).copied().filter(Aabb::is_valid)
    }
}

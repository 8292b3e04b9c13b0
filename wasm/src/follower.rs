//! A caller of `BroadPhase` that keeps the pairs by its events and compares them with the oracle.

use crate::Fault;
use crate::corpus::difference;
use pbig_core::{Aabb, BroadPhase, Config, Pair, ProxyFilter, oracle};

/// A broad phase with the boxes that were set in it and the pairs that its events lead to.
pub(crate) struct Follower {
    broad_phase: BroadPhase,
    /// By id; none for an absent box.
    boxes: Vec<Option<(Aabb, ProxyFilter)>>,
    /// Sorted.
    pairs: Vec<Pair>,
    /// Ids removed since the last update.
    gone: Vec<u32>,
    fault: Fault,
}

impl Follower {
    pub(crate) fn new(config: Config, ids: usize, fault: Fault) -> Result<Self, String> {
        let broad_phase = BroadPhase::new(config).map_err(|error| error.to_string())?;
        Ok(Self { broad_phase, boxes: vec![None; ids], pairs: vec![], gone: vec![], fault })
    }

    /// Returns the number of ids, those of absent boxes included.
    pub(crate) fn ids(&self) -> usize {
        self.boxes.len()
    }

    /// Sets one box.
    pub(crate) fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) -> Result<(), String> {
        self.boxes[id as usize] = Some((aabb, filter));
        self.broad_phase.set(id, aabb, filter).map_err(|error| error.to_string())
    }

    /// Sets all boxes in one call, without filters.
    pub(crate) fn set_all(&mut self, boxes: &[Aabb]) -> Result<(), String> {
        let all = |aabb: &Aabb| Some((*aabb, ProxyFilter::ALL));
        self.boxes = boxes.iter().map(all).collect();
        let ids: Vec<u32> = (0..boxes.len() as u32).collect();
        let set = self.broad_phase.set_many(&ids, |id| all(&boxes[id as usize]));
        set.map_err(|error| error.to_string())
    }

    /// Removes a box, if it is present.
    pub(crate) fn remove(&mut self, id: u32) -> Result<(), String> {
        let was_present = self.boxes[id as usize].take().is_some();
        self.gone.push(id);
        if self.broad_phase.remove(id) == was_present {
            Ok(())
        } else {
            Err(format!("box {id} was present: {was_present}, and `remove` returned the opposite"))
        }
    }

    /// Forgets the pairs of removed boxes, which end without events.
    fn forget_gone(&mut self) {
        if self.gone.is_empty() {
            return;
        }
        let mut is_gone = vec![false; self.boxes.len()];
        self.gone.drain(..).for_each(|id| is_gone[id as usize] = true);
        self.pairs.retain(|pair| !is_gone[pair.a as usize] && !is_gone[pair.b as usize]);
    }

    /// Updates, applies the events, and compares with the oracle and with the kept pairs.
    pub(crate) fn update(&mut self) -> Result<(), String> {
        self.forget_gone();
        let mut events = self.broad_phase.update().map_err(|error| error.to_string())?.clone();
        self.fault.lose(Fault::AddedLost, &mut events.added);
        self.fault.lose(Fault::RemovedLost, &mut events.removed);
        self.apply(&events.added, &events.removed)?;
        let explained = |what, why| format!("{what}: {why}; {}", self.broad_phase.report().plan);
        let differs = |what, other: &[Pair]| {
            difference(&self.pairs, other).map_or(Ok(()), |why| Err(explained(what, why)))
        };
        differs("pairs by events against the oracle", &self.wanted()?)?;
        differs("pairs by events against the kept pairs", &self.kept())
    }

    fn apply(&mut self, added: &[Pair], removed: &[Pair]) -> Result<(), String> {
        if !added.is_sorted() || !removed.is_sorted() {
            return Err("events are out of order".to_owned());
        }
        let (before, mut ended) = (self.pairs.len(), removed.iter().peekable());
        // Both lists are sorted, so a walk finds each removed pair.
        self.pairs.retain(|pair| ended.next_if_eq(&pair).is_none());
        if before - self.pairs.len() != removed.len() {
            return Err(format!("removed, but not there before: {:?}", ended.next()));
        }
        // A pair that is added twice stays in the list twice, where the comparison finds it.
        self.pairs.extend_from_slice(added);
        self.pairs.sort();
        Ok(())
    }

    fn kept(&self) -> Vec<Pair> {
        let mut kept: Vec<Pair> = self.broad_phase.pairs().collect();
        kept.sort_unstable();
        kept
    }

    /// Returns the oracle's pairs of the fat AABBs, each of which must contain the box that was set.
    fn wanted(&self) -> Result<Vec<Pair>, String> {
        let mut fat = vec![Aabb::NOWHERE; self.boxes.len()];
        let mut filters = vec![ProxyFilter::ALL; self.boxes.len()];
        for (id, given) in self.boxes.iter().enumerate() {
            let stored = self.broad_phase.fat_aabb(id as u32);
            let valid = given.filter(|(aabb, _)| aabb.is_valid());
            match (stored, valid) {
                (None, None) => {}
                (Some(stored), Some((aabb, filter))) if stored.contains(&aabb) => {
                    (fat[id], filters[id]) = (stored, filter);
                }
                _ => return Err(format!("box {id} is {given:?}, its fat AABB {stored:?}")),
            }
        }
        Ok(oracle::pairs_filtered(&fat, &filters))
    }
}

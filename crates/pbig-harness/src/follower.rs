//! A caller of `BroadPhase` that keeps the pairs by its events, and compares them with the oracle.

use crate::boxes::shifted;
use crate::corpus::difference;
use pbig_core::{Aabb, BroadPhase, Events, Pair, ProxyFilter, oracle};

/// A broad phase with the boxes that were set in it, and the pairs that its events lead to.
pub struct Follower {
    pub broad_phase: BroadPhase,
    /// By id; none for an absent box.
    pub boxes: Vec<Option<(Aabb, ProxyFilter)>>,
    /// Sorted.
    pairs: Vec<Pair>,
    /// Ids removed since the last update.
    gone: Vec<u32>,
}

impl Follower {
    /// Follows a broad phase without boxes, for ids below `ids`.
    pub fn new(broad_phase: BroadPhase, ids: usize) -> Self {
        Self { broad_phase, boxes: vec![None; ids], pairs: vec![], gone: vec![] }
    }

    /// Returns true if a box is present, be it an invalid one.
    pub fn has(&self, id: u32) -> bool {
        self.boxes[id as usize].is_some()
    }

    /// Sets one box.
    pub fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) -> Result<(), String> {
        self.boxes[id as usize] = Some((aabb, filter));
        self.broad_phase.set(id, aabb, filter).map_err(|error| error.to_string())
    }

    /// Removes a box, if it is present.
    ///
    /// # Errors
    /// If the broad phase says otherwise about its presence.
    pub fn remove(&mut self, id: u32) -> Result<(), String> {
        let was_present = self.boxes[id as usize].take().is_some();
        self.gone.push(id);
        if self.broad_phase.remove(id) == was_present {
            Ok(())
        } else {
            Err(format!("box {id} was present: {was_present}, and `remove` returned the opposite"))
        }
    }

    /// Sets the boxes of a frame: each moves, and every 17th is absent.
    ///
    /// # Errors
    /// As [`Follower::set`] and [`Follower::remove`].
    pub fn set_frame(&mut self, start: &[Aabb], frame: usize) -> Result<(), String> {
        (0..).zip(start).try_for_each(|(id, aabb)| {
            let number = id as usize;
            if (number + frame).is_multiple_of(17) {
                return self.remove(id);
            }
            let by = ((number * 7 + frame * 13) % 11) as f32 * 0.1;
            self.set(id, shifted(aabb, [by; 3]), ProxyFilter::ALL)
        })
    }

    /// Updates, applies the events, and compares with the oracle and with the kept pairs.
    ///
    /// # Errors
    /// The first difference.
    pub fn update(&mut self) -> Result<(), String> {
        self.follow()?;
        let explained = |what, why| format!("{what}: {why}; {}", self.broad_phase.report().plan);
        let differs = |what, other: &[Pair]| {
            difference(&self.pairs, other).map_or(Ok(()), |why| Err(explained(what, why)))
        };
        differs("pairs by events against the oracle", &self.wanted()?)?;
        differs("pairs by events against the kept pairs", &self.kept())
    }

    /// Updates and applies the events, without a comparison: of a million updates only a sample is compared.
    ///
    /// # Errors
    /// The broad phase's own, and events that are out of order or end a pair that is not there.
    pub fn follow(&mut self) -> Result<(), String> {
        self.forget_gone();
        let events = self.broad_phase.update().map_err(|error| error.to_string())?.clone();
        self.apply(&events)
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

    fn apply(&mut self, Events { added, removed, .. }: &Events) -> Result<(), String> {
        if !added.is_sorted() || !removed.is_sorted() {
            return Err("events are out of order".to_owned());
        }
        if added.is_empty() && removed.is_empty() {
            return Ok(());
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

    /// Returns the oracle's pairs of the fat AABBs. Each must contain the box that was set, and reach at most two margins beyond.
    fn wanted(&self) -> Result<Vec<Pair>, String> {
        let slack = 2.0 * self.broad_phase.config().margin;
        let mut fat = vec![Aabb::NOWHERE; self.boxes.len()];
        let mut filters = vec![ProxyFilter::ALL; self.boxes.len()];
        for (id, given) in self.boxes.iter().enumerate() {
            let stored = self.broad_phase.fat_aabb(id as u32);
            let valid = given.filter(|(aabb, _)| aabb.is_valid());
            match (stored, valid) {
                (None, None) => {}
                (Some(stored), Some((aabb, filter))) if is_near(&aabb, &stored, slack) => {
                    (fat[id], filters[id]) = (stored, filter);
                }
                _ => return Err(format!("box {id} is {given:?}, its fat AABB {stored:?}")),
            }
        }
        Ok(oracle::pairs_filtered(&fat, &filters))
    }
}

/// Returns true if a fat AABB contains a box and reaches at most `slack` beyond it.
fn is_near(aabb: &Aabb, fat: &Aabb, slack: f32) -> bool {
    // The gap between equal infinities is NaN.
    let near = |gap: f32| gap.is_nan() || gap <= slack;
    let is_near_on = |k: usize| near(aabb.min[k] - fat.min[k]) && near(fat.max[k] - aabb.max[k]);
    fat.contains(aabb) && (0..3).all(is_near_on)
}

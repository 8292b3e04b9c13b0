//! Worlds in f64. The fat AABBs are kept in f64. The core gets them relative to a centre, rounded outward to f32, so it finds
//! a superset of the pairs. A *candidate* is a pair of the core; it is a pair of the world while its f64 boxes overlap.
//!
//! Pairs are exactly those whose f64 boxes overlap, wherever the centre is. Two boxes can meet without a new event of the core, so
//! an update tests all candidates of changed boxes.

use crate::bounds::{Bounds, BoxStore, Scalar};
use crate::policy;
use pbig_core::{Aabb, BroadPhase, Error, Events, Pair, ProxyFilter};
use std::collections::BTreeSet;
use std::iter::Peekable;

/// Speeds that f32 has, and their reciprocals.
const SPEEDS: std::ops::Range<f64> = 1e-30..1e38;

/// A closed AABB in f64. It is valid if `min <= max` on all axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WideAabb {
    /// The lower corner.
    pub min: [f64; 3],
    /// The upper corner.
    pub max: [f64; 3],
}

impl WideAabb {
    fn is_valid(&self) -> bool {
        (0..3).all(|k| self.min[k] <= self.max[k])
    }

    fn inflated(&self, reach: f64) -> Self {
        Self { min: self.min.map(|x| x - reach), max: self.max.map(|x| x + reach) }
    }

    /// Returns true if the gaps to a box around it are from 0 to `slack` on all sides. Equal infinities have no gap.
    fn is_held_by(&self, outer: &Self, slack: f64) -> bool {
        let is_gap = |low: f64, high: f64| low == high || (0.0..=slack).contains(&(high - low));
        (0..3).all(|k| is_gap(outer.min[k], self.min[k]) && is_gap(self.max[k], outer.max[k]))
    }
}

impl Scalar for f64 {
    type Aabb = WideAabb;

    #[inline(always)]
    fn to_f32(self) -> f32 {
        self as f32
    }
}

impl Bounds for WideAabb {
    type Real = f64;
    type Store = WideBoxes;
    const NOWHERE: Self = Self { min: [f64::NAN; 3], max: [f64::NAN; 3] };

    fn from_corners(min: [f64; 3], max: [f64; 3]) -> Self {
        Self { min, max }
    }

    fn corners(&self) -> [[f64; 3]; 2] {
        [self.min, self.max]
    }

    fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|k| self.min[k] <= other.max[k] && other.min[k] <= self.max[k])
    }

    fn gap(&self, other: &Self, axis: usize) -> f32 {
        (self.min[axis] - other.max[axis]).max(other.min[axis] - self.max[axis]) as f32
    }

    fn grown(&self, reach: f32) -> Self {
        let grown = self.inflated(reach.into());
        Self { min: grown.min.map(f64::next_down), max: grown.max.map(f64::next_up) }
    }

    fn to_f32(&self) -> Aabb {
        Aabb::from_f64(self.min, self.max)
    }
}

/// The boxes of a world in f64.
#[derive(Clone, Debug, Default)]
pub struct WideBoxes {
    /// Fat AABBs by id.
    boxes: Vec<WideAabb>,
    margin: f32,
    /// The origin of the core's coordinates.
    centre: [f64; 3],
    /// Boxes that were set since the centre was last considered, and the number at which it is considered again.
    set: usize,
    consider_at: usize,
    /// Ids of boxes that have changed since the last update, repeated or not.
    changed: Vec<u32>,
    has_removed: bool,
    /// Candidates whose f64 boxes do not overlap.
    apart: BTreeSet<Pair>,
    events: Events,
}

impl WideBoxes {
    fn get(&self, id: u32) -> WideAabb {
        self.boxes.get(id as usize).copied().unwrap_or(WideAabb::NOWHERE)
    }

    /// Returns the fat AABB of a box: the stored one if it still holds the box.
    fn fatten(&self, id: u32, aabb: &WideAabb) -> WideAabb {
        let (fat, margin) = (self.get(id), f64::from(self.margin));
        if !aabb.is_valid() {
            WideAabb::NOWHERE
        } else if aabb.is_held_by(&fat, 2.0 * margin) {
            fat
        } else {
            aabb.inflated(margin)
        }
    }

    fn store(&mut self, id: u32, fat: WideAabb) {
        let i = id as usize;
        if self.boxes.len() <= i {
            self.boxes.resize(i + 1, WideAabb::NOWHERE);
        }
        if self.boxes[i] != fat && (self.boxes[i].is_valid() || fat.is_valid()) {
            self.changed.push(id);
        }
        self.boxes[i] = fat;
        self.set += 1;
    }

    /// Returns the core's box. Subtraction rounds, but monotonically, so boxes that overlap still do. The box reaches one unit in the
    /// last place further: queries round their directions.
    fn to_core(&self, aabb: &WideAabb) -> Aabb {
        let relative = |corner: [f64; 3]| std::array::from_fn(|k| corner[k] - self.centre[k]);
        let rounded = Aabb::from_f64(relative(aabb.min), relative(aabb.max));
        Aabb::new(rounded.min.map(f32::next_down), rounded.max.map(f32::next_up))
    }

    fn limit(&self) -> f64 {
        f64::from(self.margin) * policy::FAR_MARGINS
    }

    fn is_far(&self, aabb: &WideAabb, limit: f64) -> bool {
        (0..3).any(|k| (aabb.min[k] - self.centre[k]).abs() > limit)
    }

    /// Returns the median of the lower corners, rounded so that a world in motion keeps its centre. Half-spaces do not count.
    fn median(&self) -> [f64; 3] {
        let places = self
            .boxes
            .iter()
            .filter(|aabb| aabb.is_valid() && aabb.to_f32().min.iter().all(|x| x.is_finite()));
        let mut corners: Vec<_> = places.map(|aabb| aabb.min).collect();
        if corners.is_empty() {
            return self.centre;
        }
        let (middle, grid) = (corners.len() / 2, self.limit());
        let median = std::array::from_fn(|k| {
            let median = corners.select_nth_unstable_by(middle, |a, b| a[k].total_cmp(&b[k])).1[k];
            if grid > 0.0 { (median / grid).round() * grid } else { median }
        });
        if median.iter().all(|x: &f64| x.is_finite()) { median } else { self.centre }
    }

    /// Tests the candidates that are new or have changed, in their order.
    fn test_candidates(&mut self, core: &BroadPhase) {
        self.changed.sort_unstable();
        self.changed.dedup();
        let is_few = self.changed.len() * policy::WIDE_LOOKUPS < core.id_count() as usize;
        let mut new = core.events().added.iter().copied().peekable();
        if is_few {
            let of_changed = self.changed.iter().flat_map(|&id| core.pairs_of(id));
            let mut tested: Vec<Pair> = of_changed.chain(new.clone()).collect();
            tested.sort_unstable();
            tested.dedup();
            tested.into_iter().for_each(|pair| self.test(pair, &mut new));
        } else {
            core.pairs().for_each(|pair| self.test(pair, &mut new));
        }
    }

    /// Tests a candidate, which may be the first one of `new`.
    #[inline(always)]
    fn test(&mut self, pair: Pair, new: &mut Peekable<impl Iterator<Item = Pair>>) {
        let is_new = new.next_if_eq(&pair).is_some();
        let was_apart = !self.apart.is_empty() && self.apart.contains(&pair);
        if self.get(pair.a).overlaps(&self.get(pair.b)) {
            if was_apart {
                self.apart.remove(&pair);
            }
            if is_new || was_apart {
                self.events.added.push(pair);
            }
        } else if !was_apart {
            self.apart.insert(pair);
            if !is_new {
                self.events.removed.push(pair);
            }
        }
    }
}

impl BoxStore<WideAabb> for WideBoxes {
    /// The core's margin is 0: the boxes that it gets are fat.
    fn set_margin(&mut self, core: &mut BroadPhase, margin: f32) -> Result<(), Error> {
        core.set_margin(margin)?;
        self.margin = margin;
        core.set_margin(0.0)
    }

    fn margin(&self, _: &BroadPhase) -> f32 {
        self.margin
    }

    fn set(
        &mut self,
        core: &mut BroadPhase,
        id: u32,
        aabb: WideAabb,
        filter: ProxyFilter,
    ) -> Result<(), Error> {
        let fat = self.fatten(id, &aabb);
        core.set(id, self.to_core(&fat), filter)?;
        self.store(id, fat);
        Ok(())
    }

    fn set_aabb(&mut self, core: &mut BroadPhase, id: u32, aabb: WideAabb) -> bool {
        let fat = self.fatten(id, &aabb);
        let has_box = core.set_aabb(id, self.to_core(&fat));
        if has_box {
            self.store(id, fat);
        }
        has_box
    }

    fn remove(&mut self, core: &mut BroadPhase, id: u32) {
        if core.remove(id) {
            self.store(id, WideAabb::NOWHERE);
            self.has_removed = true;
        }
    }

    fn clear(&mut self, core: &mut BroadPhase) {
        core.clear();
        *self = Self { margin: self.margin, ..Self::default() };
    }

    fn fat(&self, _: &BroadPhase, id: u32) -> Option<WideAabb> {
        Some(self.get(id)).filter(WideAabb::is_valid)
    }

    fn changes<'a>(&'a self, core: &'a BroadPhase) -> &'a [u32] {
        if self.changed.is_empty() { core.changes() } else { &self.changed }
    }

    /// Chooses another centre if more than half of the boxes are far from the present one. The choice reads all boxes, so it waits
    /// until a few times as many boxes have been set.
    fn settle(&mut self, core: &mut BroadPhase) {
        if self.set < self.consider_at {
            return;
        }
        let (limit, count) = (self.limit(), core.len());
        (self.set, self.consider_at) = (0, count * policy::CENTRE_SETS_PER_BOX);
        let far = self.boxes.iter().filter(|aabb| aabb.is_valid() && self.is_far(aabb, limit)).count();
        let centre = if 2 * far > count { self.median() } else { self.centre };
        if centre != self.centre {
            self.centre = centre;
            for id in 0..core.id_count() {
                core.set_aabb(id, self.to_core(&self.get(id)));
            }
        }
    }

    fn update<'a>(&'a mut self, core: &'a mut BroadPhase) -> Result<&'a Events, Error> {
        self.events.added.clear();
        self.events.removed.clear();
        core.update()?;
        for pair in &core.events().removed {
            if !self.apart.remove(pair) {
                self.events.removed.push(*pair);
            }
        }
        if std::mem::take(&mut self.has_removed) {
            self.apart.retain(|pair| core.has_pair(*pair));
        }
        self.test_candidates(core);
        self.changed.clear();
        self.events.removed.sort_unstable();
        Ok(&self.events)
    }

    fn admits(&self, pair: &Pair) -> bool {
        !self.apart.contains(pair)
    }

    fn pair_count(&self, core: &BroadPhase) -> usize {
        core.pair_count() - self.apart.iter().filter(|pair| core.has_pair(**pair)).count()
    }

    fn widen(&self, aabb: Aabb) -> WideAabb {
        let absolute = |corner: [f32; 3]| std::array::from_fn(|k| f64::from(corner[k]) + self.centre[k]);
        WideAabb { min: absolute(aabb.min), max: absolute(aabb.max) }
    }

    /// If the motion is not one in f32, all boxes are met at once.
    fn narrow_motion(&self, start: &WideAabb, velocity: &[f64; 3]) -> (Aabb, [f32; 3]) {
        let (aabb, narrow) = (self.to_core(start), velocity.map(|x| x as f32));
        let speed = velocity.iter().fold(0.0, |speed: f64, x| speed.max(x.abs()));
        let is_near = aabb.min.iter().chain(&aabb.max).all(|x| x.is_finite());
        if velocity.iter().any(|x| x.is_nan()) || is_near && (speed == 0.0 || SPEEDS.contains(&speed)) {
            return (aabb, narrow);
        }
        (Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]), [0.0; 3])
    }

    fn narrow_point(&self, point: &[f64; 3]) -> [f32; 3] {
        // No number that is not finite, which no box is near.
        let near = |x: f64| if x.is_nan() { f64::NAN } else { x.clamp(f32::MIN.into(), f32::MAX.into()) };
        std::array::from_fn(|k| near(point[k] - self.centre[k]) as f32)
    }

    fn narrow_box(&self, aabb: &WideAabb) -> Aabb {
        self.to_core(aabb)
    }

    fn overlaps(&self, id: u32, aabb: &WideAabb) -> bool {
        self.get(id).overlaps(aabb)
    }

    /// A millionth more than the bound covers the rounding of the query to f32.
    fn narrow_bound(&self, bound: f64) -> f32 {
        ((bound * (1.0 + 1e-6)) as f32).next_up()
    }
}

#[cfg(test)]
mod tests;

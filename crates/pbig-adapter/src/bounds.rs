//! AABBs in the precision of a world. The core stores f32; a world in f64 keeps its own boxes beside the core's: see
//! [`crate::WideBoxes`].

use pbig_core::{Aabb, BroadPhase, Error, Events, Pair, ProxyFilter};
use std::fmt::Debug;

/// The numbers of a world, f32 or f64.
pub trait Scalar: Copy + Debug + Send + Sync + 'static {
    /// Its AABBs.
    type Aabb: Bounds<Real = Self>;

    /// Returns the nearest f32.
    fn to_f32(self) -> f32;
}

impl Scalar for f32 {
    type Aabb = Aabb;

    #[inline(always)]
    fn to_f32(self) -> f32 {
        self
    }
}

/// An AABB in the precision of a world. A world in two dimensions has the z coordinates 0.
pub trait Bounds: Copy + Debug + Send + Sync + 'static {
    /// The type of its coordinates.
    type Real: Scalar<Aabb = Self>;
    /// The stored AABBs of a world.
    type Store: BoxStore<Self>;

    /// An invalid box.
    const NOWHERE: Self;

    /// Returns the box between two corners.
    fn from_corners(min: [Self::Real; 3], max: [Self::Real; 3]) -> Self;

    /// Returns the two corners.
    fn corners(&self) -> [[Self::Real; 3]; 2];

    /// Returns true if the closed boxes share a point.
    fn overlaps(&self, other: &Self) -> bool;

    /// Returns the extent of the gap between two boxes on an axis. It is negative where they overlap.
    fn gap(&self, other: &Self, axis: usize) -> f32;

    /// Returns the box grown by a distance, and by at least one unit in the last place.
    fn grown(&self, reach: f32) -> Self;

    /// Returns the smallest box in f32 around this one.
    fn to_f32(&self) -> Aabb;

    /// Returns the largest distance of a corner from the origin along an axis.
    fn reach(&self) -> f32 {
        let Aabb { min, max } = self.to_f32();
        min.iter().chain(&max).fold(0.0, |reach, x| reach.max(x.abs()))
    }
}

/// The stored AABBs of a world, and the candidate pairs that the core finds and that are no pairs.
pub trait BoxStore<A: Bounds>: Clone + Debug + Default + Send + Sync {
    /// Changes the margin of boxes that are set after this call.
    fn set_margin(&mut self, core: &mut BroadPhase, margin: f32) -> Result<(), Error>;

    /// Returns the margin of boxes that are set from now on.
    fn margin(&self, core: &BroadPhase) -> f32;

    /// Stores the AABB and the filter of a collider.
    fn set(&mut self, core: &mut BroadPhase, id: u32, aabb: A, filter: ProxyFilter) -> Result<(), Error>;

    /// Stores the AABB of a collider that keeps its filter. Returns false if it has no box.
    fn set_aabb(&mut self, core: &mut BroadPhase, id: u32, aabb: A) -> bool;

    /// Removes a collider.
    fn remove(&mut self, core: &mut BroadPhase, id: u32);

    /// Removes all colliders.
    fn clear(&mut self, core: &mut BroadPhase);

    /// Returns the AABB of a collider with its margin, unless it is invalid.
    fn fat(&self, core: &BroadPhase, id: u32) -> Option<A>;

    /// Returns the colliders whose AABBs have changed since the last update, some perhaps twice.
    fn changes<'a>(&'a self, core: &'a BroadPhase) -> &'a [u32];

    /// Prepares the core for an update, after all AABBs have been set.
    fn settle(&mut self, core: &mut BroadPhase);

    /// Updates the core, and returns the pairs that began and ended, sorted.
    fn update<'a>(&'a mut self, core: &'a mut BroadPhase) -> Result<&'a Events, Error>;

    /// Returns true if a pair of the core is one of the world.
    fn admits(&self, pair: &Pair) -> bool;

    /// Returns the number of pairs.
    fn pair_count(&self, core: &BroadPhase) -> usize;

    /// Returns a box of the core in the world's coordinates.
    fn widen(&self, aabb: Aabb) -> A;

    /// Returns a box of the core and its velocity that meet, within the narrowed time, at least the boxes that this one meets: all,
    /// if the velocity is beyond f32.
    fn narrow_motion(&self, start: &A, velocity: &[A::Real; 3]) -> (Aabb, [f32; 3]);

    /// Returns a point of the core that has, within the narrowed distance, at least the boxes that this one has.
    fn narrow_point(&self, point: &[A::Real; 3]) -> [f32; 3];

    /// Returns a box of the core that overlaps at least the boxes that this one overlaps.
    fn narrow_box(&self, aabb: &A) -> Aabb;

    /// Returns true if a box that overlaps the narrowed one overlaps this one.
    #[inline(always)]
    fn overlaps(&self, _id: u32, _aabb: &A) -> bool {
        true
    }

    /// Returns the time or distance of the narrowed query for this one.
    fn narrow_bound(&self, bound: A::Real) -> f32;
}

impl Bounds for Aabb {
    type Real = f32;
    type Store = CoreBoxes;
    const NOWHERE: Self = Aabb::NOWHERE;

    #[inline(always)]
    fn from_corners(min: [f32; 3], max: [f32; 3]) -> Self {
        Self::new(min, max)
    }

    #[inline(always)]
    fn corners(&self) -> [[f32; 3]; 2] {
        [self.min, self.max]
    }

    fn overlaps(&self, other: &Self) -> bool {
        Aabb::overlaps(self, other)
    }

    fn gap(&self, other: &Self, axis: usize) -> f32 {
        (self.min[axis] - other.max[axis]).max(other.min[axis] - self.max[axis])
    }

    fn grown(&self, reach: f32) -> Self {
        let grown = self.inflated(reach);
        Self::new(grown.min.map(f32::next_down), grown.max.map(f32::next_up))
    }

    fn to_f32(&self) -> Aabb {
        *self
    }
}

/// The boxes of a world in f32: those of the core alone.
#[derive(Clone, Copy, Debug, Default)]
pub struct CoreBoxes;

impl BoxStore<Aabb> for CoreBoxes {
    #[inline(always)]
    fn set_margin(&mut self, core: &mut BroadPhase, margin: f32) -> Result<(), Error> {
        core.set_margin(margin)
    }

    fn margin(&self, core: &BroadPhase) -> f32 {
        core.config().margin
    }

    #[inline(always)]
    fn set(&mut self, core: &mut BroadPhase, id: u32, aabb: Aabb, filter: ProxyFilter) -> Result<(), Error> {
        core.set(id, aabb, filter)
    }

    #[inline(always)]
    fn set_aabb(&mut self, core: &mut BroadPhase, id: u32, aabb: Aabb) -> bool {
        core.set_aabb(id, aabb)
    }

    fn remove(&mut self, core: &mut BroadPhase, id: u32) {
        core.remove(id);
    }

    fn clear(&mut self, core: &mut BroadPhase) {
        core.clear();
    }

    fn fat(&self, core: &BroadPhase, id: u32) -> Option<Aabb> {
        core.fat_aabb(id)
    }

    fn changes<'a>(&'a self, core: &'a BroadPhase) -> &'a [u32] {
        core.changes()
    }

    fn settle(&mut self, _: &mut BroadPhase) {}

    fn update<'a>(&'a mut self, core: &'a mut BroadPhase) -> Result<&'a Events, Error> {
        core.update()
    }

    fn admits(&self, _: &Pair) -> bool {
        true
    }

    fn pair_count(&self, core: &BroadPhase) -> usize {
        core.pair_count()
    }

    fn widen(&self, aabb: Aabb) -> Aabb {
        aabb
    }

    #[inline(always)]
    fn narrow_motion(&self, start: &Aabb, velocity: &[f32; 3]) -> (Aabb, [f32; 3]) {
        (*start, *velocity)
    }

    #[inline(always)]
    fn narrow_point(&self, point: &[f32; 3]) -> [f32; 3] {
        *point
    }

    #[inline(always)]
    fn narrow_box(&self, aabb: &Aabb) -> Aabb {
        *aabb
    }

    #[inline(always)]
    fn narrow_bound(&self, bound: f32) -> f32 {
        bound
    }
}

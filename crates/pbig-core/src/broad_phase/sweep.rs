//! The engine for small worlds: each changed box is tested against all boxes, as they were and as they are.
//!
//! Boxes lie axis by axis, so that eight are tested at once. There is no index to keep, and no cost but that of
//! the tests: half a microsecond for one changed box of a thousand.

use super::world::World;
use crate::grid::{BLOCK, EightBoxes, Kernel, Simd, dispatch};
use crate::pairs::Comparison;
use crate::{Aabb, Checks, Pair, ProxyFilter};

/// Boxes axis by axis, eight to a block. Padded with boxes that overlap nothing.
#[derive(Clone, Debug, Default)]
struct Columns(Vec<EightBoxes>);

impl Columns {
    fn resize(&mut self, boxes: usize) {
        self.0.resize(boxes.div_ceil(BLOCK), [[f32::NAN; BLOCK]; 6]);
    }

    fn put(&mut self, id: usize, aabb: &Aabb) {
        let values = aabb.min.into_iter().chain(aabb.max);
        for (row, value) in self.0[id / BLOCK].iter_mut().zip(values) {
            row[id % BLOCK] = value;
        }
    }
}

/// A small world as it was at the last update, and as it is.
#[derive(Clone, Debug, Default)]
pub(super) struct Sweep {
    before: Columns,
    after: Columns,
    boxes_before: Vec<Aabb>,
    filters_before: Vec<ProxyFilter>,
    is_current: bool,
}

impl Sweep {
    /// Says that another engine has made an update.
    pub(super) fn expire(&mut self) {
        self.is_current = false;
    }

    /// Leaves the events of an update in `events`, sorted. Returns the tests made.
    pub(super) fn run(&mut self, world: &World, events: &mut Comparison) -> Checks {
        events.clear();
        self.reserve(world.ids());
        for &id in &world.changed {
            self.after.put(id as usize, &world.boxes[id as usize]);
        }
        let (made, met) = dispatch(SweepAll { sweep: self, world, events });
        events.sort(world.ids());
        Checks { made, unnecessary: made - met, redundant: 0 }
    }

    /// Takes over the world as it is now.
    pub(super) fn advance(&mut self, world: &World) {
        self.before.0.copy_from_slice(&self.after.0);
        for &id in &world.changed {
            let i = id as usize;
            self.boxes_before[i] = world.boxes[i];
            self.filters_before[i] = world.filters[i];
        }
    }

    fn reserve(&mut self, ids: usize) {
        self.before.resize(ids);
        self.after.resize(ids);
        self.boxes_before.resize(ids, Aabb::NOWHERE);
        self.filters_before.resize(ids, ProxyFilter::ALL);
    }

    /// Returns true if the engine knows the world of the last update.
    pub(super) fn is_current(&self) -> bool {
        self.is_current
    }

    /// Copies the world of the last update: `world` with its changes taken back.
    pub(super) fn copy(&mut self, world: &World) {
        self.reserve(world.ids());
        for id in 0..world.ids() {
            let old = world.change_of(id as u32).map(|at| world.old[at]);
            let aabb = old.map_or(world.boxes[id], |old| old.aabb);
            self.before.put(id, &aabb);
            self.after.put(id, &world.boxes[id]);
            self.boxes_before[id] = aabb;
            self.filters_before[id] = old.map_or(world.filters[id], |old| old.filter);
        }
        self.is_current = true;
    }

    fn paired_before(&self, world: &World, a: u32, b: u32) -> bool {
        let [one, other] = [a, b].map(|id| &self.filters_before[id as usize]);
        !world.is_filtered || one.allows(other)
    }

    /// Sorts out the boxes of a block that `id` overlapped or overlaps.
    #[cold]
    fn sort_pair(&self, world: &World, id: u32, was: bool, is: bool, other: u32, events: &mut Comparison) {
        let is_met_twice = other == id || other < id && world.change_of(other).is_some();
        if is_met_twice {
            return;
        }
        let allows = !world.is_filtered || world.filters[id as usize].allows(&world.filters[other as usize]);
        let (was, is) = (was && self.paired_before(world, id, other), is && allows);
        let ended = was && (world.was_removed(id) || world.was_removed(other));
        let pair = Pair::new(id, other);
        match (was && !ended, is) {
            (true, false) => events.removed.push(pair),
            (false, true) => events.added.push(pair),
            _ => {}
        }
        if ended {
            events.dropped.push(pair);
        }
    }
}

struct SweepAll<'a> {
    sweep: &'a Sweep,
    world: &'a World,
    events: &'a mut Comparison,
}

impl Kernel for SweepAll<'_> {
    /// Boxes tested, and those that overlap or did.
    type Output = (u64, u64);

    #[inline(always)]
    unsafe fn run<S: Simd>(self) -> (u64, u64) {
        let Self { sweep, world, events } = self;
        let (mut made, mut met) = (0, 0);
        let must_look = world.is_filtered || world.has_removed();
        // Where all have changed, each pair is met from its first box.
        let all_changed = world.changed.len() == world.ids();
        for &id in &world.changed {
            let (before, after) = (sweep.boxes_before[id as usize], world.boxes[id as usize]);
            let first = if all_changed { id as usize / BLOCK } else { 0 };
            made += world.ids() as u64 - (first * BLOCK) as u64;
            let blocks = sweep.before.0.iter().zip(&sweep.after.0).enumerate().skip(first);
            for (block, (was, is)) in blocks {
                // SAFETY: the caller has the instructions.
                let (was, is) = unsafe { (S::overlaps_eight(was, &before), S::overlaps_eight(is, &after)) };
                met += u64::from((was | is).count_ones());
                let mut look = if must_look { was | is } else { was ^ is };
                while look != 0 {
                    let lane = look.trailing_zeros();
                    look &= look - 1;
                    let other = (block * BLOCK) as u32 + lane;
                    sweep.sort_pair(world, id, was >> lane & 1 != 0, is >> lane & 1 != 0, other, events);
                }
            }
        }
        (made, met)
    }
}

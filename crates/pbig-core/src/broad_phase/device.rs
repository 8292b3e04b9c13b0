//! An update on a GPU: only what has changed goes there, only pairs that were added or removed come back.

use super::BroadPhase;
#[cfg(feature = "unstable-study")]
use crate::Limits;
use crate::all_pairs::Held;
use crate::gpu::{Change, ChangeRequest, GpuFinder, GpuFound};
use crate::{Aabb, Backend, Config, Error, NoGpu, Pair};

impl BroadPhase {
    /// Makes a broad phase with a given device. [`Backend::Gpu`] always uses it, [`Backend::Auto`] if it is hardware and many boxes
    /// change.
    ///
    /// # Errors
    /// [`Error::Margin`].
    pub fn with_gpu(config: Config, gpu: GpuFinder) -> Result<Self, Error> {
        let mut broad_phase = Self::new(config)?;
        broad_phase.set_gpu(gpu);
        Ok(broad_phase)
    }

    /// Uses this device, beginning with the first update whose changes are all set after this call. Earlier updates use the CPU.
    pub fn set_gpu(&mut self, gpu: GpuFinder) {
        self.gpu.gpu = Some(gpu);
        self.world.keep_old = usize::MAX;
    }

    /// Sets where the next updates run, and their limits.
    #[cfg(feature = "unstable-study")]
    pub fn set_backend(&mut self, backend: Backend, limits: Limits) {
        (self.config.backend, self.config.limits) = (backend, limits);
    }

    /// Returns the adapter of the device in use: name, kind and API. None while there is no device or it has failed.
    pub fn adapter(&self) -> Option<&str> {
        self.gpu.adapter()
    }

    /// Returns true if an update may run on a device, which needs to know what boxes were.
    pub(super) fn may_use_gpu(&self) -> bool {
        self.gpu.gpu.is_some() || self.config.backend == Backend::Gpu
    }

    /// Leaves the events in `comparison` if a device has found them. False if the CPU has to do it.
    pub(super) fn find_on_gpu(&mut self) -> Result<bool, Error> {
        let world = &self.world;
        if !self.gpu.is_wanted(&self.config, world.changed.len(), &mut self.report) {
            return Ok(false);
        }
        if !world.knows_old() {
            self.report.plan.no_gpu = Some(NoGpu::OldBoxesUnknown);
            return Ok(false);
        }
        let old = world.changed.iter().zip(&world.old);
        let was = |(&id, old): (&u32, &super::world::Old)| {
            let aabb = if world.was_removed(id) { Aabb::NOWHERE } else { old.aabb };
            Change { id, aabb, filter: old.filter }
        };
        let changed: Vec<Change> = old.map(was).collect();
        let request = ChangeRequest {
            boxes: &world.boxes,
            filters: &world.filters,
            changed: &changed,
            update: self.updates,
            kept: self.kept.len() as u64,
            config: &self.config,
        };
        let invalid = self.report.invalid;
        let found = self.gpu.call(&mut self.report, |gpu| gpu.changes(&request))?;
        self.report.invalid = invalid;
        let Some(found) = found else { return Ok(false) };
        self.store.held = Held::Nowhere;
        self.sweep.expire();
        self.sort_out(&found);
        Ok(true)
    }

    /// Sorts what a device has found into added, removed and dropped pairs.
    fn sort_out(&mut self, found: &GpuFound) {
        let (world, kept, events) = (&self.world, &self.kept, &mut self.comparison);
        events.clear();
        let existed = |pair: &Pair| !world.was_removed(pair.a) && !world.was_removed(pair.b);
        // A pair that is not kept cannot end. A device that reports its end is wrong, and does no harm.
        events.removed.extend(kept.existing(&found.ended));
        // The device reports pairs of boxes that it treats as new, even if they are kept.
        let restarted = &found.restarted;
        let is_restarted = |id: u32| restarted.binary_search(&id).is_ok();
        let may_be_kept = |pair: &Pair| is_restarted(pair.a) || is_restarted(pair.b);
        let is_new = |pair: &&Pair| {
            restarted.is_empty() || !may_be_kept(pair) || !(kept.contains(**pair) && existed(pair))
        };
        events.added.extend(found.pairs.iter().filter(is_new));
        for &id in world.removed() {
            events.dropped.extend(kept.partners(id).map(|other| Pair::new(id, other)));
        }
        let overlaps = |pair: &Pair| world.boxes[pair.a as usize].overlaps(&world.boxes[pair.b as usize]);
        let allows = |pair: &Pair| world.filters[pair.a as usize].allows(&world.filters[pair.b as usize]);
        for &id in &found.restarted {
            let pairs = kept.partners(id).map(|other| Pair::new(id, other));
            events.removed.extend(pairs.filter(|pair| existed(pair) && !(overlaps(pair) && allows(pair))));
        }
        if !found.is_sorted || !found.restarted.is_empty() {
            events.sort(world.ids());
            events.removed.dedup();
        }
        events.dropped.sort_unstable();
        events.dropped.dedup();
    }
}

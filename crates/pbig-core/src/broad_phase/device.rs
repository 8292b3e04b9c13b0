//! An update on a device: only what has changed goes there, only pairs that were added or removed come back.

use super::BroadPhase;
use super::world::{Old, World};
use crate::all_pairs::Held;
use crate::device::{ChangeRequest, ChangedBox, DeviceFound, PairDevice};
use crate::device_slot::DeviceSlot;
use crate::{Aabb, Backend, Config, Error, Limits, NoDevice, Pair};

impl BroadPhase {
    /// Makes a broad phase with a given device. [`Backend::Device`] always uses it, [`Backend::Auto`] if it is hardware and many boxes
    /// change.
    ///
    /// # Errors
    /// [`Error::Margin`].
    pub fn with_device(config: Config, device: Box<dyn PairDevice>) -> Result<Self, Error> {
        let mut broad_phase = Self::new(config)?;
        broad_phase.set_device(device);
        Ok(broad_phase)
    }

    /// Uses this device, beginning with the first update whose changes are all set after this call. Earlier updates use the CPU.
    pub fn set_device(&mut self, device: Box<dyn PairDevice>) {
        self.device = DeviceSlot::new(device);
        self.world.keep_old = usize::MAX;
    }

    /// Sets where the next updates run, and their limits: for tests and measurements.
    #[doc(hidden)]
    pub fn set_backend(&mut self, backend: Backend, limits: Limits) {
        (self.config.backend, self.config.limits) = (backend, limits);
    }

    /// Returns the name of the device in use. None while there is no device or it has failed.
    pub fn device_name(&self) -> Option<&str> {
        self.device.name()
    }

    /// Leaves the events in `comparison` if a device has found them. False if the CPU has to do it.
    pub(super) fn find_on_device(&mut self) -> Result<bool, Error> {
        let changed = self.world.changed.len();
        if !self.device.is_wanted(&self.config, changed, &mut self.report) {
            return Ok(false);
        }
        if !self.world.knows_old() {
            self.report.plan.no_device = Some(NoDevice::OldBoxesUnknown);
            return Ok(false);
        }
        let Some(found) = self.ask_device()? else { return Ok(false) };
        self.store.held = Held::Nowhere;
        self.sweep.expire();
        self.sort_out(&found);
        Ok(true)
    }

    /// Returns the answer of the device; none if it could not do the work.
    fn ask_device(&mut self) -> Result<Option<DeviceFound>, Error> {
        self.device.begin_update();
        let changed = self.changed_boxes();
        let (World { boxes, filters, .. }, config) = (&self.world, &self.config);
        let (kept, max_pairs) = (self.kept.len() as u64, config.limits.pairs());
        let request = ChangeRequest { boxes, filters, changed: &changed, kept, max_pairs };
        let call = |device: &mut dyn PairDevice, found: &mut _| device.find_changed(&request, found);
        let invalid = self.report.invalid;
        let found = self.device.call(boxes.len(), Vec::new(), config, &mut self.report, call)?;
        self.report.invalid = invalid;
        Ok(found)
    }

    /// Returns the changed boxes as they were at the last update.
    fn changed_boxes(&self) -> Vec<ChangedBox> {
        let world = &self.world;
        let was = |(&id, old): (&u32, &Old)| {
            let aabb = if world.was_removed(id) { Aabb::NOWHERE } else { old.aabb };
            ChangedBox { id, aabb, filter: old.filter }
        };
        world.changed.iter().zip(&world.old).map(was).collect()
    }

    /// Sorts what a device has found into added, removed and dropped pairs.
    fn sort_out(&mut self, found: &DeviceFound) {
        let (world, kept, events) = (&self.world, &self.kept, &mut self.comparison);
        events.clear();
        let was_removed = |pair: &Pair| world.was_removed(pair.a) || world.was_removed(pair.b);
        let existed = |pair: &Pair| !(world.has_removed() && was_removed(pair));
        // A pair that is not kept cannot end, and a kept one cannot begin: a device that says so is wrong, and does no harm. A device
        // reports all pairs of a box that it treats as new.
        let ends = |(pair, is_kept): (Pair, bool)| (is_kept && existed(&pair)).then_some(pair);
        let begins = |(pair, is_kept): (Pair, bool)| (!is_kept || !existed(&pair)).then_some(pair);
        events.removed.extend(kept.look_up(&found.ended).filter_map(ends));
        events.added.extend(kept.look_up(&found.pairs).filter_map(begins));
        for &id in world.removed() {
            events.dropped.extend(kept.partners(id).map(|other| Pair::new(id, other)));
        }
        let overlaps = |pair: &Pair| world.boxes[pair.a as usize].overlaps(&world.boxes[pair.b as usize]);
        let allows = |pair: &Pair| world.filters[pair.a as usize].allows(&world.filters[pair.b as usize]);
        for &id in &found.restarted {
            let pairs = kept.partners(id).map(|other| Pair::new(id, other));
            events.removed.extend(pairs.filter(|pair| existed(pair) && !(overlaps(pair) && allows(pair))));
        }
        events.put_in_order(world.ids());
    }
}

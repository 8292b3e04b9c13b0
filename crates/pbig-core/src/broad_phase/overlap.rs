//! An update in two halves, between which a device works and its caller does something else.
//!
//! From the first to the second nothing that the search depends on changes: calls that would change it wait in a queue.
//! So the events are those of the beginning, whoever finds them, and if the device fails the CPU starts from the same
//! boxes.

use super::{BroadPhase, Events};
use crate::finder::check_count;
#[cfg(feature = "gpu")]
use crate::gpu::Change;
#[cfg(feature = "gpu")]
use crate::plan::NoGpu;
use crate::{Aabb, Error, ProxyFilter};
use std::collections::HashMap;

/// A call that counts from the next update on.
#[derive(Clone, Copy, Debug)]
pub(super) enum Later {
    Set(u32, Aabb, ProxyFilter),
    Remove(u32),
    Margin(f32),
}

/// An update that has begun, if one has.
#[derive(Clone, Debug, Default)]
pub(super) struct Overlap {
    pub(super) begun: bool,
    /// The calls since then, in their order.
    pub(super) later: Vec<Later>,
    /// Ids that they bring or take away, and whether these are there in the end.
    there: HashMap<u32, bool>,
    /// Whether a device is asked, once that is decided.
    #[cfg(feature = "gpu")]
    pub(super) asked: Option<bool>,
    /// Why none is, where that is left open.
    #[cfg(feature = "gpu")]
    pub(super) no_gpu: Option<NoGpu>,
    /// What it is asked about.
    #[cfg(feature = "gpu")]
    pub(super) changes: Vec<Change>,
}

impl BroadPhase {
    /// Begins an update and does not wait for it; [`BroadPhase::finish`] gives its events. A GPU does its work
    /// meanwhile. On the CPU, and where a device has to take the boxes in parts, the work is done in `finish`.
    ///
    /// Until then everything that can be asked tells what was before, and boxes can be set and removed as always: that
    /// counts from the next update on. So an event can be about a box that has been removed since. To begin again
    /// changes nothing.
    ///
    /// Events that are used a step later should know that step's pairs. They do, for every box that is still inside the
    /// one stored for it; so let that reach to where the box is going ([`Aabb::swept`]), and search at once for the
    /// pairs of those that went elsewhere:
    ///
    /// ```
    /// use pbig_core::{Aabb, BroadPhase, Config, Pair, ProxyFilter};
    /// let mut broad_phase = BroadPhase::new(Config { margin: 0.01, ..Config::default() })?;
    /// let (filter, dt) = (ProxyFilter::ALL, 1.0 / 60.0);
    /// let cube = |x: f32| Aabb::from_center([x, 0.0, 0.0], [0.5; 3]);
    /// let motion = [-30.0 * dt, 0.0, 0.0];
    /// broad_phase.set(0, cube(0.0), filter)?;
    /// broad_phase.set(1, cube(1.4), filter)?;
    /// broad_phase.set(2, cube(2.9).swept(motion), filter)?;
    /// broad_phase.begin();
    /// // Meanwhile the app does something else, and a step later two boxes are elsewhere.
    /// let now = [cube(0.5), cube(1.4), cube(2.4)];
    /// assert_eq!(broad_phase.finish()?.added, [Pair::new(1, 2)], "where box 2 was going");
    /// for (id, aabb) in (0..).zip(now) {
    ///     if broad_phase.fat_aabb(id).is_none_or(|fat| !fat.contains(&aabb)) {
    ///         broad_phase.set(id, aabb, filter)?;
    ///     }
    /// }
    /// assert_eq!(broad_phase.update()?.added, [Pair::new(0, 1)], "nobody knew that box 0 would move");
    /// broad_phase.set(2, now[2].swept(motion), filter)?;
    /// broad_phase.begin();
    /// # Ok::<(), pbig_core::Error>(())
    /// ```
    pub fn begin(&mut self) {
        if !self.overlap.begun {
            self.overlap.begun = true;
            #[cfg(feature = "gpu")]
            self.begin_on_gpu();
        }
    }

    /// Finishes the update that [`BroadPhase::begin`] began: what [`BroadPhase::update`] would have found then. One that
    /// has not begun begins now.
    ///
    /// # Errors
    /// [`Error::TooManyPairs`]; the changes are kept, and the next update sees them again.
    pub fn finish(&mut self) -> Result<&Events, Error> {
        self.begin();
        let found = self.find_events();
        self.overlap.begun = false;
        self.catch_up();
        found.map(|()| &self.events)
    }

    /// Whether an update has begun and is not finished.
    #[inline]
    pub fn has_begun(&self) -> bool {
        self.overlap.begun
    }

    #[cold]
    pub(super) fn set_later(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) -> Result<(), Error> {
        check_count(u64::from(id) + 1, &self.config)?;
        if !self.will_contain(id) {
            self.overlap.there.insert(id, true);
        }
        self.overlap.later.push(Later::Set(id, aabb, filter));
        Ok(())
    }

    #[cold]
    pub(super) fn remove_later(&mut self, id: u32) -> bool {
        let was_there = self.will_contain(id);
        if was_there {
            self.overlap.there.insert(id, false);
            self.overlap.later.push(Later::Remove(id));
        }
        was_there
    }

    #[cold]
    pub(super) fn change_margin_later(&mut self, margin: f32) {
        self.overlap.later.push(Later::Margin(margin));
    }

    /// Whether a box is there once the calls so far count.
    fn will_contain(&self, id: u32) -> bool {
        self.overlap.there.get(&id).copied().unwrap_or_else(|| self.contains(id))
    }

    /// How many ids there will be once the calls so far count.
    #[cfg(feature = "serde")]
    pub(super) fn ids_to_come(&self) -> usize {
        let new = |call: &Later| match call {
            Later::Set(id, ..) => *id as usize + 1,
            Later::Remove(_) | Later::Margin(_) => 0,
        };
        let new = self.overlap.later.iter().map(new).max();
        self.boxes.len().max(new.unwrap_or(0))
    }

    /// Makes the calls that have waited.
    fn catch_up(&mut self) {
        let mut later = std::mem::take(&mut self.overlap.later);
        for call in later.drain(..) {
            match call {
                // Ids were checked when they were given.
                Later::Set(id, aabb, filter) => _ = self.set(id, aabb, filter),
                Later::Remove(id) => _ = self.remove(id),
                Later::Margin(margin) => self.config.margin = margin,
            }
        }
        self.overlap.later = later;
        self.overlap.there.clear();
    }
}

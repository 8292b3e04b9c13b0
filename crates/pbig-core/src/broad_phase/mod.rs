//! The incremental form: boxes are set and removed by id, an update tells which pairs were added and removed.
//!
//! ```text
//! set, remove ─► world ─► few changed:  look them up in the tree, compare partners ─► events ─► kept pairs
//!                    └──► many changed: search all boxes, compare rows of pairs ─► events, kept pairs
//! ```

mod look_up;
mod part;
mod query;
mod search;
#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
mod tree;
mod update;
mod world;

use crate::memory::Scratch;
use crate::pairs::{Comparison, Kept};
use crate::policy::{self, PARALLEL_FROM_BOXES};
use crate::report::Report;
use crate::search::DeviceSlot;
use crate::simd::prefetch;
use crate::{Aabb, Algorithm, Backend, Config, Error, Limits, Pair, PairDevice, ProxyFilter};
use look_up::LookUp;
use search::Search;
use tree::Tree;
use world::World;

/// Number of boxes between a prefetch and the use of its box.
const AHEAD: usize = 16;

/// The changes of an update. Both lists are sorted and free of duplicates, and have no pair in common.
///
/// No pair of a removed box is in `removed` (see [`BroadPhase::remove`]). If the box was set again, a pair can be in `added`
/// that existed before.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Events {
    /// Pairs that began: now their fat boxes overlap and their filters allow it, after the previous update they did not.
    pub added: Vec<Pair>,
    /// Pairs that ended: their fat boxes no longer overlap, or their filters no longer allow it.
    pub removed: Vec<Pair>,
}

/// Boxes by id, and the pairs between them, kept from update to update.
///
/// Each box is stored fat, grown by [`Config::margin`]. While a later box stays inside its fat box, at most two margins from each
/// of its sides, nothing has changed and nothing is done. Ids should be dense: each id up to the largest takes 65 bytes, used or
/// not. The tree, grids and pairs come on top.
///
/// An update in which few boxes have changed looks up only these, in a tree of all boxes. An update in which many have changed
/// searches all boxes, and compares the pairs with those of the last update. After a peak it takes time for the boxes that are left.
/// Memory for pairs, events and grids comes back by itself, a piece an update; that for ids and trees by
/// [`BroadPhase::shrink_to_fit`].
///
/// ```
/// use pbig_core::{Aabb, BroadPhase, Config, Pair, ProxyFilter};
/// let mut broad_phase = BroadPhase::new(Config { margin: 0.1, ..Config::default() })?;
/// let cube = |x: f32| Aabb::from_center([x, 0.0, 0.0], [0.5; 3]);
/// broad_phase.set(0, cube(0.0), ProxyFilter::ALL)?;
/// broad_phase.set(1, cube(1.1), ProxyFilter::ALL)?;
/// assert_eq!(broad_phase.update()?.added, [Pair::new(0, 1)]);
/// broad_phase.set(1, cube(3.0), ProxyFilter::ALL)?;
/// assert_eq!(broad_phase.update()?.removed, [Pair::new(0, 1)]);
/// # Ok::<(), pbig_core::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct BroadPhase {
    config: Config,
    device: DeviceSlot,
    world: World,
    given_up: policy::GivenUp,
    /// The algorithm of the last update with changes.
    last: Algorithm,
    look_up: Scratch<LookUp>,
    search: Scratch<Search>,
    comparison: Scratch<Comparison>,
    kept: Kept,
    events: Events,
    report: Report,
}

/// An update: what it reads, and where it leaves the events.
struct Task<'a> {
    world: &'a World,
    tree: &'a mut Tree,
    config: &'a Config,
    kept: &'a mut Kept,
    /// The events. Cleared first, and left sorted.
    comparison: &'a mut Comparison,
    report: &'a mut Report,
}

impl BroadPhase {
    /// Makes an empty broad phase.
    ///
    /// # Errors
    /// [`Error::Margin`].
    pub fn new(config: Config) -> Result<Self, Error> {
        check_margin(config.margin)?;
        Ok(Self { config, ..Self::default() })
    }

    /// Makes a broad phase with a given device, which [`Backend::Device`] uses. [`Backend::Auto`] leaves updates to the CPU.
    ///
    /// # Errors
    /// [`Error::Margin`].
    pub fn with_device(config: Config, device: Box<dyn PairDevice>) -> Result<Self, Error> {
        let mut broad_phase = Self::new(config)?;
        broad_phase.set_device(device);
        Ok(broad_phase)
    }

    /// Uses this device from the next update on.
    pub fn set_device(&mut self, device: Box<dyn PairDevice>) {
        self.device = DeviceSlot::new(device);
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

    /// Changes the margin for boxes that are set from now on.
    ///
    /// # Errors
    /// [`Error::Margin`].
    pub fn set_margin(&mut self, margin: f32) -> Result<(), Error> {
        check_margin(margin)?;
        self.config.margin = margin;
        Ok(())
    }

    /// Inserts a box or moves it. An invalid box pairs with nothing until it becomes valid.
    ///
    /// # Errors
    /// [`Error::TooManyBoxes`] when the id is not below [`crate::Limits::max_boxes`]; [`Error::SparseId`] when it is 2^24
    /// or more, and over 64 times [`BroadPhase::id_count`].
    #[inline(always)]
    pub fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) -> Result<(), Error> {
        let is_set = self.world.set(id, aabb, filter, self.config.margin);
        if is_set { Ok(()) } else { self.insert(id, aabb, filter) }
    }

    /// Sets many boxes, as [`BroadPhase::set`] does one, in the order of `ids`. Many ascending ids are shared among rayon's threads; boxes
    /// that are inserted come last then.
    ///
    /// `of` returns box and filter of an id, or none to leave its box alone. A panic in `of` reaches the caller after some boxes are
    /// set.
    ///
    /// ```
    /// use pbig_core::{Aabb, BroadPhase, ProxyFilter};
    /// let ids: Vec<u32> = (0..10_000).collect();
    /// let mut broad_phase = BroadPhase::default();
    /// let cube = |id: u32| Aabb::from_center([0.9 * id as f32, 0.0, 0.0], [0.5; 3]);
    /// broad_phase.set_many(&ids, |id| Some((cube(id), ProxyFilter::ALL)))?;
    /// assert_eq!(broad_phase.update()?.added.len(), 9_999);
    /// # Ok::<(), pbig_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// The first error of [`BroadPhase::set`]. The other boxes are set.
    pub fn set_many(
        &mut self,
        ids: &[u32],
        of: impl Fn(u32) -> Option<(Aabb, ProxyFilter)> + Sync,
    ) -> Result<(), Error> {
        let mut result = Ok(());
        let mut set = |this: &mut Self, id, aabb, filter| {
            if let Err(error) = this.set(id, aabb, filter)
                && result.is_ok()
            {
                result = Err(error);
            }
        };
        let mut rest = ids;
        if ids.len() >= PARALLEL_FROM_BOXES {
            let (known, new) = ids.split_at(ids.partition_point(|id| (*id as usize) < self.world.ids()));
            if let Some(absent) = self.world.set_many(known, &of, self.config.margin) {
                absent.into_iter().for_each(|(id, aabb, filter)| set(self, id, aabb, filter));
                rest = new;
            }
        }
        for (i, &id) in rest.iter().enumerate() {
            if let Some(&ahead) = rest.get(i + AHEAD) {
                self.prefetch(ahead);
            }
            if let Some((aabb, filter)) = of(id) {
                set(self, id, aabb, filter);
            }
        }
        result
    }

    /// Prefetches the memory of an id that [`BroadPhase::set`] reads.
    #[inline(always)]
    fn prefetch(&self, id: u32) {
        prefetch(self.world.boxes.as_ptr().wrapping_add(id as usize));
        if self.world.noted.is_filtered {
            prefetch(self.world.filters.as_ptr().wrapping_add(id as usize));
        }
    }

    /// Moves a box that keeps its filter. Returns false when there is none.
    #[inline(always)]
    pub fn set_aabb(&mut self, id: u32, aabb: Aabb) -> bool {
        self.world.set_aabb(id, aabb, self.config.margin)
    }

    #[cold]
    fn insert(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) -> Result<(), Error> {
        if id as usize >= self.world.ids() {
            self.config.limits.check_boxes(u64::from(id) + 1)?;
            self.check_density(id)?;
            self.world.reserve_ids(id as usize + 1);
        }
        self.world.insert(id, aabb, filter, self.config.margin);
        Ok(())
    }

    fn check_density(&self, id: u32) -> Result<(), Error> {
        let known = self.world.ids() as u32;
        let is_sparse = id >= policy::SPARSE_FROM_ID && id.div_ceil(policy::MAX_ID_GROWTH) > known;
        if is_sparse { Err(Error::SparseId { id, known }) } else { Ok(()) }
    }

    /// Changes the filter of a box. Returns false when there is none.
    pub fn set_filter(&mut self, id: u32, filter: ProxyFilter) -> bool {
        let has_box = self.world.contains(id);
        if has_box && self.world.filters[id as usize] != filter {
            self.world.change(|all| all.set_filter(id, filter));
        }
        has_box
    }

    /// Removes a box; its pairs end without an event (ask [`BroadPhase::pairs_of`] before if they matter). Returns false
    /// when there was none.
    pub fn remove(&mut self, id: u32) -> bool {
        let has_box = self.world.contains(id);
        if has_box {
            self.world.remove(id);
        }
        has_box
    }

    /// Removes all boxes; their pairs end without an event.
    pub fn clear(&mut self) {
        let device = std::mem::take(&mut self.device);
        *self = Self { config: self.config, device, ..Self::default() };
    }

    /// Gives back the memory that the boxes and pairs at hand do not need.
    pub fn shrink_to_fit(&mut self) {
        self.world.shrink();
        self.kept.shrink(self.world.ids());
        (self.look_up, self.search, self.comparison) = Default::default();
        self.events.added.shrink_to_fit();
        self.events.removed.shrink_to_fit();
    }
}

fn check_margin(margin: f32) -> Result<(), Error> {
    if margin.is_finite() && margin >= 0.0 { Ok(()) } else { Err(Error::Margin { margin }) }
}

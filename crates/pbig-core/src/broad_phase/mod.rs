//! The incremental facade: boxes are set and removed, an update tells which pairs came and went.

#[cfg(test)]
mod allocations;
#[cfg(feature = "gpu")]
mod device;
mod overlap;
#[cfg(feature = "serde")]
mod snapshot;
mod state;
mod update;

use crate::cpu::emit;
use crate::cpu::map::Map;
use crate::cpu::record::Tracked;
use crate::diff::PairStore;
use crate::finder::check_count;
#[cfg(feature = "gpu")]
use crate::gpu::GpuFinder;
use crate::report::{Report, lap, stage};
use crate::search::Search;
use crate::{Aabb, Backend, Config, Error, Pair, Plan, ProxyFilter};
use overlap::Overlap;
use std::collections::HashMap;
use std::time::Instant;

/// What an update changed. Both lists are sorted and free of duplicates, and have no pair in common.
///
/// A box that was removed (see [`BroadPhase::remove`]) is in neither list, and one that was removed
/// and set again can be in `added` although its pair was there before.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Events {
    /// Pairs that overlap now (fat boxes) and did not after the last update.
    pub added: Vec<Pair>,
    /// Pairs that did and no longer do.
    pub removed: Vec<Pair>,
}

/// What a box with another filter was at the last update.
#[derive(Clone, Copy, Debug)]
struct Old {
    aabb: Aabb,
    filter: ProxyFilter,
}

/// What is known about an id, a bit each.
mod flag {
    /// It was set and not removed.
    pub(super) const PRESENT: u8 = 1;
    /// Box or filter have changed since the last update.
    pub(super) const CHANGED: u8 = 2;
    /// The filter has.
    pub(super) const REFILTERED: u8 = 4;
    /// The box is not in the base: it has left its cell since that was built, or is new.
    pub(super) const LOOSE: u8 = 8;
    /// The device has told that the box has lost pairs.
    #[cfg(feature = "gpu")]
    pub(super) const ENDING: u8 = 16;
}

/// Boxes by id, and the pairs between them, kept from update to update.
///
/// Each box is stored fat, grown by [`Config::margin`]; while later boxes stay inside, nothing has
/// changed and nothing is done (contract 5). Ids should be dense: memory follows the largest.
///
/// All boxes lie in a base grid. Where few change, those that stay in their cells are overwritten there; the others
/// are sorted into a second, small grid each time, until they come back. Changed boxes are searched in both. When an
/// eighth of all boxes changes or has left its cell the base is built anew, and now and then so that boxes at rest
/// return to it.
/// ([`crate::Strategy::Pbig`] and [`crate::Backend::Brute`] search everything at every update that changes
/// something. A GPU is told what has changed, and tells which pairs came or went.)
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
#[derive(Clone, Debug)]
pub struct BroadPhase {
    config: Config,
    /// By id: the fat box; [`Aabb::NOWHERE`] when absent or invalid.
    boxes: Vec<Aabb>,
    /// By id: the fat box at the last update; [`Aabb::NOWHERE`] for one that came since, and for one whose filter has
    /// changed since.
    before: Vec<Aabb>,
    filters: Vec<ProxyFilter>,
    /// By id: see [`flag`].
    flags: Vec<u8>,
    present_count: u32,
    invalid_count: u32,
    /// Boxes changed since the last update.
    changed: Vec<u32>,
    refiltered: HashMap<u32, Old>,
    /// Updates that have changed something.
    updates: u64,
    /// An update that has begun and is not finished.
    overlap: Overlap,
    /// Boxes that have lost pairs, as far as the device can tell.
    #[cfg(feature = "gpu")]
    ending: Vec<u32>,
    /// The loose boxes.
    moved: Vec<u32>,
    /// Boxes sorted in updates since the base was built.
    sorted_again: usize,
    base: Search<Tracked>,
    /// Whether `base.map` holds the boxes whose home it is: not after a search by anything else.
    has_base: bool,
    /// The loose boxes; `base.map` holds the rest.
    loose: Map<Tracked>,
    /// The changed boxes, to be looked up in both.
    others: Vec<Tracked>,
    pairs: PairStore,
    events: Events,
    /// For added and for removed ones.
    sorting: [emit::Scratch; 2],
    report: Report,
}

impl BroadPhase {
    /// An empty broad phase.
    ///
    /// # Errors
    /// [`Error::Margin`].
    pub fn new(config: Config) -> Result<Self, Error> {
        check_margin(config.margin)?;
        Ok(Self {
            config,
            boxes: vec![],
            before: vec![],
            filters: vec![],
            flags: vec![],
            present_count: 0,
            invalid_count: 0,
            changed: vec![],
            refiltered: HashMap::new(),
            updates: 0,
            overlap: Overlap::default(),
            #[cfg(feature = "gpu")]
            ending: vec![],
            moved: vec![],
            sorted_again: 0,
            base: Search::new(),
            has_base: false,
            loose: Map::new(),
            others: vec![],
            pairs: PairStore::default(),
            events: Events::default(),
            sorting: Default::default(),
            report: Report::default(),
        })
    }

    /// As [`BroadPhase::new`], on a given device, see [`crate::Finder::with_gpu`].
    ///
    /// # Errors
    /// [`Error::Margin`].
    #[cfg(feature = "gpu")]
    pub fn with_gpu(config: Config, gpu: GpuFinder) -> Result<Self, Error> {
        let mut broad_phase = Self::new(config)?;
        broad_phase.base.gpu = Some(gpu);
        Ok(broad_phase)
    }

    /// The adapter of the device in use, see [`crate::Finder::adapter`].
    #[cfg(feature = "gpu")]
    pub fn adapter(&self) -> Option<&str> {
        self.base.adapter()
    }

    /// Goes on with this device, from the next update, see [`crate::Finder::with_gpu`].
    #[cfg(feature = "gpu")]
    pub fn set_gpu(&mut self, gpu: GpuFinder) {
        self.base.gpu = Some(gpu);
    }

    /// Changes the margin for boxes that are set from now on.
    ///
    /// # Errors
    /// [`Error::Margin`].
    pub fn set_margin(&mut self, margin: f32) -> Result<(), Error> {
        check_margin(margin)?;
        if self.has_begun() {
            self.change_margin_later(margin);
        } else {
            self.config.margin = margin;
        }
        Ok(())
    }

    /// The settings in force.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Inserts a box or moves it. An invalid box pairs with nothing until it becomes valid.
    ///
    /// # Errors
    /// [`Error::TooManyBoxes`] when the id is not below [`crate::Limits::max_boxes`].
    #[inline]
    pub fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) -> Result<(), Error> {
        if self.has_begun() {
            return self.set_later(id, aabb, filter);
        }
        let i = id as usize;
        if i >= self.boxes.len() {
            self.make_room_for(id)?;
        }
        let valid = aabb.is_valid();
        if self.flags[i] & flag::PRESENT == 0 {
            self.note_change(id);
            self.flags[i] |= flag::PRESENT;
            self.present_count += 1;
            self.invalid_count += 1;
            self.filters[i] = filter;
            self.put(i, aabb, valid);
            return Ok(());
        }
        if !self.still_holds(&self.boxes[i], &aabb, valid) {
            self.note_change(id);
            self.put(i, aabb, valid);
        }
        if !self.filters[i].is(&filter) {
            self.note_change(id);
            self.note_filter(id);
            self.filters[i] = filter;
        }
        Ok(())
    }

    /// Stores a box fat, invalid ones as [`Aabb::NOWHERE`], so that nothing later can pair them.
    #[inline]
    fn put(&mut self, i: usize, aabb: Aabb, valid: bool) {
        let stored = &mut self.boxes[i];
        let was_valid = !stored.min[0].is_nan();
        *stored = if valid { aabb.inflated(self.config.margin) } else { Aabb::NOWHERE };
        self.invalid_count = self.invalid_count + u32::from(was_valid) - u32::from(valid);
    }

    /// Removes a box; its pairs end without an event (ask [`BroadPhase::pairs_of`] before if they
    /// matter). False when there was none.
    pub fn remove(&mut self, id: u32) -> bool {
        if self.has_begun() {
            return self.remove_later(id);
        }
        let i = id as usize;
        if !self.contains(id) {
            return false;
        }
        self.pairs.remove_of(id);
        self.note_change(id);
        // Whatever is set at this id next is a new box: it had no pairs before.
        self.before[i] = Aabb::NOWHERE;
        self.refiltered.remove(&id);
        self.put(i, Aabb::NOWHERE, false);
        self.flags[i] &= !(flag::PRESENT | flag::REFILTERED);
        self.present_count -= 1;
        self.invalid_count -= 1;
        true
    }

    /// Finds what has changed since the last update. Costs next to nothing when nothing has. The same as
    /// [`BroadPhase::begin`] and [`BroadPhase::finish`]: one that has begun already is finished.
    ///
    /// # Errors
    /// [`Error::TooManyPairs`]; the changes are kept, and the next update sees them again.
    pub fn update(&mut self) -> Result<&Events, Error> {
        self.finish()
    }

    /// All of an update, but what a device has begun.
    fn find_events(&mut self) -> Result<(), Error> {
        self.events.added.clear();
        self.events.removed.clear();
        self.report = Report {
            boxes: u64::from(self.present_count),
            invalid: u64::from(self.invalid_count),
            changed: self.changed.len() as u64,
            pairs: self.pairs.len() as u64,
            plan: Plan { boxes: self.valid_count(), ..Plan::default() },
            // A backend that was asked for stays unavailable until a search on it succeeds.
            fallback: self.report.fallback.take().filter(|_| self.config.backend == Backend::Gpu),
            ..Report::default()
        };
        if self.changed.is_empty() {
            return Ok(());
        }
        self.pairs.drop_removed();
        let found = self.find_added().and_then(|on_gpu| self.check_room().map(|()| on_gpu));
        let on_gpu = found.inspect_err(|_| self.events.added.clear())?;
        let mut clock = Instant::now();
        {
            stage!("diff");
            self.find_removed(on_gpu);
            self.store();
            self.report.stages.diff += lap(&mut clock);
        }
        stage!("emit");
        self.sort_events();
        self.report.stages.emit += lap(&mut clock);
        self.report.pairs = self.pairs.len() as u64;
        Ok(())
    }

    fn valid_count(&self) -> u32 {
        self.present_count - self.invalid_count
    }

    #[cold]
    fn make_room_for(&mut self, id: u32) -> Result<(), Error> {
        check_count(u64::from(id) + 1, &self.config)?;
        self.make_room(id as usize + 1);
        Ok(())
    }

    fn make_room(&mut self, ids: usize) {
        self.boxes.resize(ids, Aabb::NOWHERE);
        self.before.resize(ids, Aabb::NOWHERE);
        self.filters.resize(ids, ProxyFilter::ALL);
        self.flags.resize(ids, 0);
        self.pairs.reserve_ids(ids);
    }

    /// Whether a fat box still contains the box, and by no more than twice the margin: a box that
    /// has shrunk is stored anew, so that only boxes near each other pair.
    #[inline]
    fn still_holds(&self, fat: &Aabb, aabb: &Aabb, valid: bool) -> bool {
        // A little less than two margins: the gaps below are rounded.
        let slack = 2.0 * self.config.margin * (1.0 - 2.0 * f32::EPSILON);
        // Equal first: the difference of equal infinities is NaN. No branches: which side of a box has moved is a coin
        // toss, and six of them took 30 ns.
        let near = |outer: f32, inner: f32, gap: f32| (outer == inner) | ((gap >= 0.0) & (gap <= slack));
        let mut holds = valid;
        for k in 0..3 {
            holds &= near(fat.min[k], aabb.min[k], aabb.min[k] - fat.min[k]);
            holds &= near(fat.max[k], aabb.max[k], fat.max[k] - aabb.max[k]);
        }
        holds || (!valid && !fat.is_valid())
    }

    /// The first time after an update that a box or its filter change.
    #[inline]
    fn note_change(&mut self, id: u32) {
        let flags = &mut self.flags[id as usize];
        if *flags & flag::CHANGED == 0 {
            *flags |= flag::CHANGED;
            self.changed.push(id);
        }
    }

    /// Remembers what a box was with its former filter, the first time that it gets another one.
    #[cold]
    fn note_filter(&mut self, id: u32) {
        let i = id as usize;
        if self.flags[i] & flag::REFILTERED == 0 {
            self.flags[i] |= flag::REFILTERED;
            let aabb = std::mem::replace(&mut self.before[i], Aabb::NOWHERE);
            self.refiltered.insert(id, Old { aabb, filter: self.filters[i] });
        }
    }
}

fn check_margin(margin: f32) -> Result<(), Error> {
    if margin.is_finite() && margin >= 0.0 { Ok(()) } else { Err(Error::Margin { margin }) }
}

//! The incremental facade: boxes are set and removed, an update tells which pairs came and went.

#[cfg(test)]
mod allocations;
#[cfg(feature = "gpu")]
mod device;
mod edits;
mod fat;
mod flag;
mod many;
mod measured;
mod near;
mod rebuild;
mod small;
#[cfg(feature = "serde")]
mod snapshot;
mod state;
#[cfg(test)]
mod tests;
mod turns;
mod update;

use crate::cpu::emit;
use crate::cpu::found::Found;
use crate::cpu::record::Tracked;
use crate::diff::PairStore;
use crate::finder::check_count;
#[cfg(feature = "gpu")]
use crate::gpu::GpuFinder;
use crate::report::{Checks, Report, StageTimes, Watch, stage};
use crate::search::Search;
use crate::{Aabb, Backend, Config, Error, Pair, Plan, ProxyFilter};
use fat::still_holds;
use std::collections::HashMap;
use std::time::Instant;
use turns::Turn;
use update::Route;

/// Changed boxes of a small world from which its stages are timed: a reading of the clock takes as long as one box.
const MEASURED_FROM: usize = 64;

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

/// Boxes by id, and the pairs between them, kept from update to update.
///
/// Each box is stored fat, grown by [`Config::margin`]; while later boxes stay inside, nothing has
/// changed and nothing is done. Ids should be dense: memory follows the largest.
///
/// On the CPU up to 1024 boxes are kept in a bitmap index, in which changed boxes are looked up, unless many change and that
/// turns out to take longer than what follows. More lie in a base grid. Where few change they are put into other cells, and
/// only they are searched. Where so many change that this takes longer than a search of all, it is built anew; which takes less is
/// measured. Where motion is small, pairs of boxes that are near each other are found for many updates at once, and an
/// update only tests these.
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
    /// Of ranges of ids; for `set_many`, empty between calls.
    rests: Vec<many::Rest>,
    refiltered: HashMap<u32, Old>,
    /// Updates that have changed something.
    updates: u64,
    /// What a device is asked about, and why none is.
    #[cfg(feature = "gpu")]
    asked: device::Asked,
    /// Boxes that have lost pairs, as far as the device can tell.
    #[cfg(feature = "gpu")]
    ending: Vec<u32>,
    base: Search<Tracked>,
    small: small::Small,
    near: near::Near,
    rebuild: rebuild::Rebuild,
    /// Whether `base.map` holds the boxes whose home it is: not after a search by anything else, and not while it
    /// holds reaches (see `near`).
    has_base: bool,
    /// As it was built.
    base_plan: Plan,
    base_checks: u64,
    /// Tests since then that another one would have saved.
    strain: u64,
    found: Found,
    /// The changed boxes, to be looked up in it.
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
            rests: vec![],
            refiltered: HashMap::new(),
            updates: 0,
            #[cfg(feature = "gpu")]
            asked: device::Asked::default(),
            #[cfg(feature = "gpu")]
            ending: vec![],
            base: Search::new(),
            small: small::Small::default(),
            near: near::Near::default(),
            rebuild: rebuild::Rebuild::default(),
            has_base: false,
            base_plan: Plan::default(),
            base_checks: 0,
            strain: 0,
            found: Found::default(),
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
        self.config.margin = margin;
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
    #[inline(always)]
    pub fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) -> Result<(), Error> {
        let i = id as usize;
        let valid = aabb.is_valid();
        if self.flags.get(i).is_none_or(|flags| flags & flag::PRESENT == 0) {
            return self.insert(id, aabb, filter);
        }
        if !still_holds(&self.boxes[i], &aabb, valid, self.config.margin) {
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

    #[cold]
    fn insert(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) -> Result<(), Error> {
        let i = id as usize;
        if i >= self.boxes.len() {
            check_count(u64::from(id) + 1, &self.config)?;
            self.make_room(i + 1);
        }
        self.note_change(id);
        self.flags[i] |= flag::PRESENT;
        self.present_count += 1;
        self.invalid_count += 1;
        self.filters[i] = filter;
        self.put(i, aabb, aabb.is_valid());
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

    /// Finds what has changed since the last update. Costs next to nothing when nothing has.
    ///
    /// # Errors
    /// [`Error::TooManyPairs`]; the changes are kept, and the next update sees them again.
    pub fn update(&mut self) -> Result<&Events, Error> {
        self.find_events()?;
        Ok(&self.events)
    }

    fn find_events(&mut self) -> Result<(), Error> {
        self.events.added.clear();
        self.events.removed.clear();
        self.begin_report();
        if self.changed.is_empty() {
            self.report.pairs = self.pair_count() as u64;
            return Ok(());
        }
        let is_small = self.is_small();
        let is_timed = !is_small || self.changed.len() >= MEASURED_FROM;
        let (clock, mut watch) = (is_timed.then(Instant::now), Watch::new(is_timed));
        let found =
            if is_small { self.find_in_small(&mut watch).map(|()| Route::Few) } else { self.find_added() };
        let found = found.and_then(|route| self.check_room(route).map(|()| route));
        let route = found.inspect_err(|_| self.take_back())?;
        if !is_small {
            self.small.pass();
            watch.lap();
        }
        {
            stage!("diff");
            self.find_removed(route);
            self.store(route);
            self.report.stages.diff += watch.lap();
        }
        stage!("emit");
        self.sort_events();
        self.report.stages.emit += watch.lap();
        self.report_measured();
        if !is_small && self.updates > 1 {
            let (changed, time) = (self.report.changed as usize, self.report.stages.total());
            let present = self.present_count as usize;
            if !self.near.worth.failed {
                self.near.worth.note_time(route, changed, present, time);
                self.rebuild.note(route, changed, present, time);
            }
        }
        self.take_turns(if is_small { Turn::Bitmap } else { Turn::Grid }, clock);
        self.report.pairs = self.pair_count() as u64;
        Ok(())
    }

    /// After an update that ends with an error pairs and changes are what they were, for the next one to begin from.
    fn take_back(&mut self) {
        self.events.added.clear();
        self.report.pairs = self.pair_count() as u64;
        #[cfg(feature = "gpu")]
        self.take_back_on_gpu();
    }

    /// A report of nothing done yet. Field by field: to make and drop whole ones took longer than to search ten boxes.
    fn begin_report(&mut self) {
        let boxes = self.valid_count();
        let report = &mut self.report;
        (report.stages, report.checks) = (StageTimes::default(), Checks::default());
        (report.boxes, report.invalid) = (u64::from(self.present_count), u64::from(self.invalid_count));
        report.changed = self.changed.len() as u64;
        report.plan.begin(boxes);
        report.gpu = None;
        // A backend that was asked for stays unavailable until a search on it succeeds.
        if self.config.backend != Backend::Gpu {
            report.fallback = None;
        }
    }

    fn valid_count(&self) -> u32 {
        self.present_count - self.invalid_count
    }

    fn make_room(&mut self, ids: usize) {
        self.boxes.resize(ids, Aabb::NOWHERE);
        self.before.resize(ids, Aabb::NOWHERE);
        self.filters.resize(ids, ProxyFilter::ALL);
        self.flags.resize(ids, 0);
        self.pairs.reserve_ids(ids);
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

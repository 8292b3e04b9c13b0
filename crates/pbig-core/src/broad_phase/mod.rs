//! The incremental facade: boxes are set and removed, an update tells which pairs came and went.

#[cfg(feature = "serde")]
mod snapshot;
mod update;

use crate::cpu::find::Found;
use crate::cpu::map::Map;
use crate::diff::PairStore;
use crate::finder::{Search, check_count};
#[cfg(feature = "gpu")]
use crate::gpu::GpuFinder;
use crate::plan::OccupiedCell;
use crate::report::{Report, lap, stage};
use crate::{Aabb, Backend, Config, Error, Pair, Plan, ProxyFilter};
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

/// What a changed box was at the last update.
#[derive(Clone, Copy, Debug)]
struct Old {
    id: u32,
    aabb: Aabb,
    filter: ProxyFilter,
}

/// No place: the box has not changed.
const UNCHANGED: u32 = u32::MAX;

/// Where the entry of a box is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Home {
    /// In neither grid, or only as a stale entry in the base.
    None,
    /// In the base grid, up to date.
    Base,
    /// Among the boxes that moved since the base was built.
    Moved,
}

/// Boxes by id, and the pairs between them, kept from update to update.
///
/// Each box is stored fat, grown by [`Config::margin`]; while later boxes stay inside, nothing has
/// changed and nothing is done (contract 5). Ids should be dense: memory follows the largest.
///
/// Settled boxes lie in a base grid. Boxes that have moved since it was built are taken out and
/// sorted into a second, small one each time; changed boxes are searched in both. When an eighth of
/// all boxes has moved, the base is built anew, and now and then so that boxes at rest return to it.
/// ([`crate::Strategy::Pbig`], [`crate::Backend::Brute`] and [`crate::Backend::Gpu`] search everything at
/// every update that changes something.)
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
    filters: Vec<ProxyFilter>,
    present: Vec<bool>,
    present_count: u32,
    invalid_count: u32,
    /// Boxes changed since the last update, and by id the place in that list.
    changed: Vec<Old>,
    change_of: Vec<u32>,
    home: Vec<Home>,
    moved: Vec<u32>,
    /// Boxes sorted in updates since the base was built.
    sorted_again: usize,
    base: Search,
    /// Whether `base.map` holds the boxes whose home it is: not after a search by anything else.
    has_base: bool,
    /// The boxes that moved; `base.map` holds the rest.
    loose: Map,
    found: Found,
    pairs: PairStore,
    ended: Vec<u32>,
    events: Events,
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
            filters: vec![],
            present: vec![],
            present_count: 0,
            invalid_count: 0,
            changed: vec![],
            change_of: vec![],
            home: vec![],
            moved: vec![],
            sorted_again: 0,
            base: Search::new(),
            has_base: false,
            loose: Map::new(),
            found: Found::default(),
            pairs: PairStore::default(),
            ended: vec![],
            events: Events::default(),
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
    pub fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) -> Result<(), Error> {
        let i = id as usize;
        if i >= self.boxes.len() {
            check_count(u64::from(id) + 1, &self.config)?;
            self.make_room(i + 1);
        }
        if self.present[i] {
            let keeps_box = self.still_holds(&self.boxes[i], &aabb);
            if keeps_box && self.filters[i] == filter {
                return Ok(());
            }
            self.note_change(id, self.boxes[i], self.filters[i]);
            if !keeps_box {
                self.put(i, self.fat(&aabb));
            }
        } else {
            self.note_change(id, Aabb::NOWHERE, filter);
            self.present[i] = true;
            self.present_count += 1;
            self.invalid_count += 1;
            self.put(i, self.fat(&aabb));
        }
        self.filters[i] = filter;
        Ok(())
    }

    /// Stores a fat box, invalid ones as [`Aabb::NOWHERE`], so that nothing later can pair them.
    fn put(&mut self, i: usize, fat: Aabb) {
        let (was, is) = (self.boxes[i].is_valid(), fat.is_valid());
        self.invalid_count = self.invalid_count + u32::from(was) - u32::from(is);
        self.boxes[i] = if is { fat } else { Aabb::NOWHERE };
    }

    /// Removes a box; its pairs end without an event (ask [`BroadPhase::pairs_of`] before if they
    /// matter). False when there was none.
    pub fn remove(&mut self, id: u32) -> bool {
        let i = id as usize;
        if !self.contains(id) {
            return false;
        }
        self.ended.clear();
        self.ended.extend(self.pairs.of(id).map(|(place, _)| place));
        self.pairs.remove_all(&mut self.ended);
        // Whatever is set at this id next is a new box: it had no pairs before.
        self.note_change(id, Aabb::NOWHERE, self.filters[i]);
        self.changed[self.change_of[i] as usize].aabb = Aabb::NOWHERE;
        self.put(i, Aabb::NOWHERE);
        self.present[i] = false;
        self.present_count -= 1;
        self.invalid_count -= 1;
        true
    }

    /// Finds what has changed since the last update. Costs next to nothing when nothing has.
    ///
    /// # Errors
    /// [`Error::TooManyPairs`]; the changes are kept, and the next update sees them again.
    pub fn update(&mut self) -> Result<&Events, Error> {
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
            return Ok(&self.events);
        }
        if let Err(error) = self.find_added() {
            self.events.added.clear();
            return Err(error);
        }
        let mut clock = Instant::now();
        stage!("diff");
        self.find_removed();
        self.store();
        self.report.stages.diff += lap(&mut clock);
        self.report.pairs = self.pairs.len() as u64;
        Ok(&self.events)
    }

    /// The events of the last update.
    pub fn events(&self) -> &Events {
        &self.events
    }

    /// What the last update did.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// How many pairs exist: those of the last update, less those of boxes removed since.
    pub fn pair_count(&self) -> usize {
        self.pairs.len()
    }

    /// The pairs that exist (see [`BroadPhase::pair_count`]), in no particular order.
    pub fn pairs(&self) -> impl Iterator<Item = Pair> {
        self.pairs.iter().map(|(_, pair)| pair)
    }

    /// The pairs of one box (see [`BroadPhase::pair_count`]), in no particular order.
    pub fn pairs_of(&self, id: u32) -> impl Iterator<Item = Pair> {
        self.pairs.of(id).map(|(_, pair)| pair)
    }

    /// How many pairs a box has (see [`BroadPhase::pair_count`]).
    pub fn degree(&self, id: u32) -> u32 {
        self.pairs.degree(id)
    }

    /// Whether two boxes are a pair (see [`BroadPhase::pair_count`]).
    pub fn has_pair(&self, pair: Pair) -> bool {
        let fewer = if self.degree(pair.b) < self.degree(pair.a) { pair.b } else { pair.a };
        self.pairs_of(fewer).any(|one| one == pair)
    }

    /// One more than the largest id that was ever set.
    pub fn id_count(&self) -> u32 {
        self.boxes.len() as u32
    }

    /// Whether a box was set and not removed, valid or not.
    pub fn contains(&self, id: u32) -> bool {
        self.present.get(id as usize).copied().unwrap_or(false)
    }

    /// Ids of boxes that the next update will look at: set beyond their margin, given another filter,
    /// or removed since the last one.
    pub fn changes(&self) -> impl Iterator<Item = u32> {
        self.changed.iter().map(|old| old.id)
    }

    /// The filter of a box.
    pub fn filter(&self, id: u32) -> Option<&ProxyFilter> {
        self.filters.get(id as usize).filter(|_| self.contains(id))
    }

    /// The cells of the CPU's grids that boxes lie in, level by level, for a picture of them; none where the
    /// boxes are searched without grids or on a GPU. Takes time and memory proportional to the boxes.
    pub fn cells(&self) -> Vec<OccupiedCell> {
        let mut cells = Vec::new();
        if self.has_base {
            self.base.map.cells(|id| self.home[id as usize] == Home::Base, &mut cells);
            self.loose.cells(|id| self.home[id as usize] == Home::Moved, &mut cells);
        }
        cells
    }

    /// The stored (fat) box, if there is one and it is valid.
    pub fn fat_aabb(&self, id: u32) -> Option<Aabb> {
        self.boxes.get(id as usize).copied().filter(Aabb::is_valid)
    }

    fn valid_count(&self) -> u32 {
        self.present_count - self.invalid_count
    }

    fn make_room(&mut self, ids: usize) {
        self.boxes.resize(ids, Aabb::NOWHERE);
        self.filters.resize(ids, ProxyFilter::ALL);
        self.present.resize(ids, false);
        self.change_of.resize(ids, UNCHANGED);
        self.home.resize(ids, Home::None);
        self.pairs.reserve_ids(ids);
    }

    fn fat(&self, aabb: &Aabb) -> Aabb {
        if aabb.is_valid() { aabb.inflated(self.config.margin) } else { Aabb::NOWHERE }
    }

    /// Whether a fat box still contains the box, and by no more than twice the margin: a box that
    /// has shrunk is stored anew, so that only boxes near each other pair.
    #[inline]
    fn still_holds(&self, fat: &Aabb, aabb: &Aabb) -> bool {
        // A little less than two margins: the gaps below are rounded.
        let slack = 2.0 * self.config.margin * (1.0 - 2.0 * f32::EPSILON);
        // The comparison first: the difference of equal infinities is NaN.
        let near = |outer: f32, inner: f32, gap: f32| outer == inner || (0.0..=slack).contains(&gap);
        let axis = |k: usize| {
            near(fat.min[k], aabb.min[k], aabb.min[k] - fat.min[k])
                & near(fat.max[k], aabb.max[k], fat.max[k] - aabb.max[k])
        };
        let both_invalid = !fat.is_valid() && !aabb.is_valid();
        both_invalid || (aabb.is_valid() && axis(0) & axis(1) & axis(2))
    }

    /// Remembers what a box was, the first time it changes after an update.
    fn note_change(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) {
        let i = id as usize;
        if self.change_of[i] == UNCHANGED {
            self.change_of[i] = self.changed.len() as u32;
            self.changed.push(Old { id, aabb, filter });
        }
    }
}

fn check_margin(margin: f32) -> Result<(), Error> {
    if margin.is_finite() && margin >= 0.0 { Ok(()) } else { Err(Error::Margin { margin }) }
}

//! The incremental facade: boxes are set and removed, an update tells which pairs came and went.

use crate::cpu::check::Checker;
use crate::cpu::find::Found;
use crate::cpu::map::Map;
use crate::diff::PairStore;
use crate::finder::{Search, check_count, fallback, single_entry_checks};
use crate::plan::{Chosen, Plan, Summary};
use crate::report::{Report, lap};
use crate::{Aabb, Backend, Config, Error, Pair, ProxyFilter, Strategy};
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
/// all boxes has moved, the base is built anew.
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
    base: Search,
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
            base: Search::new(),
            loose: Map::new(),
            found: Found::default(),
            pairs: PairStore::default(),
            ended: vec![],
            events: Events::default(),
            report: Report::default(),
        })
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
        if !self.present.get(i).copied().unwrap_or(false) {
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
            plan: Plan { boxes: self.present_count - self.invalid_count, ..Plan::default() },
            ..Report::default()
        };
        if self.changed.is_empty() {
            return Ok(&self.events);
        }
        self.report.fallback = fallback(&self.config);
        if let Err(error) = self.find_added() {
            self.events.added.clear();
            return Err(error);
        }
        let mut clock = Instant::now();
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

    /// Pairs that exist after the last update.
    pub fn pair_count(&self) -> usize {
        self.pairs.len()
    }

    /// The pairs that exist after the last update, in no particular order.
    pub fn pairs(&self) -> impl Iterator<Item = Pair> {
        self.pairs.iter().map(|(_, pair)| pair)
    }

    /// The pairs of one box after the last update, in no particular order.
    pub fn pairs_of(&self, id: u32) -> impl Iterator<Item = Pair> {
        self.pairs.of(id).map(|(_, pair)| pair)
    }

    /// How many pairs a box has after the last update.
    pub fn degree(&self, id: u32) -> u32 {
        self.pairs.degree(id)
    }

    /// The stored (fat) box, if there is one and it is valid.
    pub fn fat_aabb(&self, id: u32) -> Option<Aabb> {
        self.boxes.get(id as usize).copied().filter(Aabb::is_valid)
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
        let slack = 2.0 * self.config.margin;
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

    /// Pairs that overlap now and did not, into `events.added`.
    fn find_added(&mut self) -> Result<(), Error> {
        for old in &self.changed {
            if std::mem::replace(&mut self.home[old.id as usize], Home::Moved) != Home::Moved {
                self.moved.push(old.id);
            }
        }
        let whole = self.config.strategy == Strategy::Pbig || self.config.backend == Backend::Brute;
        if whole || self.moved.len() * 8 >= self.present_count as usize {
            self.search_all()?;
        } else {
            self.search_moved()?;
        }
        let mut clock = Instant::now();
        self.events.added.sort_unstable();
        self.report.stages.emit += lap(&mut clock);
        Ok(())
    }

    /// Builds the base anew from all boxes and searches it.
    fn search_all(&mut self) -> Result<(), Error> {
        let state = State {
            boxes: &self.boxes,
            filters: &self.filters,
            changed: &self.changed,
            change_of: &self.change_of,
        };
        let (boxes, invalid) = (self.report.boxes, self.report.invalid);
        let accept = |a: u32, b: u32| state.is_added(a, b);
        self.base.find(&self.boxes, &self.config, &accept, &mut self.report)?;
        (self.report.boxes, self.report.invalid) = (boxes, invalid);
        for id in self.moved.drain(..) {
            self.home[id as usize] = Home::None;
        }
        // A search by another strategy leaves no base grid to keep.
        let kept = if self.report.plan.chosen == Chosen::Pbig { Home::None } else { Home::Base };
        for (home, aabb) in self.home.iter_mut().zip(&self.boxes) {
            *home = if aabb.is_valid() { kept } else { Home::None };
        }
        self.base.found.chunks.iter().for_each(|chunk| self.events.added.extend_from_slice(chunk));
        Ok(())
    }

    /// Sorts the boxes that moved since the base was built, and searches them and the base.
    fn search_moved(&mut self) -> Result<(), Error> {
        let mut clock = Instant::now();
        let summary = Summary::of(&self.boxes, Some(&self.moved));
        let stages = &mut self.report.stages;
        stages.plan += lap(&mut clock);
        let plan = self.loose.plan_and_build(&summary, &self.config, &self.boxes, Some(&self.moved), stages);
        let state = State {
            boxes: &self.boxes,
            filters: &self.filters,
            changed: &self.changed,
            change_of: &self.change_of,
        };
        let max_pairs = self.config.limits.max_pairs;
        let mut clock = Instant::now();
        self.loose.find(&|a, b| state.is_added(a, b), max_pairs, &mut self.found)?;
        self.found.chunks.iter().for_each(|chunk| self.events.added.extend_from_slice(chunk));
        // Entries of boxes that have left the base are still in it: their home says so.
        let accept = |a: u32, b: u32| self.home[b as usize] == Home::Base && state.is_added(a, b);
        let mut checker = Checker::new(&accept, &mut self.events.added);
        for old in &self.changed {
            let aabb = self.boxes[old.id as usize];
            if aabb.is_valid() {
                self.base.map.check_one(&aabb, old.id, &mut checker);
            }
            if checker.out.len() as u64 > max_pairs {
                return Err(Error::TooManyPairs { limit: max_pairs });
            }
        }
        self.found.checks += checker.checks;
        self.found.overlaps += checker.overlaps;
        self.report.stages.check += lap(&mut clock);
        self.report.checks = single_entry_checks(&self.found);
        let moved = self.moved.len() as u32;
        self.report.plan = Plan { chosen: Chosen::Edit, moved, boxes: self.present_count, ..plan };
        Ok(())
    }

    /// Kept pairs that no longer hold, into `events.removed` and, by place, `ended`.
    fn find_removed(&mut self) {
        let state = State {
            boxes: &self.boxes,
            filters: &self.filters,
            changed: &self.changed,
            change_of: &self.change_of,
        };
        let (ended, removed) = (&mut self.ended, &mut self.events.removed);
        ended.clear();
        let mut end = |(place, pair): (u32, Pair)| {
            if !state.holds_now(pair.a, pair.b) {
                ended.push(place);
                removed.push(pair);
            }
        };
        if self.changed.len() * 8 >= self.present_count as usize {
            // Most boxes changed: one walk in memory order beats many along links.
            self.pairs.iter().for_each(end);
        } else {
            for old in &self.changed {
                // A pair of two changed boxes is in both their lists: count it at the first.
                let first = |pair: &Pair| pair.a == old.id || self.change_of[pair.a as usize] == UNCHANGED;
                self.pairs.of(old.id).filter(|(_, pair)| first(pair)).for_each(&mut end);
            }
        }
        self.events.removed.sort_unstable();
    }

    /// Brings the kept pairs up to date and forgets the changes.
    fn store(&mut self) {
        self.pairs.remove_all(&mut self.ended);
        for &pair in &self.events.added {
            self.pairs.insert(pair);
        }
        for old in self.changed.drain(..) {
            self.change_of[old.id as usize] = UNCHANGED;
        }
    }
}

/// The boxes now and at the last update.
struct State<'a> {
    boxes: &'a [Aabb],
    filters: &'a [ProxyFilter],
    changed: &'a [Old],
    change_of: &'a [u32],
}

impl State<'_> {
    /// Whether two boxes pair now. Absent and invalid boxes are NaN and overlap nothing.
    fn holds_now(&self, a: u32, b: u32) -> bool {
        let (a, b) = (a as usize, b as usize);
        self.boxes[a].overlaps(&self.boxes[b]) && self.filters[a].allows(&self.filters[b])
    }

    /// Whether two boxes that overlap now pair now and did not at the last update.
    #[inline]
    fn is_added(&self, a: u32, b: u32) -> bool {
        let (i, j) = (self.change_of[a as usize], self.change_of[b as usize]);
        if i == UNCHANGED && j == UNCHANGED {
            return false;
        }
        if !self.filters[a as usize].allows(&self.filters[b as usize]) {
            return false;
        }
        let ((box_a, filter_a), (box_b, filter_b)) = (self.before(a, i), self.before(b, j));
        !(box_a.overlaps(box_b) && filter_a.allows(filter_b))
    }

    fn before(&self, id: u32, change: u32) -> (&Aabb, &ProxyFilter) {
        match self.changed.get(change as usize) {
            Some(old) => (&old.aabb, &old.filter),
            None => (&self.boxes[id as usize], &self.filters[id as usize]),
        }
    }
}

fn check_margin(margin: f32) -> Result<(), Error> {
    if margin.is_finite() && margin >= 0.0 { Ok(()) } else { Err(Error::Margin { margin }) }
}

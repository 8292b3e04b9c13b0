//! `Finder`: all pairs of a list of boxes, with nothing kept between calls but memory.

use crate::memory::Scratch;
use crate::pair_device::{PairDevice, SearchRequest};
use crate::pairs::{Grouping, Groups};
use crate::report::{Report, stage};
use crate::search::{AllPairs, DeviceSlot, Request, Store};
use crate::{Aabb, Backend, Boxes, Config, Error, Keys, Order, Pair, ProxyFilter};

mod between;
mod sets;

use sets::Sets;

/// Returns every pair of overlapping boxes, sorted, with default settings.
///
/// `boxes[i]` has the id `i`. Invalid boxes pair with nothing.
///
/// # Errors
/// [`Error::TooManyBoxes`] and [`Error::TooManyPairs`], see [`crate::Limits`].
///
/// ```
/// use pbig_core::{find_pairs, Aabb, Pair};
/// let boxes = [0.0, 0.9, 5.0].map(|x| Aabb::from_center([x, 0.0, 0.0], [0.5; 3]));
/// assert_eq!(find_pairs(&boxes)?, [Pair::new(0, 1)]);
/// # Ok::<(), pbig_core::Error>(())
/// ```
pub fn find_pairs(boxes: &[Aabb]) -> Result<Vec<Pair>, Error> {
    let mut finder = Finder::default();
    finder.find(boxes)?;
    Ok(finder.into_pairs())
}

/// Finds all pairs of lists of boxes, and keeps its buffers between calls.
///
/// ```
/// use pbig_core::{Aabb, Config, Finder, ProxyFilter};
/// let mut finder = Finder::new(Config::default());
/// let boxes = [[0.0; 3], [0.5; 3]].map(|c| Aabb::from_center(c, [0.5; 3]));
/// assert_eq!(finder.find(&boxes)?.len(), 1);
/// let one_body = [ProxyFilter { body: 3, ..ProxyFilter::ALL }; 2];
/// assert_eq!(finder.find_filtered(&boxes, &one_body)?.len(), 0);
/// println!("{}", finder.report().plan);
/// # Ok::<(), pbig_core::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct Finder {
    config: Config,
    device: DeviceSlot,
    store: Scratch<Store>,
    all_pairs: Scratch<AllPairs>,
    groups: Scratch<Groups>,
    sets: Scratch<Sets>,
    pairs: Vec<Pair>,
    /// Pairs of two sets: the ids of a [`crate::CrossPair`].
    pairs_between: Vec<Pair>,
    report: Report,
}

impl Finder {
    /// Makes a finder with the given settings ([`Config::margin`] is not used).
    pub fn new(config: Config) -> Self {
        Self { config, ..Self::default() }
    }

    /// Makes a finder with a given device, which lists the pairs of one set without keys. [`crate::Backend::Device`] uses it for
    /// each such list, [`crate::Backend::Auto`] if it is hardware and the boxes are many.
    pub fn with_device(config: Config, device: Box<dyn PairDevice>) -> Self {
        Self { device: DeviceSlot::new(device), ..Self::new(config) }
    }

    /// Returns the name of the device in use. None while there is no device or it has failed.
    pub fn device_name(&self) -> Option<&str> {
        self.device.name()
    }

    /// Returns every pair of overlapping boxes; `boxes[i]` has the id `i`.
    ///
    /// # Errors
    /// [`Error::TooManyBoxes`] and [`Error::TooManyPairs`], see [`crate::Limits`].
    pub fn find(&mut self, boxes: &[Aabb]) -> Result<&[Pair], Error> {
        self.list(Boxes::new(boxes))
    }

    /// Returns every pair of overlapping boxes that both filters allow.
    ///
    /// # Errors
    /// The errors of [`Finder::find`], and [`Error::FilterCount`].
    pub fn find_filtered(&mut self, boxes: &[Aabb], filters: &[ProxyFilter]) -> Result<&[Pair], Error> {
        self.list(Boxes::new(boxes).with_filters(filters))
    }

    /// Returns every pair of overlapping boxes that have no key in common: edges or triangles of a mesh, for example, that do not
    /// share a vertex. There is one entry of keys for each box.
    ///
    /// ```
    /// use pbig_core::{Aabb, Finder, NO_KEY, Pair};
    /// let boxes = [Aabb::new([0.0; 3], [1.0; 3]); 3];
    /// let triangles = [[0, 1, 2], [2, 1, 3], [4, 5, 6]].map(|[u, v, w]| [u, v, w, NO_KEY]);
    /// let mut finder = Finder::default();
    /// let pairs = finder.find_without_shared(&boxes, &triangles)?;
    /// assert_eq!(pairs, [Pair::new(0, 2), Pair::new(1, 2)]);
    /// # Ok::<(), pbig_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// The errors of [`Finder::find`], and [`Error::KeyCount`].
    pub fn find_without_shared(&mut self, boxes: &[Aabb], keys: &[Keys]) -> Result<&[Pair], Error> {
        self.list(Boxes::new(boxes).with_keys(keys))
    }

    /// Calls `visit` once for every pair of overlapping boxes, in any order, on each thread that finds some. Returns the number of
    /// pairs.
    ///
    /// There is no list, so memory does not grow with the pairs, and [`crate::Limits::max_pairs`] does not apply: each thread
    /// gathers a few thousand pairs before it hands them over. The CPU does the work; no device is asked. A panic in `visit`
    /// reaches the caller when the other threads have ended; the finder stays usable.
    ///
    /// ```
    /// use pbig_core::{Aabb, Finder};
    /// use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
    /// let boxes = [[0.0; 3], [0.5; 3], [0.9; 3]].map(|center| Aabb::from_center(center, [0.5; 3]));
    /// let neighbours = [const { AtomicU32::new(0) }; 3];
    /// let pairs = Finder::default().for_each_pair(&boxes, |pair| {
    ///     neighbours[pair.a as usize].fetch_add(1, Relaxed);
    ///     neighbours[pair.b as usize].fetch_add(1, Relaxed);
    /// })?;
    /// assert_eq!((pairs, neighbours.map(AtomicU32::into_inner)), (3, [2; 3]));
    /// # Ok::<(), pbig_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::TooManyBoxes`], [`Error::FilterCount`] and [`Error::KeyCount`], before any call.
    pub fn for_each_pair<'a>(
        &mut self,
        boxes: impl Into<Boxes<'a>>,
        visit: impl Fn(Pair) + Sync,
    ) -> Result<u64, Error> {
        let all = boxes.into();
        self.begin(&[all])?;
        self.note_no_device();
        let receiver = |pairs: &[Pair]| pairs.iter().for_each(|pair| visit(*pair));
        let config = self.config;
        self.search(&Request { receiver: Some(&receiver), ..Request::of_one(&all, &config) })?;
        self.report.pairs = self.all_pairs.count();
        Ok(self.report.pairs)
    }

    fn list(&mut self, all: Boxes<'_>) -> Result<&[Pair], Error> {
        self.pairs.clear();
        self.begin(&[all])?;
        let is_sorted = self.config.order == Order::Sorted;
        let grouping = is_sorted.then(|| Grouping::new(all.boxes.len()));
        // A copy, so that the finder is free for its backends.
        let config = self.config;
        let request = Request { grouping, ..Request::of_one(&all, &config) };
        let is_found = self.may_use_device(&request) && self.find_on_device(&all, &request)?;
        if !is_found {
            self.search(&request)?;
            self.emit(grouping);
        }
        self.report.pairs = self.pairs.len() as u64;
        Ok(&self.pairs)
    }

    /// Begins the report on a search, and checks the boxes.
    fn begin(&mut self, sets: &[Boxes<'_>]) -> Result<(), Error> {
        self.report = Report::default();
        sets.iter().try_for_each(Boxes::check)?;
        let boxes = sets.iter().map(|set| set.boxes.len() as u64).sum();
        self.config.limits.check_boxes(boxes)?;
        self.report.boxes = boxes;
        Ok(())
    }

    /// Returns true if a device is wanted for a list of pairs, and knows all that decides about them.
    fn may_use_device(&mut self, request: &Request<'_>) -> bool {
        if request.keys.is_some() {
            self.note_no_device();
            return false;
        }
        self.device.is_wanted(self.config.backend, Some(self.report.boxes), &mut self.report)
    }

    /// Reports that the wanted device cannot do this kind of search.
    fn note_no_device(&mut self) {
        if self.config.backend == Backend::Device {
            self.report.fallback =
                Some("a device lists the pairs of one set without keys: the CPU does the work".into());
        }
    }

    fn find_on_device(&mut self, all: &Boxes<'_>, request: &Request<'_>) -> Result<bool, Error> {
        let (Boxes { boxes, filters, .. }, Request { config, grouping, .. }) = (*all, *request);
        let (is_sorted, max_pairs) = (grouping.is_some(), config.limits.pairs());
        let request = SearchRequest { boxes, filters, is_sorted, max_pairs };
        let is_in_order = self.device.find_all(&request, &mut self.pairs, &mut self.report)?;
        let Some(is_in_order) = is_in_order else { return Ok(false) };
        self.count_invalid();
        if grouping.is_some() && !is_in_order {
            self.all_pairs.take(&mut self.pairs, grouping);
            self.emit(grouping);
        }
        Ok(true)
    }

    /// Searches on the CPU.
    fn search(&mut self, request: &Request<'_>) -> Result<(), Error> {
        let done = self.all_pairs.find(request, &mut self.store, &mut self.report);
        self.count_invalid();
        done
    }

    fn count_invalid(&mut self) {
        self.report.invalid = self.report.boxes - u64::from(self.report.plan.boxes);
    }

    /// Brings the pairs of all threads into one list, in order if there is a grouping.
    fn emit(&mut self, grouping: Option<Grouping>) {
        let Self { groups, all_pairs, pairs, report, .. } = self;
        stage!(report, emit, {
            if let Some(grouping) = grouping {
                groups.take_memory(pairs);
                all_pairs.gather(grouping, groups);
                groups.list(pairs, all_pairs.hits.len());
            } else {
                all_pairs.list(pairs);
            }
        });
    }

    /// Returns the pairs of the last call that lists pairs of one set; none if it failed.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// Returns the list of the last call that lists pairs of one set, without a copy.
    pub fn into_pairs(mut self) -> Vec<Pair> {
        self.pairs.shrink_to_fit();
        self.pairs
    }

    /// Gives back all memory but the lists of the last call. A device keeps its own.
    ///
    /// ```
    /// use pbig_core::{Aabb, Finder};
    /// let mut finder = Finder::default();
    /// finder.find(&[Aabb::new([0.0; 3], [1.0; 3]); 500])?;
    /// finder.shrink_to_fit();
    /// assert_eq!(finder.pairs().len(), 500 * 499 / 2);
    /// # Ok::<(), pbig_core::Error>(())
    /// ```
    pub fn shrink_to_fit(&mut self) {
        (self.store, self.all_pairs, self.groups, self.sets) = Default::default();
        self.pairs.shrink_to_fit();
        self.pairs_between.shrink_to_fit();
    }

    /// Returns what the last call did.
    pub fn report(&self) -> &Report {
        &self.report
    }
}

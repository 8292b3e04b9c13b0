//! All pairs of a list of boxes, from nothing each time.

use crate::cpu::crowding::Set;
use crate::cpu::emit;
use crate::cpu::find::Found;
use crate::cpu::map::Map;
use crate::cpu::pbig::PbigGrid;
#[cfg(feature = "gpu")]
use crate::gpu::{self, GpuFinder};
use crate::plan::{Plan, Summary};
use crate::report::{Checks, Report, lap, stage};
use crate::{Aabb, Backend, Config, Error, Limits, Pair, ProxyFilter, Strategy};
use std::time::{Duration, Instant};

/// Every pair of overlapping boxes, sorted, with default settings.
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
    Ok(finder.pairs)
}

/// Finds pairs again and again, keeping its buffers.
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
#[derive(Debug)]
pub struct Finder {
    config: Config,
    search: Search,
    pairs: Vec<Pair>,
    scratch: Vec<u32>,
    report: Report,
}

impl Default for Finder {
    fn default() -> Self {
        Self::new(Config::DEFAULT)
    }
}

impl Finder {
    /// A finder with the given settings ([`Config::margin`] is not used).
    pub fn new(config: Config) -> Self {
        Self { config, search: Search::new(), pairs: vec![], scratch: vec![], report: Report::default() }
    }

    /// As [`Finder::new`], on a given device: with [`crate::Backend::Gpu`] always, with
    /// [`crate::Backend::Auto`] when it is no software and turns out faster than the CPU.
    #[cfg(feature = "gpu")]
    pub fn with_gpu(config: Config, gpu: GpuFinder) -> Self {
        let mut finder = Self::new(config);
        finder.search.gpu = Some(gpu);
        finder
    }

    /// Every pair of overlapping boxes; `boxes[i]` has the id `i`.
    ///
    /// # Errors
    /// [`Error::TooManyBoxes`] and [`Error::TooManyPairs`], see [`crate::Limits`].
    pub fn find(&mut self, boxes: &[Aabb]) -> Result<&[Pair], Error> {
        self.find_where(boxes, None, &|_, _| true)
    }

    /// As [`Finder::find`], with only the pairs that both filters allow.
    ///
    /// # Errors
    /// As [`Finder::find`], and [`Error::FilterCount`].
    pub fn find_filtered(&mut self, boxes: &[Aabb], filters: &[ProxyFilter]) -> Result<&[Pair], Error> {
        if boxes.len() != filters.len() {
            self.forget();
            return Err(Error::FilterCount { boxes: boxes.len(), filters: filters.len() });
        }
        self.find_where(boxes, Some(filters), &|a, b| filters[a as usize].allows(&filters[b as usize]))
    }

    fn find_where<A>(
        &mut self,
        boxes: &[Aabb],
        filters: Option<&[ProxyFilter]>,
        accept: &A,
    ) -> Result<&[Pair], Error>
    where
        A: Fn(u32, u32) -> bool + Sync,
    {
        self.forget();
        check_count(boxes.len() as u64, &self.config)?;
        let rule = Rule { accept, filters, filters_suffice: true };
        self.search.find(boxes, &self.config, &rule, &mut self.report)?;
        let mut clock = Instant::now();
        stage!("emit");
        let chunks = &self.search.found.chunks;
        emit::collect(chunks, boxes.len(), self.config.order, &mut self.scratch, &mut self.pairs);
        self.report.stages.emit = lap(&mut clock);
        self.report.pairs = self.pairs.len() as u64;
        Ok(&self.pairs)
    }

    /// Nothing of an earlier call outlives the next, even if that fails.
    fn forget(&mut self) {
        self.pairs.clear();
        self.report = Report::default();
    }

    /// The adapter of the device at hand: name, kind and API. None before a shared one is opened, and
    /// while it has failed.
    #[cfg(feature = "gpu")]
    pub fn adapter(&self) -> Option<&str> {
        self.search.adapter()
    }

    /// The pairs of the last call; none if it failed.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// What the last call did.
    pub fn report(&self) -> &Report {
        &self.report
    }
}

/// Which pairs are wanted, besides that they overlap.
pub(crate) struct Rule<'a, A> {
    /// The whole rule.
    pub(crate) accept: &'a A,
    /// The part of it that a device can test, and that tells who never pairs.
    pub(crate) filters: Option<&'a [ProxyFilter]>,
    /// Whether that part is all of it.
    #[cfg_attr(not(feature = "gpu"), expect(dead_code))]
    pub(crate) filters_suffice: bool,
}

pub(crate) fn check_count(boxes: u64, config: &Config) -> Result<(), Error> {
    let limit = config.limits.max_boxes.min(Limits::UNLIMITED.max_boxes);
    if boxes > limit { Err(Error::TooManyBoxes { boxes, limit }) } else { Ok(()) }
}

/// A search from nothing by whatever strategy the plan chooses, with its buffers.
#[derive(Clone, Debug)]
pub(crate) struct Search {
    pub(crate) map: Map,
    pbig: PbigGrid,
    pub(crate) found: Found,
    warned: bool,
    #[cfg(feature = "gpu")]
    pub(crate) gpu: Option<GpuFinder>,
    #[cfg(feature = "gpu")]
    trial: gpu::Trial,
}

impl Search {
    pub(crate) fn new() -> Self {
        Self {
            map: Map::new(),
            pbig: PbigGrid::default(),
            found: Found::default(),
            warned: false,
            #[cfg(feature = "gpu")]
            gpu: None,
            #[cfg(feature = "gpu")]
            trial: gpu::Trial::default(),
        }
    }

    /// Leaves the accepted pairs in `found`, and what was done in `report`.
    pub(crate) fn find<A>(
        &mut self,
        boxes: &[Aabb],
        config: &Config,
        rule: &Rule<'_, A>,
        report: &mut Report,
    ) -> Result<(), Error>
    where
        A: Fn(u32, u32) -> bool + Sync,
    {
        let mut clock = Instant::now();
        let summary = Summary::of(boxes, None);
        report.boxes = boxes.len() as u64;
        report.invalid = boxes.len() as u64 - u64::from(summary.valid);
        report.stages.plan += lap(&mut clock);
        if self.find_on_gpu(boxes, &summary, config, rule, report)? {
            return Ok(());
        }
        let mut clock = Instant::now();
        let set = Set { boxes, filters: rule.filters, ids: None, summary: &summary };
        let result = self.find_on_cpu(&set, config, rule.accept, report);
        self.note_time(false, boxes.len(), lap(&mut clock));
        result
    }

    fn find_on_cpu<A>(
        &mut self,
        set: &Set<'_>,
        config: &Config,
        accept: &A,
        report: &mut Report,
    ) -> Result<(), Error>
    where
        A: Fn(u32, u32) -> bool + Sync,
    {
        if config.strategy == Strategy::Pbig && config.backend != Backend::Brute {
            report.plan = Plan::new(set.summary, config, 1.0);
            return self.find_pbig(set.boxes, config, accept, report);
        }
        report.plan = self.map.plan_and_build(set, config, &mut report.stages);
        let mut clock = Instant::now();
        self.map.find(accept, config.limits.max_pairs, &mut self.found)?;
        report.stages.check += lap(&mut clock);
        report.checks = single_entry_checks(&self.found);
        Ok(())
    }

    /// Whether a search would be tried on a GPU because the caller wants one.
    #[cfg(feature = "gpu")]
    pub(crate) fn expects_gpu(&self, config: &Config) -> bool {
        config.backend == Backend::Gpu && !self.gpu.as_ref().is_some_and(|gpu| gpu.is_paused(config))
    }

    #[cfg(not(feature = "gpu"))]
    #[expect(clippy::unused_self, reason = "as with a GPU backend")]
    pub(crate) fn expects_gpu(&self, _: &Config) -> bool {
        false
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn adapter(&self) -> Option<&str> {
        self.gpu.as_ref().and_then(GpuFinder::working_adapter)
    }

    /// Searches on a device if that is wanted; false when it is not, or when the device could not do
    /// it, which the report then says (contract 8).
    #[cfg(feature = "gpu")]
    fn find_on_gpu<A>(
        &mut self,
        boxes: &[Aabb],
        summary: &Summary,
        config: &Config,
        rule: &Rule<'_, A>,
        report: &mut Report,
    ) -> Result<bool, Error>
    where
        A: Fn(u32, u32) -> bool + Sync,
    {
        if !gpu::wanted(config, self.gpu.as_ref(), &mut self.trial, boxes.len()) {
            return Ok(false);
        }
        stage!("gpu");
        let mut clock = Instant::now();
        let accept: Option<&(dyn Fn(u32, u32) -> bool + Sync)> =
            if rule.filters_suffice { None } else { Some(rule.accept) };
        let request = gpu::Request { boxes, filters: rule.filters, accept, summary, config };
        let gpu = self.gpu.get_or_insert_with(GpuFinder::shared);
        match gpu.find(&request, &mut self.found, report) {
            Ok(()) => {
                self.warned = false;
                report.fallback = None;
                let time = lap(&mut clock);
                // The device's own times for its map; the rest of the call is check, transfer and decoding.
                let kernels = report.gpu.iter().flat_map(|gpu| &gpu.kernels);
                let mapping = kernels.filter(|(name, _)| !name.starts_with("check")).map(|(_, time)| *time);
                let map = mapping.sum::<Duration>().min(time);
                report.stages.map += map;
                report.stages.check += time - map;
                self.note_time(true, boxes.len(), time);
                Ok(true)
            }
            Err(gpu::Failure::Call(error)) => Err(error),
            Err(gpu::Failure::Device(error)) => {
                self.trial.failed();
                self.fall_back(format!("{error}: the CPU does the work"), report);
                Ok(false)
            }
        }
    }

    #[cfg(not(feature = "gpu"))]
    fn find_on_gpu<A>(
        &mut self,
        _: &[Aabb],
        _: &Summary,
        config: &Config,
        _: &Rule<'_, A>,
        report: &mut Report,
    ) -> Result<bool, Error> {
        if config.backend == Backend::Gpu {
            let why = "no GPU backend in this build (feature `gpu`): the CPU does the work";
            self.fall_back(why.into(), report);
        }
        Ok(false)
    }

    /// The wanted backend could not do the work: the report says so every time, a warning once.
    fn fall_back(&mut self, why: String, report: &mut Report) {
        if !self.warned {
            tracing::warn!("pbig: {why}");
            self.warned = true;
        }
        report.fallback = Some(why);
    }

    /// Measures for [`Backend::Auto`].
    #[cfg(feature = "gpu")]
    fn note_time(&mut self, on_gpu: bool, boxes: usize, time: Duration) {
        self.trial.note(on_gpu, boxes, time);
    }

    #[cfg(not(feature = "gpu"))]
    #[expect(clippy::unused_self, reason = "as with a GPU backend")]
    fn note_time(&mut self, _: bool, _: usize, _: Duration) {}

    fn find_pbig<A>(
        &mut self,
        boxes: &[Aabb],
        config: &Config,
        accept: &A,
        report: &mut Report,
    ) -> Result<(), Error>
    where
        A: Fn(u32, u32) -> bool,
    {
        self.found.clear();
        // Fewer than two valid boxes have no plan.
        let Plan { pbig: Some(plan), .. } = report.plan else { return Ok(()) };
        let mut clock = Instant::now();
        stage!("map and check");
        self.pbig.build(&plan, boxes);
        report.stages.map += lap(&mut clock);
        report.checks =
            self.pbig.find(&plan, config.small_cell, accept, config.limits.max_pairs, &mut self.found)?;
        report.stages.check += lap(&mut clock);
        Ok(())
    }
}

/// Checks of a structure that stores each box once: none is redundant.
pub(crate) fn single_entry_checks(found: &Found) -> Checks {
    Checks { made: found.checks, unnecessary: found.checks - found.overlaps, redundant: 0 }
}

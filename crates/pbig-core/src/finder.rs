//! All pairs of a list of boxes, from nothing each time.

use crate::cpu::emit;
use crate::cpu::judge::Accept;
use crate::cpu::record::Item;
#[cfg(feature = "gpu")]
use crate::gpu::GpuFinder;
use crate::report::{Report, lap, stage};
use crate::search::{Rule, Search};
use crate::{Aabb, Config, Error, Limits, Pair, ProxyFilter};
use std::time::Instant;

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
    search: Search<Item>,
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
        self.find_where(boxes, None, &Every)
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
        self.find_where(boxes, Some(filters), &Allowed(filters))
    }

    fn find_where<A>(
        &mut self,
        boxes: &[Aabb],
        filters: Option<&[ProxyFilter]>,
        accept: &A,
    ) -> Result<&[Pair], Error>
    where
        A: Accept,
    {
        self.forget();
        check_count(boxes.len() as u64, &self.config)?;
        let rule = Rule { accept, filters, before: &[] };
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

/// Every pair that overlaps.
struct Every;

impl Accept for Every {
    fn pair(&self, _: Pair) -> bool {
        true
    }
}

/// Those that both filters allow.
struct Allowed<'a>(&'a [ProxyFilter]);

impl Accept for Allowed<'_> {
    fn pair(&self, pair: Pair) -> bool {
        self.0[pair.a as usize].allows(&self.0[pair.b as usize])
    }
}

pub(crate) fn check_count(boxes: u64, config: &Config) -> Result<(), Error> {
    let limit = config.limits.max_boxes.min(Limits::UNLIMITED.max_boxes);
    if boxes > limit { Err(Error::TooManyBoxes { boxes, limit }) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Strategy;

    #[test]
    fn filters_part_some_and_leave_the_others() {
        let boxes = [Aabb::from_center([0.0; 3], [0.5; 3]); 3];
        let filters = [1, 1, 2].map(|body| ProxyFilter { body, ..ProxyFilter::ALL });
        let mut finder = Finder::default();
        assert_eq!(finder.find_filtered(&boxes, &filters), Ok(&[Pair::new(0, 2), Pair::new(1, 2)][..]));
    }

    #[test]
    fn what_a_row_that_wraps_around_tests_is_counted() {
        let cube = |at: [f32; 3]| Aabb::from_center(at, [0.5; 3]);
        let boxes = [cube([0.0, 0.0, 1.0]), cube([1.0, 0.0, 0.0])];
        let mut finder = Finder::new(Config { strategy: Strategy::Grid, ..Config::DEFAULT });
        assert_eq!(finder.find(&boxes).expect("one pair"), [Pair::new(0, 1)]);
        let checks = finder.report().checks;
        assert!(checks.made >= 1 && checks.unnecessary < checks.made, "{checks:?}");
    }
}

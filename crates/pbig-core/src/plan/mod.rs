//! The plan: from a summary of the boxes to strategy, levels and cell sizes, by what these would cost. It explains itself in
//! words.
//!
//! How an update uses it, or does without, is chosen where updates are (`broad_phase`): by edits or anew (`rebuild`), by near pairs
//! (`near::policy`), by bitmap (`turns`), on which processor (`search`).

mod camps;
mod costs;
mod draft;
mod levels;
mod pbig;
mod reasons;
mod summary;

#[cfg(feature = "gpu")]
pub use crate::gpu::GpuPlan;
pub use crate::gpu_choice::NoGpu;
pub(crate) use camps::{Camps, OPEN};
pub use costs::{Costs, Forecast};
pub(crate) use costs::{Experience, Way};
use draft::Draft;
pub(crate) use draft::KeptLevels;
use levels::{Choice, Company, Setting};
pub use levels::{LevelPlan, OccupiedCell};
pub use pbig::{PbigPlan, density_cell, pbig_cell, pbig_objective};
pub use reasons::{Looks, Measured, NearPlan, NoNear};
pub(crate) use summary::{LazySummary, size_class_of, spread_evenly};
pub use summary::{SizeClass, Summary};

use crate::config::{Backend, Config, Strategy};
use std::fmt;
use std::sync::Arc;

/// What the plan settled on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Chosen {
    /// Fewer than two valid boxes, or nothing has changed.
    #[default]
    Nothing,
    /// Every pair is tested.
    Brute,
    /// A bitmap index, for few boxes that are kept from update to update.
    Bitmap,
    /// Boxes sorted by the cell of their lower corner, in one grid a level.
    Grid,
    /// PBIG's grid of duplicated entries.
    Pbig,
    /// The grid of an earlier update is kept; only boxes that moved since are looked at.
    Edit,
    /// Pairs of boxes that were near each other at an earlier update; only these are tested.
    Near,
}

impl Chosen {
    /// The name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Brute => "brute",
            Self::Bitmap => "bitmap",
            Self::Grid => "grid",
            Self::Pbig => "pbig",
            Self::Edit => "edit",
            Self::Near => "near",
        }
    }
}

/// How a set of boxes is searched. Its `Display` says what was chosen and why.
///
/// ```
/// use pbig_core::{Aabb, Finder};
/// let boxes: Vec<_> = (0..500).map(|i| Aabb::from_center([i as f32, 0.0, 0.0], [0.6; 3])).collect();
/// let mut finder = Finder::default();
/// finder.find(&boxes).unwrap();
/// println!("{}", finder.report().plan);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plan {
    /// The strategy.
    pub chosen: Chosen,
    /// Grids, smallest boxes first ([`Chosen::Grid`]).
    pub levels: Arc<[LevelPlan]>,
    /// Boxes tested against every other: too large for a level that would pay, or a small set.
    pub swept: u32,
    /// The grid of [`Chosen::Pbig`].
    pub pbig: Option<PbigPlan>,
    /// The grid on the GPU, if the GPU searched.
    #[cfg(feature = "gpu")]
    pub gpu: Option<GpuPlan>,
    /// Boxes that came since the grid was built and are out of its order ([`Chosen::Edit`]).
    pub moved: u32,
    /// The list of near pairs: in use ([`Chosen::Near`]), or made by this search.
    pub near: Option<NearPlan>,
    /// Why there is none, where many boxes change ([`Chosen::Edit`] and [`Chosen::Grid`], in updates).
    pub no_near: Option<NoNear>,
    /// Why no device was asked, where [`Backend::Auto`] leaves that open. The words of a plan leave out [`NoGpu::NotBuilt`].
    pub no_gpu: Option<NoGpu>,
    /// At which rows the search of the CPU's grid has looked ([`Chosen::Grid`]).
    pub looks: Looks,
    /// What the ways to do it have taken, where that decides.
    pub measured: Measured,
    /// Valid boxes planned for.
    pub boxes: u32,
    /// What the ways to search them would take, as far as they were compared.
    pub forecast: Forecast,
    /// The way chosen, and what it would take by the costs alone, in ns.
    pub(crate) expected: Option<(Way, f32)>,
}

impl Plan {
    /// Chooses for the boxes behind `summary`, by [`Config::costs`] or those of the reference. `crowding` is a factor on
    /// the cell size of an even spread: 1, or less where such cells turned out to be too full.
    pub fn new(summary: &Summary, config: &Config, crowding: f32) -> Self {
        let costs = config.costs.unwrap_or(Costs::REFERENCE);
        Self::by(summary, config, crowding, None, &costs, &Experience::default()).plan()
    }

    /// The same by given costs, and by what searches took; `only` one way, if boxes allow it and no other is asked for.
    pub(crate) fn by(
        summary: &Summary,
        config: &Config,
        crowding: f32,
        only: Option<Way>,
        costs: &Costs,
        experience: &Experience,
    ) -> Draft {
        let (boxes, only) = (summary.valid, Way::asked(config).or(only));
        if boxes < 2 {
            return Self { boxes, ..Self::default() }.into();
        }
        if config.backend == Backend::Brute {
            return Self::brute(boxes).into();
        }
        match config.strategy {
            Strategy::Pbig => Self {
                chosen: Chosen::Pbig,
                pbig: Some(PbigPlan::new(summary, config)),
                boxes,
                ..Self::default()
            }
            .into(),
            Strategy::Auto if boxes < config.brute_below => Self::brute(boxes).into(),
            strategy @ (Strategy::Auto | Strategy::Grid) => {
                let setting = Setting { crowding, strategy, company: Company::NONE, costs, experience, only };
                Self::of_levels(boxes, levels::choose(summary, &setting))
            }
        }
    }

    /// Nothing chosen, for so many boxes. What has no memory to give back is not touched.
    pub(crate) fn begin(&mut self, boxes: u32) {
        if self.levels.is_empty() {
            (self.chosen, self.swept, self.pbig, self.moved) = (Chosen::Nothing, 0, None, 0);
            (self.forecast, self.expected) = Default::default();
            (self.near, self.no_near, self.no_gpu) = (None, None, None);
            (self.looks, self.measured) = Default::default();
            #[cfg(feature = "gpu")]
            {
                self.gpu = None;
            }
            self.boxes = boxes;
        } else {
            *self = Self { boxes, ..Self::default() };
        }
    }

    /// Of a way that is given.
    pub(crate) fn only(way: Way, summary: &Summary) -> Self {
        let (costs, experience) = (&Costs::REFERENCE, &Experience::default());
        let (strategy, company) = (Strategy::Auto, Company::NONE);
        let setting = Setting { crowding: 1.0, strategy, company, costs, experience, only: Some(way) };
        Self::of_levels(summary.valid, levels::choose(summary, &setting)).plan()
    }

    /// Whether boxes of several sizes share one grid that might have levels instead.
    pub(crate) fn could_have_levels(&self) -> bool {
        self.levels.len() == 1 && self.forecast.levels.is_finite() && self.expected.is_some()
    }

    fn brute(boxes: u32) -> Self {
        Self { chosen: Chosen::Brute, swept: boxes, boxes, ..Self::default() }
    }

    fn of_levels(boxes: u32, choice: Choice) -> Draft {
        let Choice { levels, swept, forecast, expected } = choice;
        let chosen = if levels.is_empty() { Chosen::Brute } else { Chosen::Grid };
        let plan = Self { chosen, swept, boxes, forecast, expected: Some(expected), ..Self::default() };
        Draft::new(plan, levels)
    }

    /// For boxes by camp, the first of which is open: levels for each, all in one plan.
    pub(crate) fn of_camps(summaries: &[Summary], config: &Config, crowding: f32, costs: &Costs) -> Self {
        let boxes = summaries.iter().map(|summary| summary.valid).sum();
        let (mut all, mut swept) = (Vec::new(), 0);
        for (camp, summary) in summaries.iter().enumerate() {
            let company = Company { others: boxes - summary.valid, pairs: camp == usize::from(OPEN) };
            let (strategy, experience) = (config.strategy, &Experience::default());
            let only = Way::asked(config);
            let setting = Setting { crowding, strategy, company, costs, experience, only };
            let choice = levels::choose(summary, &setting);
            all.extend(choice.levels.into_iter().map(|level| LevelPlan { camp: camp as u8, ..level }));
            swept += choice.swept;
        }
        // Small boxes search among larger ones, and few among many.
        all.sort_by_key(|level| (level.classes.1, level.boxes));
        Self { chosen: Chosen::Grid, levels: all.into(), swept, boxes, ..Self::default() }
    }
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let boxes = self.boxes;
        match self.chosen {
            Chosen::Nothing if boxes < 2 => write!(f, "nothing to do: fewer than two valid boxes"),
            Chosen::Nothing => write!(f, "nothing to do: no box has changed"),
            Chosen::Brute if self.expected.is_none() => {
                write!(
                    f,
                    "brute force: {boxes} boxes; costs were not compared, they are few or `backend` asks for it"
                )
            }
            Chosen::Brute => write!(f, "brute force: {boxes} boxes are cheaper to test than to sort"),
            Chosen::Bitmap => write!(f, "bitmap: {boxes} boxes are few enough to be looked up in bands"),
            Chosen::Grid => write!(f, "grid: {boxes} boxes"),
            Chosen::Edit => write!(
                f,
                "edit: {} of {boxes} boxes are out of the order in which the grid was built",
                self.moved
            ),
            Chosen::Near => {
                write!(f, "near pairs: {boxes} boxes move little, and what was far apart cannot have met")
            }
            Chosen::Pbig => write!(f, "PBIG grid: {boxes} boxes"),
        }?;
        if let Some(pbig) = &self.pbig {
            write!(f, "; {pbig}")?;
        }
        #[cfg(feature = "gpu")]
        if let Some(gpu) = &self.gpu {
            write!(f, "; {gpu}")?;
        }
        for level in self.levels.iter() {
            write!(f, "; {level}")?;
        }
        if self.looks != Looks::default() {
            write!(f, "; rows looked at: {}", self.looks)?;
        }
        if self.swept > 0 && self.chosen != Chosen::Brute {
            write!(f, "; {} oversize boxes tested against all", self.swept)?;
        }
        if self.forecast != Forecast::default() && !matches!(self.chosen, Chosen::Edit | Chosen::Near) {
            write!(f, "; expected: {}", self.forecast)?;
        }
        if let Some(near) = self.near {
            write!(f, "; {near}")?;
        }
        if let Some(why) = self.no_near {
            write!(f, "; no near pairs: {why}")?;
        }
        // Who builds without one knows.
        let is_news = |why: &NoGpu| self.chosen != Chosen::Nothing && *why != NoGpu::NotBuilt;
        if let Some(why) = self.no_gpu.filter(is_news) {
            write!(f, "; no GPU: {why}")?;
        }
        write!(f, "{}", self.measured)
    }
}

/// The spacing at which about `per_cell` of `n` boxes fall into a cube of that edge, in a world of
/// the given ranges. An axis that is thinner than the spacing has one layer and does not count:
/// a flat world is divided as a plane, a row of boxes as a line.
fn spacing(ranges: [f32; 3], n: u32, per_cell: f64) -> f64 {
    let cells = (f64::from(n) / per_cell).max(1.0);
    let mut ranges = ranges.map(f64::from);
    ranges.sort_unstable_by(|a, b| b.total_cmp(a));
    let mut volume = 1.0;
    let mut best = 0.0f64;
    for (axes, range) in ranges.into_iter().enumerate() {
        if axes > 0 && range <= best {
            break;
        }
        volume *= range;
        best = (volume / cells).powf(1.0 / (axes as f64 + 1.0));
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Aabb;

    fn plan(boxes: &[Aabb], config: Config) -> Plan {
        Plan::new(&Summary::of(boxes, None), &config, 1.0)
    }

    fn lattice(n: u32, step: f32, half: f32) -> Vec<Aabb> {
        let at = |i: u32, d: u32| (i / d % n) as f32 * step;
        (0..n * n * n).map(|i| Aabb::from_center([at(i, 1), at(i, n), at(i, n * n)], [half; 3])).collect()
    }

    #[test]
    fn spacing_gives_the_wanted_boxes_per_cell_in_one_two_and_three_dimensions() {
        assert!((spacing([100.0; 3], 1_000_000, 1.0) - 1.0).abs() < 1e-6);
        assert!((spacing([100.0; 3], 1_000_000, 8.0) - 2.0).abs() < 1e-6);
        assert!((spacing([100.0, 0.001, 100.0], 10_000, 1.0) - 1.0).abs() < 1e-6);
        assert!((spacing([0.0, 100.0, 0.0], 100, 1.0) - 1.0).abs() < 1e-6);
        assert_eq!(spacing([0.0; 3], 100, 1.0), 0.0);
    }

    #[test]
    fn small_sets_are_not_sorted_and_large_ones_are() {
        assert_eq!(plan(&lattice(1, 1.0, 0.4), Config::DEFAULT).chosen, Chosen::Nothing);
        let few = plan(&lattice(3, 1.0, 0.4), Config::DEFAULT);
        assert_eq!(few.chosen, Chosen::Brute);
        assert!(few.to_string().contains("costs were not compared"), "{few}");
        let sorted_never = plan(&lattice(3, 1.0, 0.4), Config { brute_below: 0, ..Config::DEFAULT });
        assert!(sorted_never.to_string().contains("cheaper to test than to sort"), "{sorted_never}");
        assert_eq!(plan(&lattice(20, 1.0, 0.4), Config::DEFAULT).chosen, Chosen::Grid);
    }

    #[test]
    fn boxes_of_one_size_share_one_level_whose_cells_hold_any_of_them() {
        let plan = plan(&lattice(20, 1.0, 0.4), Config::DEFAULT);
        assert_eq!((plan.levels.len(), plan.swept), (1, 0));
        assert!(plan.levels[0].cell.iter().all(|&c| c > 0.8 && c < 2.0), "{plan}");
    }

    #[test]
    fn one_enormous_box_does_not_enlarge_the_cells_of_the_others() {
        let mut boxes = lattice(20, 1.0, 0.4);
        boxes.push(Aabb::new([-1e4; 3], [1e4; 3]));
        let plan = plan(&boxes, Config::DEFAULT);
        assert_eq!((plan.levels.len(), plan.swept), (1, 1), "{plan}");
        assert!(plan.levels[0].cell[0] < 2.0, "{plan}");
    }

    #[test]
    fn sizes_over_decades_get_levels_where_those_cost_less_than_candidates() {
        let mut boxes = lattice(20, 1.0, 0.0005);
        boxes.extend(lattice(10, 10.0, 5.0));
        // A thousand small ones in a cell of the large ones: cheaper to test than to look for in another level...
        let found = plan(&boxes, Config::DEFAULT);
        assert_eq!((found.levels.len(), found.swept), (1, 0), "{found}");
        // ...unless that costs next to nothing.
        let costs = Some(Costs { visit: 1.0, visited: 0.1, ..Costs::REFERENCE });
        let found = plan(&boxes, Config { costs, ..Config::DEFAULT });
        assert_eq!(found.levels.len(), 2, "{found}");
        assert!(found.forecast.levels < found.forecast.one_grid, "{found}");
    }

    #[test]
    fn a_few_large_boxes_among_crowds_of_small_ones_are_tested_one_by_one() {
        let mut boxes = lattice(30, 0.5, 0.0005);
        boxes.extend(lattice(2, 5.0, 4.0));
        let found = plan(&boxes, Config::DEFAULT);
        assert_eq!((found.levels.len(), found.swept), (1, 8), "{found}");
    }

    #[test]
    fn a_plan_explains_itself() {
        let mut boxes = lattice(20, 1.0, 0.4);
        boxes.push(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
        let text = plan(&boxes, Config::DEFAULT).to_string();
        assert!(text.starts_with("grid: 8001 boxes; level of 8000 boxes up to 0.8"), "{text}");
        let why = "1 oversize boxes tested against all; expected: brute force 64 ms, one grid 0.";
        assert!(text.contains(why) && text.ends_with(" ms"), "{text}");
    }
}

//! What only studies may ask of pbig-core and its shaders: PBIG's grid on the CPU, its settings on a GPU, our grid for few
//! boxes, single kernels.
//!
//! Everything else in this crate uses the core as an app does.

use pbig_core::plan::{PbigPlan, Summary};
use pbig_core::{Aabb, Backend, Checks, Config, Error, Finder, Limits, Order, Pair, Plan, Strategy};

pub use pbig_core::CellRule;
pub use pbig_core::plan::density_cell;
pub use pbig_shaders::{INDEX_PAIRS, LAZY_ENDS, LAZY_PAIRS, ROW_ENDS};

/// Settings of PBIG's grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PbigSettings {
    /// The rule that turns the wanted boxes per cell into a cell length.
    pub cell_rule: CellRule,
    /// PBIG's `W` (equation 6): wanted boxes per cell.
    pub boxes_per_cell: f32,
    /// Most boxes of a cell whose pairs come from Avril's mapping; larger cells use PBIG's balanced rows.
    pub small_cell: u32,
}

/// The settings that the GPU uses by default.
pub const SETTINGS: PbigSettings = PbigSettings {
    cell_rule: Config::DEFAULT.cell_rule,
    boxes_per_cell: Config::DEFAULT.pbig_boxes_per_cell,
    small_cell: Config::DEFAULT.small_cell,
};

/// Most boxes that a GPU searches without a grid by default.
pub const ALL_PAIRS_UP_TO: u32 = 1024;

/// The result of a search by PBIG's grid.
#[derive(Clone, Debug)]
pub struct PbigFound {
    /// Overlapping pairs, in no order.
    pub pairs: Vec<Pair>,
    /// Box tests.
    pub checks: Checks,
    /// The grid.
    pub plan: PbigPlan,
}

/// Finds all pairs with PBIG's grid (PBIG 4.2) on one thread.
///
/// # Errors
/// If there are more boxes than 32-bit numbers can name.
pub fn pbig_grid(boxes: &[Aabb], settings: &PbigSettings) -> Result<PbigFound, Error> {
    let config = Config {
        backend: Backend::Cpu,
        strategy: Strategy::Pbig,
        limits: Limits::UNLIMITED,
        order: Order::Unspecified,
        ..of(settings)
    };
    let mut finder = Finder::new(config);
    let pairs = finder.find(boxes)?.to_vec();
    let (checks, plan) = (finder.report().checks, finder.report().plan.pbig);
    Ok(PbigFound { pairs, checks, plan: plan.unwrap_or_else(|| PbigPlan::new(&Summary::default(), &config)) })
}

/// The boxes of one set, as PBIG's rule for the cell length sees them.
pub struct PbigCells(Summary);

impl PbigCells {
    /// Reads the boxes.
    pub fn new(boxes: &[Aabb]) -> Self {
        Self(Summary::of(boxes, None))
    }

    /// Returns the cell length that these settings give, in the boxes' length unit.
    pub fn length(&self, settings: &PbigSettings) -> f32 {
        PbigPlan::new(&self.0, &of(settings)).cell
    }
}

fn of(settings: &PbigSettings) -> Config {
    let PbigSettings { cell_rule, boxes_per_cell, small_cell } = *settings;
    Config { cell_rule, pbig_boxes_per_cell: boxes_per_cell, small_cell, ..Config::DEFAULT }
}

/// Returns a configuration whose GPU uses this grid for more than `all_pairs_up_to` boxes.
///
/// `all_pairs_up_to` is 0 (always the grid) or [`ALL_PAIRS_UP_TO`].
pub fn with_gpu_grid(config: Config, settings: &PbigSettings, all_pairs_up_to: u32) -> Config {
    let PbigSettings { cell_rule, boxes_per_cell, small_cell } = *settings;
    let strategy = if all_pairs_up_to == 0 { Strategy::Pbig } else { Strategy::Auto };
    Config { strategy, cell_rule, pbig_boxes_per_cell: boxes_per_cell, small_cell, ..config }
}

/// Returns a configuration that uses our grid on the CPU, however few the boxes.
pub fn with_our_grid(config: Config) -> Config {
    Config { strategy: Strategy::Grid, ..config }
}

/// Returns the name of the algorithm that did the work.
pub fn algorithm(plan: &Plan) -> &'static str {
    plan.chosen.name()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::boxes::cubes;
    use pbig_core::oracle;

    #[test]
    fn pbigs_grid_finds_the_pairs_of_brute_force_in_the_cells_that_were_foretold() {
        let boxes = cubes(1000, 4.0, 3.0, 1);
        for boxes_per_cell in [2.0, 32.0] {
            let settings = PbigSettings { boxes_per_cell, ..SETTINGS };
            let mut found = pbig_grid(&boxes, &settings).expect("few boxes");
            found.pairs.sort_unstable();
            assert_eq!(found.pairs, oracle::pairs(&boxes));
            assert_eq!(found.plan.cell, PbigCells::new(&boxes).length(&settings));
            assert!(found.checks.made >= found.pairs.len() as u64);
        }
    }

    #[test]
    fn our_grid_takes_few_boxes_too() {
        let mut finder = Finder::new(with_our_grid(Config::DEFAULT));
        finder.find(&cubes(20, 1.0, 1.0, 1)).expect("few pairs");
        assert_eq!(algorithm(&finder.report().plan), "grid");
    }
}

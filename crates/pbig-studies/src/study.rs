//! Parts for studies only: PBIG's grid on the CPU, its settings on a GPU, the grid for few boxes.

use pbig_core::pbig::Summary;
use pbig_core::{Aabb, Config, Engine, GpuOptions, Plan};
use pbig_harness::pbig_grid::PbigPlan;

pub use pbig_core::CellRule;
pub use pbig_core::pbig::density_cell;
pub use pbig_harness::pbig_grid::{PbigFound, pbig_grid};
pub use pbig_shaders::study::{INDEX_PAIRS, LAZY_ENDS, LAZY_PAIRS, ROW_ENDS};

/// Settings of PBIG's grid, of which the CPU reads `cell_rule`, `boxes_per_cell` and `small_cell`.
pub type PbigSettings = GpuOptions;

/// The settings that the GPU uses by default.
pub const SETTINGS: PbigSettings = GpuOptions::DEFAULT;

/// Most boxes that a GPU searches without a grid by default.
pub const ALL_PAIRS_UP_TO: u32 = SETTINGS.all_pairs_up_to;

/// The boxes of one set, as PBIG's rule for the cell length sees them.
pub struct PbigCells(Summary);

impl PbigCells {
    /// Reads the boxes, once for all lengths.
    pub fn new(boxes: &[Aabb]) -> Self {
        Self(Summary::of(boxes))
    }

    /// Returns the cell length that these settings give, in the boxes' length unit.
    pub fn length(&self, settings: &PbigSettings) -> f32 {
        PbigPlan::new(&self.0, settings).cell
    }
}

/// Returns a configuration whose GPU uses this grid for more than `all_pairs_up_to` boxes.
///
/// `all_pairs_up_to` is 0 (always the grid) or [`ALL_PAIRS_UP_TO`].
pub fn with_gpu_grid(config: Config, settings: &PbigSettings, all_pairs_up_to: u32) -> Config {
    let PbigSettings { cell_rule, boxes_per_cell, small_cell, .. } = *settings;
    let gpu = GpuOptions { cell_rule, boxes_per_cell, small_cell, all_pairs_up_to, ..config.gpu };
    Config { gpu, ..config }
}

/// Returns a configuration that uses our grid on the CPU, however few the boxes.
pub fn with_our_grid(config: Config) -> Config {
    Config { engine: Some(Engine::Rebuild), ..config }
}

/// Returns the name of the algorithm that did the work.
pub fn algorithm(plan: &Plan) -> &'static str {
    plan.algorithm.name()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;
    use pbig_harness::boxes::cubes;

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
}

//! What a caller can choose. Every field says its unit, why one would change it, and what follows.

use crate::plan::Costs;
use std::time::Duration;

/// Where the work runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Backend {
    /// What the plan expects to be fastest.
    #[default]
    Auto,
    /// The CPU, with rayon's threads when the scene is worth it.
    Cpu,
    /// A GPU. Without one the call finishes on the CPU and [`crate::Report::fallback`] says so.
    Gpu,
    /// Every pair is tested, on the CPU: the definition of right, quadratic time.
    Brute,
}

/// Which algorithm finds the pairs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Strategy {
    /// The plan decides between brute force and the grid; on a GPU up to 1024 boxes need none. On the CPU
    /// [`crate::BroadPhase`] keeps up to 1024 boxes in a bitmap instead, unless many change and the grid takes less.
    #[default]
    Auto,
    /// One entry a box, sorted by the cell of its lower corner; the fastest on a CPU. On a GPU as
    /// [`Strategy::Pbig`].
    Grid,
    /// PBIG's own grid: one entry for each cell that a box touches (PBIG 4.2), however few the boxes. What
    /// a GPU runs; on the CPU plain, scalar and slower than [`Strategy::Grid`], to compare with.
    Pbig,
}

/// The rule by which the GPU turns [`GpuOptions::boxes_per_cell`] into a cell size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum CellRule {
    /// PBIG's equation 6: the smallest cell with that many entries on average. A box has an entry in every cell that it
    /// touches.
    #[default]
    Objective,
    /// Avril's section 4.1: the cell that holds that many boxes at the density of the space, whatever their sizes.
    Density,
}

/// In which order lists of pairs come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Order {
    /// By `(a, b)`: the same bytes on every backend, strategy and thread count.
    #[default]
    Sorted,
    /// As found. Saves the sort, about a third of the time of a whole call. On a GPU the order differs
    /// from call to call.
    Unspecified,
}

/// Most boxes and pairs that a call accepts. They bound memory; they do not keep it below what the machine has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Limits {
    /// Most boxes, and one more than the largest id of [`crate::BroadPhase`], which keeps about
    /// 200 bytes for every id up to the largest.
    pub max_boxes: u64,
    /// Most pairs that one call may report; 8 bytes each, up to 32 while [`crate::BroadPhase`] keeps it.
    pub max_pairs: u64,
}

impl Limits {
    /// 2^27 boxes (3 GiB of boxes alone) and 2^28 pairs (2 GiB).
    pub const DEFAULT: Self = Self { max_boxes: 1 << 27, max_pairs: 1 << 28 };
    /// As far as 32-bit numbers of boxes, and of the pairs that [`crate::BroadPhase`] keeps, reach.
    pub const UNLIMITED: Self = Self { max_boxes: 1 << 31, max_pairs: u64::MAX };
}

impl Default for Limits {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// The coding of the GPU's output (docs/PAIR_FORMAT.md).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Coding {
    /// The coding that would have been smaller in the last call, with the tables for decoding.
    #[default]
    Auto,
    /// Two ids a pair.
    Plain,
    /// PBIG's three levels of cell, segment and place in the segment (PBIG 5.2). Without a grid: one bit for each pair of
    /// boxes (Avril 3.4).
    Packed,
}

/// The settings of the GPU backend. The defaults suit most programs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GpuOptions {
    /// Coding of the output (PBIG table IV, "data compression").
    pub coding: Coding,
    /// If true, check, transfer and decoding of several chunks of work overlap (PBIG table IV, "pipelining").
    pub pipelining: bool,
    /// If true, the rows of a large cell get equally many pairs (PBIG table IV, "load balancing").
    pub load_balancing: bool,
    /// Estimate of the row in Avril's mapping (Avril 3.3). 0: the device's square root. 1 to 4: Carmack's inverse root with
    /// so many Newton steps. 5 to 8: Lomont's, with 1 to 4 steps. 9: bisection. All are exact, because integers correct
    /// the estimate.
    pub root: u32,
    /// Number of small and of large work items of a submission. They have at most 256 and 524,288 tests each. Longer
    /// submissions may exceed the time limit of some systems.
    pub chunk: [u32; 2],
    /// Largest buffer and binding in bytes, at least 2^20. The device may allow less.
    pub max_bytes: u64,
    /// Size in bytes, in the first call, of buffers whose needed size is unknown.
    pub first_bytes: u64,
    /// Longest time that a call waits for the device before it finishes on the CPU.
    pub patience: Duration,
    /// Time for which calls stay on the CPU after the device failed.
    pub pause: Duration,
    /// Wanted boxes per cell: PBIG's `W` in the constraint `f >= W` of equation 6. More boxes make larger cells. The paper
    /// takes a warp, 32.
    pub boxes_per_cell: f32,
    /// Rule that turns the wanted boxes per cell into a cell size.
    pub cell_rule: CellRule,
    /// Most boxes of a cell, up to 256, whose pairs are tested through Avril's mapping. Larger cells are tested by PBIG's
    /// balanced rows.
    pub small_cell: u32,
    /// Most boxes of a set whose pairs are all tested, without a grid. 0: there is always a grid. Avril's table 7 puts the
    /// crossover at 1000.
    pub all_pairs_up_to: u32,
}

impl GpuOptions {
    /// The defaults.
    pub const DEFAULT: Self = Self {
        coding: Coding::Auto,
        pipelining: true,
        load_balancing: true,
        root: 0,
        chunk: [1 << 18, 1 << 12],
        max_bytes: u64::MAX,
        first_bytes: 1 << 16,
        patience: Duration::from_secs(30),
        pause: Duration::from_secs(5),
        boxes_per_cell: 4.0,
        cell_rule: CellRule::Objective,
        small_cell: 32,
        all_pairs_up_to: 1024,
    };
}

impl Default for GpuOptions {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// How [`crate::BroadPhase`] makes events on the CPU, where [`Config::study`] asks for a way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Updates {
    /// What the plan expects to be fastest.
    #[default]
    Auto,
    /// Changed boxes are put into other cells, and only they are searched for. All are where that cannot be: in the first
    /// update, and once too many are out of the grid's order.
    Edits,
    /// All are searched, in a grid that is built anew.
    Anew,
    /// By a list of near pairs, whatever it costs. Without one where none can be made: it is not known how far boxes
    /// move, as in the first update, or more than 256 pairs a box would be near; and, as all of these, not with
    /// [`Strategy::Pbig`], [`Backend::Brute`] or where a GPU does the update.
    Near,
}

/// The CPU's grids, where [`Config::study`] asks for some. Where every pair is tested there is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Grids {
    /// What the plan expects to be fastest.
    #[default]
    Auto,
    /// One for all boxes, however they differ in size.
    One,
    /// Levels by size, or one and a list of the largest boxes. As planned where all are of one size: none can be split off.
    Levels,
}

/// The rows of cells at which a box looks in the CPU's search of its own grid, where [`Config::study`] asks for some.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Look {
    /// By the size of cells, and by how many boxes they hold.
    #[default]
    Auto,
    /// At all rows: where boxes are few, to look costs less than to decide.
    Everywhere,
    /// Not at what rows have beyond a box's reach: where cells hold several boxes.
    Trimmed,
    /// At other rows than its own only where a box reaches them: where cells are so large that few do.
    Seldom,
}

/// Ways to take whatever the plan would choose, for study and tests: about speed only, pairs and events are the same by all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Study {
    /// How [`crate::BroadPhase`] makes events. With any but [`Updates::Auto`] it has no bitmap.
    pub updates: Updates,
    /// One grid, or levels.
    pub grids: Grids,
    /// Which rows the search looks at.
    pub look: Look,
}

impl Study {
    /// Everything as planned.
    pub const DEFAULT: Self = Self { updates: Updates::Auto, grids: Grids::Auto, look: Look::Auto };
}

impl Default for Study {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Everything a caller can choose; the defaults are right for most.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Config {
    /// Where the work runs.
    pub backend: Backend,
    /// Which algorithm, for study and for tests.
    pub strategy: Strategy,
    /// Order of lists of pairs; events are always sorted.
    pub order: Order,
    /// When to end with an error.
    pub limits: Limits,
    /// How far a stored box reaches beyond the box it was given ([`crate::BroadPhase`] only), in
    /// the caller's length unit. Larger: fewer boxes count as changed, more pairs are reported
    /// that do not touch yet.
    pub margin: f32,
    /// On the CPU, below this many boxes every pair is tested without a grid, and costs are not compared
    /// ([`crate::Finder`]). Avril's table 7 puts the crossover at 1000 boxes on a GPU of 2008; on a CPU core of 2022 it is between
    /// 30 and 50, and above this number the plan finds it by the costs.
    pub brute_below: u32,
    /// What work costs, for the plan. None: as measured on this machine where a choice is close. With costs given here, from
    /// a file say, plans of searches from nothing are the same on every machine. Pairs and events always are.
    pub costs: Option<Costs>,
    /// About the GPU backend.
    pub gpu: GpuOptions,
    /// Ways on the CPU that are not left to the plan.
    pub study: Study,
}

impl Config {
    /// The defaults.
    pub const DEFAULT: Self = Self {
        backend: Backend::Auto,
        strategy: Strategy::Auto,
        order: Order::Sorted,
        limits: Limits::DEFAULT,
        margin: 0.0,
        brute_below: 32,
        costs: None,
        gpu: GpuOptions::DEFAULT,
        study: Study::DEFAULT,
    };
}

impl Default for Config {
    fn default() -> Self {
        Self::DEFAULT
    }
}

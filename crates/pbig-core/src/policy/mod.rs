//! The choices of engine, backend, cells and threads, and their constants. A choice is a fixed rule on counts, never on a clock:
//! the same boxes and the same calls take the same path on every machine.
//!
//! Constants of plans and threads are here. `engine` chooses how an update is made, `backend` where a call runs. `search` has the
//! budgets of a search, and `bvh` the upkeep of the tree. A constant that decides nothing stands in the file that uses it.

mod backend;
pub(crate) mod bvh;
mod engine;
pub(crate) mod search;

pub use backend::NoDevice;
pub(crate) use backend::no_device;
pub(crate) use engine::{
    GivenUp, PARALLEL_FROM_CHANGES, is_listed, look_up_to_nodes, may_look_up, may_place,
};

/// Minimum number of boxes for a search on several threads. Waking a thread takes about as long as 16,384 boxes take alone.
pub(crate) const PARALLEL_FROM_BOXES: usize = 16_384;

/// Maximum number of boxes for a test of every pair, eight at a time: a grid takes longer.
pub(crate) const BRUTE_FORCE_UP_TO_BOXES: usize = 400;

/// Maximum number of boxes of the smaller of two sets for a test of every pair: a test takes 1.3 ns, sorting a box about 25.
pub(crate) const FEW_BOXES: usize = 16;

/// Wanted number of boxes in a cell, where density and not size decides about cells.
pub(crate) const BOXES_PER_CELL: f64 = 0.5;

/// Maximum number of cells for each box. With more, clearing and scanning counts takes longer than full cells do.
pub(crate) const MAX_CELLS_PER_BOX: f64 = 8.0;

/// Number of cells that a grid may have for any number of boxes.
pub(crate) const MIN_CELLS: f64 = 4096.0;

/// Maximum mean number of boxes in a cell for a search to visit all of the five runs of the half neighbourhood.
pub(crate) const RUNS_UP_TO_PER_CELL: f64 = 3.0;

/// Maximum mean number of boxes of both sets in a cell of 64 steps (see `search/grid/cells.rs`), for their cells to have 128, if the sample
/// tells of no other boxes in a box's cell. A search of sparse sets took half as long, because windows have fewer rows. One of dense sets would test two to three times
/// as many boxes.
pub(crate) const LONG_CELLS_UP_TO_PER_CELL: f64 = 1.0;

/// Maximum extent of a box that a grid takes, in extents of its largest box: a cube that turns by 10 degrees grows this much.
pub(crate) const MAX_SLACK: f32 = 1.16;

/// Maximum number of other boxes in a box's cell, by the sample. Above it cells shrink: boxes lie in clusters far apart.
pub(crate) const MAX_CROWD: f64 = 32.0;

/// Number of other boxes in a box's cell, by the sample, at which cells stop shrinking.
pub(crate) const WANTED_CROWD: f64 = 8.0;

/// Minimum number of coincidences in the sample for a conclusion: a few may be chance.
pub(crate) const MIN_COINCIDENCES: usize = 16;

/// Minimum ratio of the largest extent to the median for sizes to be counted by class, which tells which boxes are oversize.
pub(crate) const MIXED_SIZE_RATIO: f32 = 4.0;

/// Costs, in ns on one core, that decide which boxes are oversize: of a box in the grid, of a candidate in its cells, and
/// of a test against an oversize box.
pub(crate) const NS_PER_BOX: f64 = 40.0;
pub(crate) const NS_PER_CANDIDATE: f64 = 0.35;
pub(crate) const NS_PER_OVERSIZE_TEST: f64 = 1.5;

/// Minimum id for which a jump far above the known ids is an error: the tables take 65 bytes for each id below.
pub(crate) const SPARSE_FROM_ID: u32 = 1 << 24;

/// Maximum factor between a new id and the number of known ids, for ids from [`SPARSE_FROM_ID`] on.
pub(crate) const MAX_ID_GROWTH: u32 = 64;

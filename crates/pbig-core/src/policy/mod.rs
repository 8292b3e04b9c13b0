//! Every choice and every constant behind one. A choice is a fixed rule on counts, never on a clock: the same boxes and the
//! same calls take the same path on every machine.
//!
//! Constants of plans and threads are here; `engine` chooses how an update is made, `backend` where a call runs.

mod backend;
mod engine;
pub(crate) mod index;
pub(crate) mod search;

pub use backend::NoDevice;
pub(crate) use backend::{AvailableDevice, Choice, choose_backend};
pub(crate) use engine::{
    Counts, GivenUp, PARALLEL_FROM_EDITS, choose_engine, edit_up_to_work, look_up_to_nodes,
    old_states_to_keep,
};

/// Boxes from which several threads share a search: waking one costs about as much as 16,384 boxes take alone.
pub(crate) const PARALLEL_FROM_BOXES: usize = 16_384;

/// Boxes of which every pair is tested: a grid takes longer.
pub(crate) const BRUTE_FORCE_UP_TO_BOXES: usize = 64;

/// Wanted boxes in a cell where their density, not their size, decides.
pub(crate) const BOXES_PER_CELL: f64 = 0.5;

/// Cells for each box, at most: beyond, clearing and scanning counts takes longer than full cells do.
pub(crate) const MAX_CELLS_PER_BOX: f64 = 8.0;

/// Cells that a grid may have, however few the boxes.
pub(crate) const MIN_CELLS: f64 = 4096.0;

/// Boxes in a cell up to which the five runs of the half neighbourhood are visited unseen.
pub(crate) const RUNS_UP_TO_PER_CELL: f64 = 3.0;

/// Largest extent that a grid takes, in extents of its largest box, at most: a cube that turns by 10 degrees grows so much.
pub(crate) const MAX_SLACK: f32 = 1.16;

/// Others in a box's cell, by the sample, from which cells are made smaller: boxes lie in clusters far apart.
pub(crate) const MAX_CROWD: f64 = 32.0;

/// Others in a box's cell at which cells are small enough then.
pub(crate) const WANTED_CROWD: f64 = 8.0;

/// Coincidences in the sample that say something: a few may be chance.
pub(crate) const MIN_COINCIDENCES: usize = 16;

/// Largest extent, in medians, from which sizes are counted by class to find which boxes are oversize.
pub(crate) const MIXED_SIZE_RATIO: f32 = 4.0;

/// Costs, in ns on one core, that decide which boxes are oversize: of a box in the grid, of a candidate in its cells, and
/// of a test against an oversize box.
pub(crate) const NS_PER_BOX: f64 = 40.0;
pub(crate) const NS_PER_CANDIDATE: f64 = 0.35;
pub(crate) const NS_PER_OVERSIZE_TEST: f64 = 1.5;

/// Ids from which a jump far above the known ones is an error: the tables by id take 64 bytes for each id below.
pub(crate) const SPARSE_FROM_ID: u32 = 1 << 24;

/// By how much an id may be larger than all before, from there on.
pub(crate) const MAX_ID_GROWTH: u32 = 64;

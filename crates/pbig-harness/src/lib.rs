//! Box sets, motions, files, the headless runner and the frame of measurements behind the program `pbig`, the
//! studies, the tests and the examples.

pub mod bench;
pub mod boxes;
pub mod counting;
pub mod duel;
pub mod field;
pub mod files;
pub mod gpu_race;
pub mod hard;
pub mod motions;
pub mod options;
pub mod output;
pub mod pair_index;
pub mod pbig_grid;
pub mod prelude;
pub mod queries;
pub mod report;
pub mod runner;
pub mod table;

pub use pbig_chart as chart;
pub use pbig_scenes::{frames, pair_order, scenes, world};

//! Box sets, motions, files, the headless runner and the frame of measurements behind the program `pbig`, the
//! studies, the tests and the examples.

#![allow(missing_docs, reason = "most names say it; not published")]

#[cfg(feature = "run")]
pub mod bench;
pub mod boxes;
#[cfg(feature = "checks")]
pub mod checks;
pub mod corpus;
#[cfg(feature = "run")]
pub mod counting;
#[cfg(feature = "files")]
pub mod files;
pub mod follower;
pub mod hard;
#[cfg(feature = "files")]
pub mod mesh;
pub mod motions;
#[cfg(feature = "run")]
pub mod options;
#[cfg(feature = "run")]
pub mod output;
pub mod pair_index;
#[cfg(feature = "run")]
pub mod prelude;
#[cfg(feature = "run")]
pub mod report;
#[cfg(feature = "run")]
pub mod runner;
#[cfg(feature = "run")]
pub mod table;

#[cfg(feature = "run")]
pub use pbig_chart as chart;
#[cfg(feature = "run")]
pub use pbig_scenes::{pair_order, scenes, world};

//! Scenes and measurements for rapier3d 0.36.1.

#[path = "../../../crates/pbig-harness/src/chart.rs"]
pub mod chart;
pub mod queries;
pub mod run;
#[path = "../../../crates/pbig-scenes/src/scenes/mod.rs"]
pub mod scenes;
pub mod world;

pub use pbig_scenes::frames;

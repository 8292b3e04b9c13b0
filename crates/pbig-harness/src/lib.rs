//! Scenes, box sets, the headless runner and the shadow checker behind the `pbig` program.

pub mod boxes;
pub mod chart;
pub mod counting;
pub mod field;
pub mod files;
pub mod index;
pub mod kernels;
pub mod mechanics;
pub mod motions;
pub mod numbered;
pub mod options;
pub mod pair_index;
pub mod pbig_grid;
pub mod precision;
pub mod reported;
pub mod runner;
pub mod scenes;
pub mod shadow;
pub mod simulate;
pub mod sorted;
pub mod study;
pub mod wide;
pub mod world;

//! Worlds and measurements for rapier 0.36.1, in two or three dimensions, f32 or f64.

mod build;
#[cfg_attr(feature = "dim2", path = "two.rs")]
#[cfg_attr(not(feature = "dim2"), path = "three.rs")]
pub mod dimension;
pub mod queries;
pub mod run;
pub mod world;

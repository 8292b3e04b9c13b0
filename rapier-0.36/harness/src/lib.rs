//! Worlds and measurements for rapier 0.36.1, in two or three dimensions, f32 or f64.

#![allow(missing_docs, reason = "most names say it; not published")]

pub mod build;
#[cfg_attr(feature = "dim2", path = "two.rs")]
#[cfg_attr(not(feature = "dim2"), path = "three.rs")]
pub mod dimension;
pub mod queries;
pub mod run;
pub mod world;

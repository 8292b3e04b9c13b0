//! Scenes of rapier by name, number of bodies and seed, and the scene queries of a frame, for the harness, a viewer and a web page;
//! and what the viewer and the page share: the parts to draw, and a broad phase that can be exchanged.
//! Nothing here draws, starts a thread or reads a clock, so all of it builds for wasm32-unknown-unknown.

#![allow(missing_docs, reason = "most names say it; not published")]

#[cfg(feature = "rapier")]
mod build;
#[cfg(feature = "rapier")]
pub mod drawn;
#[cfg(feature = "rapier")]
pub mod exchange;
pub mod frames;
pub mod pair_order;
pub mod plan;
pub mod scenes;
#[cfg(feature = "rapier")]
pub mod stock;
pub mod times;
#[cfg(feature = "rapier")]
pub mod world;

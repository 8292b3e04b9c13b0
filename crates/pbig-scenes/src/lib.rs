//! Scenes of rapier by name, number of bodies and seed, for the harness, a viewer and a web page. Nothing here draws, starts
//! a thread or reads a clock, so all of it builds for wasm32-unknown-unknown.

pub mod scenes;
pub mod stock;
pub mod world;

//! Scenes, box sets, the headless runner and the shadow checker behind the `pbig` program.

pub mod boxes;

//! Shows rapier worlds with rapier's own broad phase and with pbig: in a window, or as pictures without one.
//!
//! | files | content |
//! | --- | --- |
//! | `program`, `options`, `error` | the program, its command line, and what can go wrong |
//! | `choice`, `engine`, `simulation`, `history` | the broad phase, the world and their times; nothing here draws |
//! | `controls` | keys and what they do |
//! | `figures`, `graph`, `hud`, `sheet` | what is written over the picture, as texts and lines in pixels |
//! | `shapes`, `palette`, `cells`, `framing` | colliders as instances of meshes, their colours, the grid's cells, the camera |
//! | `draw`, `window`, `pictures` | drawing with kiss3d |
//! | `rapier` | conversions of rapier's types |

pub mod cells;
pub mod choice;
pub mod controls;
pub mod draw;
pub mod engine;
pub mod error;
pub mod figures;
pub mod framing;
pub mod graph;
pub mod history;
pub mod hud;
pub mod options;
pub mod palette;
pub mod pictures;
pub mod program;
pub mod rapier;
pub mod shapes;
pub mod sheet;
pub mod simulation;
pub mod window;

pub use program::main;

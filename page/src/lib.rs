//! Falling objects for a web page: a scene that steps with rapier's own broad phase or with pbig's, the times of each step, and
//! the shapes to draw.
//!
//! `exports` is all that JavaScript sees. The rest knows nothing of a browser, and is tested as a native program.

mod broad_phase;
mod clock;
mod device;
pub mod exports;
mod groups;
mod mesh;
mod parts;
mod run;

pub use broad_phase::{Choice, ExchangeableBroadPhase};
pub use groups::{Group, Groups};
pub use parts::Kind;
pub use run::{Run, StepTime};

//! Falling objects for a web page: a scene that steps with rapier's own broad phase or with pbig's, the times of each step, and
//! the shapes to draw.
//!
//! `exports` is all that JavaScript sees. The rest knows nothing of a browser, and is tested as a native program.

mod choice;
mod clock;
pub mod exports;
mod remote;
mod run;

pub use choice::Choice;
pub use run::Run;

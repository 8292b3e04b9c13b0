//! Runs the corpus through `Finder` and `BroadPhase` on targets where the test suite cannot run.
//!
//! `run.mjs` calls the exported functions in node; `main.rs` calls the same checks in a native program.

#[path = "../../crates/pbig-harness/src/boxes.rs"]
pub mod boxes;
#[path = "../../tests/src/corpus.rs"]
pub mod corpus;
mod exports;
mod fault;
mod finder;
mod follower;
mod motion;

use corpus::{Case, corpus};
pub use fault::Fault;
use pbig_core::Backend;

/// The backends that need no device.
const BACKENDS: [Backend; 3] = [Backend::Auto, Backend::Cpu, Backend::Brute];

/// Result of a run over the corpus.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Number of cases that were run.
    pub cases: u32,
    /// Number of cases that failed.
    pub failed: u32,
    /// Text of the first failure; empty without one.
    pub first: String,
}

/// Runs every case of the corpus.
pub fn run() -> Outcome {
    let mut outcome = Outcome::default();
    for case in corpus() {
        outcome.cases += 1;
        if let Err(why) = check(&case, Fault::None) {
            outcome.failed += 1;
            if outcome.first.is_empty() {
                outcome.first = why;
            }
        }
    }
    outcome
}

/// Returns the failure that a planted fault causes in the corpus, or none if the checks overlook it.
pub fn notice(fault: Fault) -> Option<String> {
    corpus().iter().find_map(|case| check(case, fault).err())
}

/// Checks one case on every backend, all at once and in motion.
fn check(case: &Case, fault: Fault) -> Result<(), String> {
    for backend in BACKENDS {
        let named = |why| format!("{}, {backend:?}, {why}", case.name);
        finder::check(&case.boxes, backend, fault).map_err(named)?;
        motion::check(&case.boxes, backend, fault).map_err(named)?;
    }
    Ok(())
}

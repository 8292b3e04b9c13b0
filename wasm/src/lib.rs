//! Runs the corpus through `Finder` and `BroadPhase`, and a rapier world, on targets where the test suite cannot run.
//!
//! `run.mjs` calls the exported functions in node; `main.rs` calls the same checks in a native program.

pub mod exports;
mod fault;
mod finder;
mod motion;
mod world;

pub use fault::Fault;
use pbig_core::Backend;
use pbig_harness::corpus::{Case, corpus};

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
    /// What happened in the rapier world.
    pub world: String,
}

impl Outcome {
    /// Counts a case. Returns what it produced, if it passed.
    fn count<T>(&mut self, result: Result<T, String>) -> Option<T> {
        self.cases += 1;
        result
            .inspect_err(|why| {
                self.failed += 1;
                if self.first.is_empty() {
                    self.first.clone_from(why);
                }
            })
            .ok()
    }
}

/// Runs every case of the corpus, and the rapier world as one more case.
pub fn run() -> Outcome {
    let mut outcome = Outcome::default();
    for case in corpus() {
        outcome.count(check(&case, Fault::None));
    }
    outcome.world = outcome.count(world::check(Fault::None)).unwrap_or_default();
    outcome
}

/// Returns the failure that a planted fault causes, or none if the checks overlook it.
pub fn notice(fault: Fault) -> Option<String> {
    let in_corpus = || corpus().iter().find_map(|case| check(case, fault).err());
    if fault == Fault::WorldLoses { world::check(fault).err() } else { in_corpus() }
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

//! Runs the corpus through `Finder` and `BroadPhase`, and a rapier world, on targets where the test suite cannot run.
//!
//! `run.mjs` calls the exported functions in node; `main.rs` calls the same checks in a native program.

pub mod exports;
mod fault;
mod finder;
mod motion;
mod world;

use fault::Fault;
use pbig_core::Backend;
use pbig_harness::corpus::{Case, corpus};

/// The backends that need no device.
const BACKENDS: [Backend; 3] = [Backend::Auto, Backend::Cpu, Backend::Brute];

/// Result of a run.
pub struct Outcome {
    /// Report for the terminal: counts, the first failure, and the planted faults that were overlooked.
    pub text: String,
    /// True if every case passed and every planted fault was noticed.
    pub has_passed: bool,
}

/// Runs every case of the corpus, and the rapier world as one more case; then the planted faults.
pub fn run() -> Outcome {
    let cases = corpus();
    let mut failures: Vec<String> = cases.iter().filter_map(|case| check(case, Fault::None).err()).collect();
    let world = world::check(Fault::None);
    failures.extend(world.clone().err());
    let (all, failed) = (cases.len() + 1, failures.len());
    let told: Vec<String> = failures.into_iter().take(1).chain(world.ok()).collect();
    let overlooked: Vec<Fault> = Fault::PLANTED.into_iter().filter(|fault| !is_noticed(*fault)).collect();
    let text = format!(
        "{} cases passed, {failed} failed\n{}\n{} planted faults, overlooked: {overlooked:?}",
        all - failed,
        told.join("\n"),
        Fault::PLANTED.len()
    );
    Outcome { text, has_passed: failed == 0 && overlooked.is_empty() }
}

/// Returns true if the checks notice a planted fault.
fn is_noticed(fault: Fault) -> bool {
    match fault {
        Fault::WorldLoses => world::check(fault).is_err(),
        _ => corpus().iter().any(|case| check(case, fault).is_err()),
    }
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

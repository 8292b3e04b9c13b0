//! The corpus, the rapier world and the planted faults in a native program: for processors that an emulator runs.

use pbig_wasm::{Fault, notice, run};
use std::process::ExitCode;

fn main() -> ExitCode {
    let outcome = run();
    println!("{} cases passed, {} failed", outcome.cases - outcome.failed, outcome.failed);
    if outcome.failed > 0 {
        println!("{}", outcome.first);
    }
    println!("{}", outcome.world);
    let overlooked: Vec<_> = Fault::PLANTED.into_iter().filter(|fault| notice(*fault).is_none()).collect();
    println!("{} planted faults, overlooked: {overlooked:?}", Fault::PLANTED.len());
    if outcome.failed == 0 && overlooked.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

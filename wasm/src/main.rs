//! The corpus, the rapier world and the planted faults in a native program: for processors that an emulator runs.

use std::process::ExitCode;

fn main() -> ExitCode {
    let outcome = pbig_wasm::run();
    println!("{}", outcome.text);
    if outcome.has_passed { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

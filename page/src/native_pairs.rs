//! Prints the broad phase's pairs after each step: `native_pairs SCENE BODIES SEED STEPS [stock|pbig]`.
//!
//! Each line is the JSON array of one step: indices of colliders, pair after pair, sorted. The page's test compares them with
//! the pairs of the WebAssembly module.

use pbig_page::{Choice, Run};
use std::process::ExitCode;

const USAGE: &str = "usage: native_pairs SCENE BODIES SEED STEPS [stock|pbig]";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match print_pairs(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn print_pairs(arguments: &[String]) -> Result<(), String> {
    let [scene, bodies, seed, steps, rest @ ..] = arguments else { return Err(USAGE.into()) };
    let choice = rest.first().map_or(Ok(Choice::Pbig), |name| name.parse())?;
    let mut run = Run::new(scene, number(bodies)? as usize, number(seed)?, choice)?;
    for _ in 0..number(steps)? {
        run.step()?;
        println!("{:?}", run.pairs().as_flattened());
    }
    Ok(())
}

fn number(text: &str) -> Result<u64, String> {
    text.parse().map_err(|error| format!("'{text}': {error}\n{USAGE}"))
}

//! The `pbig` program. Its commands, files, JSON and exit status are in docs/CLI.md; other programs
//! rely on them.

mod accuracy;
mod bench;
mod doctor;
mod options;
mod output;
mod pairs;
mod replay;
mod simulate;
mod usage;

use clap::{CommandFactory, Parser, Subcommand};
use output::Failure;
use pbig_harness::counting::Counting;
use std::process::ExitCode;

/// For `bench`, which says how often an update asks for memory.
#[global_allocator]
static COUNTING: Counting<false> = Counting;

/// Finds every pair of overlapping axis-aligned boxes.
#[derive(Parser)]
#[command(name = "pbig", version, about = "Finds every pair of overlapping axis-aligned boxes")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// All overlapping pairs of the boxes in a file.
    Pairs(pairs::Args),
    /// Pairs that come and go while boxes move from frame to frame.
    Replay(replay::Args),
    /// A headless rapier world.
    Simulate(simulate::Args),
    /// The scenes for `simulate`, with a line each.
    Scenes,
    /// How fast it is here; results are written to docs/benchmarks/results.
    Bench(bench::Args),
    /// Run time against error; results are written to docs/benchmarks/accuracy.md.
    Accuracy(accuracy::Args),
    /// Finds pairs and says how much memory that took: a process of its own for `bench`.
    #[command(hide = true)]
    MemoryProbe(bench::memory::Args),
    /// What this machine offers, what is chosen and why, and a self-test.
    Doctor,
}

fn main() -> ExitCode {
    match Cli::try_parse() {
        Ok(cli) => finish(run(cli.command)),
        Err(error) if !error.use_stderr() => finish(output::print(&error.to_string())),
        Err(error) => finish(Err(usage::failure(&error, &Cli::command(), std::env::args_os().nth(1)))),
    }
}

fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Pairs(args) => pairs::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Scenes => simulate::list(),
        Command::Bench(args) => bench::run(&args),
        Command::Accuracy(args) => accuracy::run(&args),
        Command::MemoryProbe(args) => bench::memory::probe(&args),
        Command::Doctor => doctor::run(),
    }
}

fn finish(result: Result<(), Failure>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            // Nothing is left to do when stderr is closed too.
            let _ =
                std::io::Write::write_all(&mut std::io::stderr(), format!("pbig: {failure}\n").as_bytes());
            failure.code()
        }
    }
}

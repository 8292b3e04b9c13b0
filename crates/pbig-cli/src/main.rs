//! The program `pbig`. Its commands, files, JSON and exit status are in docs/CLI.md; other programs
//! rely on them.

mod backend;
mod bench;
mod doctor;
mod mesh;
mod options;
mod pairs;
mod replay;
mod simulate;
mod studies;
mod usage;

use clap::{CommandFactory, Parser, Subcommand};
use pbig_harness::output::{Failure, finish, print};
use std::ffi::OsString;
use std::process::ExitCode;

/// Finds every pair of overlapping axis-aligned boxes.
#[derive(Parser)]
#[command(name = "pbig", version, about = "Finds every pair of overlapping axis-aligned boxes")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// All overlapping pairs of the boxes in a file, of two files, or of a mesh.
    Pairs(pairs::Args),
    /// Pairs that come and go while boxes move from frame to frame.
    Replay(replay::Args),
    /// A headless rapier world.
    Simulate(simulate::Args),
    /// The scenes for `simulate`, with a line each.
    Scenes,
    /// Measures times on this machine; --write writes them into a folder.
    Bench(bench::Args),
    /// Run time against error: `pbig-studies accuracy`.
    #[command(disable_help_flag = true)]
    Accuracy {
        /// Options of `pbig-studies accuracy`.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        options: Vec<OsString>,
    },
    /// Finds pairs and prints the memory that this took: a process of its own for `bench`.
    #[command(hide = true)]
    MemoryProbe(bench::memory::Args),
    /// Prints what this machine offers and what is chosen, with reasons, and runs a self-test.
    Doctor(doctor::Args),
}

fn main() -> ExitCode {
    silence_drivers();
    let result = match Cli::try_parse() {
        Ok(cli) => run(cli.command),
        Err(error) if !error.use_stderr() => print(&error.to_string()),
        Err(error) => Err(usage::failure(&error, &Cli::command(), std::env::args_os().nth(1))),
    };
    finish("pbig", result)
}

/// Keeps drivers that look for a window system from complaining on stderr that there is none.
fn silence_drivers() {
    const FOLDER: &str = "XDG_RUNTIME_DIR";
    if cfg!(target_os = "linux") && std::env::var_os(FOLDER).is_none() {
        // SAFETY: No other thread runs yet.
        unsafe { std::env::set_var(FOLDER, "/nonexistent") };
    }
}

fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Pairs(args) => pairs::run(&args),
        Command::Replay(args) => replay::run(&args),
        Command::Simulate(args) => simulate::run(&args),
        Command::Scenes => simulate::list(),
        Command::Bench(args) => bench::run(&args),
        Command::Accuracy { options } => studies::run("accuracy", options),
        Command::MemoryProbe(args) => bench::memory::probe(&args),
        Command::Doctor(args) => doctor::run(&args),
    }
}

//! The program `pbig-studies`: numbers as tables, one JSON object, or files.

use clap::{Parser, Subcommand};
use pbig_harness::output::{Failure, finish};
use pbig_studies::{accuracy, hard, papers, peers, steady, worst};
use std::path::PathBuf;
use std::process::ExitCode;

/// The papers' experiments, run time against error, and pbig beside other trees.
#[derive(Parser)]
#[command(name = "pbig-studies", version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Print one JSON object.
    #[arg(long, global = true)]
    json: bool,
    /// Small sizes only, in less than a minute.
    #[arg(long, global = true)]
    quick: bool,
    /// Write the numbers as CSV, and the charts, into this folder.
    #[arg(long, global = true, value_name = "DIR")]
    write: Option<PathBuf>,
}

#[derive(Subcommand)]
enum Command {
    /// The experiments of PBIG's and Avril's papers, the printed numbers beside ours.
    Papers,
    /// Pbig alone beside parry's tree and obvhs.
    Peers,
    /// Times of updates by motion: mean, median, p99, worst.
    Steady {
        /// Numbers of boxes instead of its own.
        #[arg(long, value_name = "N,N", value_delimiter = ',')]
        boxes: Vec<usize>,
    },
    /// Worlds and histories on which a grid alone takes quadratic time.
    Hard,
    /// Searches for the world or history that takes most work for each box and pair.
    Worst {
        /// Duration of the search.
        #[arg(long, default_value_t = 60)]
        seconds: u64,
        /// Seed of the search's random numbers.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Boxes in a world.
        #[arg(long, default_value_t = 10_000)]
        boxes: usize,
        /// Kind of worlds to search among.
        #[arg(long, value_enum, default_value = "one-set")]
        kind: worst::Kind,
    },
    /// Run time against error, from the index of a pair to the pair.
    Accuracy,
}

fn main() -> ExitCode {
    finish("pbig-studies", run(&Cli::parse()))
}

fn run(cli: &Cli) -> Result<(), Failure> {
    let report = match &cli.command {
        Command::Papers => papers::run(cli.quick)?,
        Command::Peers => peers::run(cli.quick)?,
        Command::Steady { boxes } => steady::run(cli.quick, boxes)?,
        Command::Hard => hard::run(cli.quick)?,
        &Command::Worst { seconds, seed, boxes, kind } => {
            worst::run(worst::Search { seconds, seed, boxes, kind })?
        }
        Command::Accuracy => accuracy::run(cli.quick)?,
    };
    report.finish(cli.json, cli.write.as_deref())
}

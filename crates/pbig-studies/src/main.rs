//! The program `pbig-studies`: numbers as tables, one JSON object, or files.

use clap::{Parser, Subcommand};
use pbig_harness::output::{Failure, finish, print, tracked};
use pbig_harness::report::Report;
use pbig_studies::{accuracy, papers, peers, stages, steady, whole_steps};
use serde_json::{Map, json};
use std::path::PathBuf;
use std::process::ExitCode;

/// The papers' experiments, run time against error, and pbig beside other trees.
#[derive(Parser)]
#[command(name = "pbig-studies", version, about)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// The experiments of PBIG's and Avril's papers, the printed numbers beside ours.
    Papers(Options),
    /// Pbig alone, stage by stage: against boxes, movers, density and the spread of sizes.
    Stages(Options),
    /// Pbig alone beside parry's tree and obvhs.
    Peers(Options),
    /// How long updates take, and how evenly, by motion and of every scene.
    Steady {
        #[command(flatten)]
        options: Options,
        /// Numbers of boxes, and of bodies, instead of its own.
        #[arg(long, value_name = "N,N", value_delimiter = ',')]
        boxes: Vec<usize>,
    },
    /// Whole steps of rapier with its own broad phase and with pbig's, of every scene.
    WholeSteps(Options),
    /// Run time against error.
    Accuracy {
        #[command(flatten)]
        options: Options,
        /// This study alone.
        #[arg(long, value_name = "STUDY", value_parser = accuracy::STUDIES.map(|(name, _)| name))]
        only: Option<String>,
    },
}

#[derive(clap::Args)]
struct Options {
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Small sizes only, in less than a minute.
    #[arg(long)]
    quick: bool,
    /// Write the numbers as CSV, and the charts, into this folder.
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
}

fn main() -> ExitCode {
    finish("pbig-studies", run(Cli::parse().command))
}

fn run(command: Command) -> Result<(), Failure> {
    match command {
        Command::Papers(options) => told(&options, &papers::run(options.quick)?),
        Command::Stages(options) => told(&options, &stages::run(options.quick)?),
        Command::Peers(options) => told(&options, &peers::run(options.quick)?),
        Command::Steady { options, boxes } => told(&options, &steady::run(options.quick, &boxes)?),
        Command::WholeSteps(options) => told(&options, &whole_steps::run(options.quick)),
        Command::Accuracy { options, only } => run_accuracy(&options, only),
    }
}

fn told(options: &Options, report: &Report) -> Result<(), Failure> {
    report.finish(options.json, options.write.as_deref())
}

fn run_accuracy(options: &Options, only: Option<String>) -> Result<(), Failure> {
    let wanted = |name: &str| only.as_deref().is_none_or(|only| only == name);
    let mut objects = Map::new();
    let studies = accuracy::STUDIES.into_iter().filter(|(name, _)| wanted(name));
    for (name, study) in tracked(studies, "studies") {
        let report: Report = study(options.quick)?;
        if options.json {
            objects.insert(name.into(), report.object());
            options.write.as_ref().map_or(Ok(()), |folder| report.write(folder))?;
        } else {
            report.finish(false, options.write.as_deref())?;
        }
    }
    if options.json { print(&json!({ "suite": "accuracy", "studies": objects }).to_string()) } else { Ok(()) }
}

//! `pbig bench SUITE`: pbig and the other side, in turn in one run.

mod gpu;
pub(crate) mod memory;
mod step;
mod update;

use crate::studies;
use clap::ValueEnum;
use pbig_harness::output::Failure;
use std::ffi::OsString;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The suite to run.
    #[arg(value_enum)]
    suite: Suite,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Fewer and smaller cases, in seconds.
    #[arg(long)]
    quick: bool,
    /// Write the numbers as CSV, and the charts, into this folder.
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Suite {
    /// A broad phase's call through rapier, beside stock's on the same world; and memory.
    Update,
    /// The finder alone, beside parry's tree and obvhs (of `pbig-studies`).
    Peers,
    /// Whole steps of every scene, with stock and with ours in turn.
    Step,
    /// Times of updates by motion: mean, median, p99, worst (of `pbig-studies`).
    Steady,
    /// The experiments of PBIG's and Avril's papers, the printed figures beside ours (of `pbig-studies`).
    Papers,
    /// Whole calls on the best adapter beside the CPU, and their parts: upload, each kernel, readback.
    Gpu,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let report = match args.suite {
        Suite::Update => update::run(args.quick)?,
        Suite::Step => step::run(args.quick),
        Suite::Gpu => gpu::run(args.quick)?,
        Suite::Peers | Suite::Steady | Suite::Papers => return forward(args),
    };
    report.finish(args.json, args.write.as_deref())
}

fn forward(args: &Args) -> Result<(), Failure> {
    let name = args.suite.to_possible_value().expect("none is skipped");
    let flags = [("--json", args.json), ("--quick", args.quick)];
    let mut options: Vec<OsString> = flags.iter().filter(|flag| flag.1).map(|flag| flag.0.into()).collect();
    options.extend(args.write.iter().flat_map(|folder| ["--write".into(), folder.into()]));
    studies::run(name.get_name(), options)
}

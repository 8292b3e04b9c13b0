//! `pbig bench SUITE`: each row has ours and the other side, in turn in one run, and what is wanted.

mod finders;
mod gpu;
pub(crate) mod machine;
pub(crate) mod measure;
pub(crate) mod memory;
mod papers;
mod peers;
mod requests;
mod stages;
mod steady;
mod step;
mod table;
mod update;

use crate::options::bodies;
use crate::output::{Failure, print};
use clap::ValueEnum;
use machine::{Machine, slug};
use pbig_harness::chart::LogLog;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use table::Row;

/// The folder of documents in the project; results are in a folder in it.
pub(crate) const DOCUMENTS: &str = "docs/benchmarks";

#[derive(clap::Args)]
pub(crate) struct Args {
    /// What to measure.
    #[arg(value_enum)]
    suite: Suite,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
    /// Small sizes only, in seconds; nothing is written.
    #[arg(long)]
    quick: bool,
    /// Of `steady`: write the times as CSV, and a chart of some, into this folder.
    #[arg(long, value_name = "DIR")]
    write: Option<PathBuf>,
    /// Of `steady`: numbers of boxes, and of bodies, instead of its own.
    #[arg(long, value_name = "N,N", value_parser = bodies, value_delimiter = ',', allow_negative_numbers = true)]
    boxes: Vec<usize>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Suite {
    /// Ours alone, stage by stage: against boxes, movers, density and the spread of sizes.
    Stages,
    /// A broad phase's call through rapier, beside stock's on the same world; and memory.
    Update,
    /// The finder alone, beside parry's tree and obvhs.
    Peers,
    /// Every scene at every size, stock beside ours in each step.
    Step,
    /// Whether updates take equally long: mean, median, p99 and worst by motion, and of every scene.
    Steady,
    /// The experiments of PBIG's and Avril's papers, the printed figures beside ours.
    Papers,
    /// The GPU pipeline: upload, each kernel, readback, decode, whole call.
    Gpu,
}

/// The results of a suite.
struct Outcome {
    rows: Vec<Row>,
    /// Notes that a reader of the rows needs, a line each.
    notes: Vec<String>,
    charts: Vec<LogLog>,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let quick = args.quick;
    refuse_what_others_ignore(args)?;
    match args.suite {
        Suite::Stages => report("stages", stages::run(quick)?, args),
        Suite::Update => report("update", update::run(quick)?, args),
        Suite::Peers => report("peers", peers::run(quick)?, args),
        Suite::Step => report("step", step::run(quick)?, args),
        Suite::Steady => steady::run(args),
        Suite::Papers => papers::run(args),
        Suite::Gpu => gpu::run(args),
    }
}

fn refuse_what_others_ignore(args: &Args) -> Result<(), Failure> {
    let of_steady = [("--write", args.write.is_some()), ("--boxes", !args.boxes.is_empty())];
    match of_steady.into_iter().find(|&(_, given)| given) {
        Some((option, _)) if args.suite != Suite::Steady => {
            Err(Failure::Input(format!("{option} is for `pbig bench steady`, not for other suites")))
        }
        _ => Ok(()),
    }
}

/// Prints the rows; returns the JSON object.
fn show(suite: &str, outcome: &mut Outcome, machine: &Machine, json: bool) -> Result<Value, Failure> {
    outcome.notes.extend(table::summary(&outcome.rows));
    let object = object(suite, machine, outcome);
    if json {
        print(&object.to_string())?;
    } else {
        let notes = outcome.notes.join("\n");
        print(&format!("{}\n{}\n{notes}", machine.line(), table::text(&outcome.rows)))?;
    }
    Ok(object)
}

fn report(suite: &str, mut outcome: Outcome, args: &Args) -> Result<(), Failure> {
    let machine = Machine::here();
    let object = show(suite, &mut outcome, &machine, args.json)?;
    if args.quick {
        return Ok(());
    }
    save(&Path::new(DOCUMENTS).join(format!("{suite}.md")), &document(suite, &machine, &outcome))?;
    for chart in &outcome.charts {
        chart.write(&Path::new(DOCUMENTS).join(format!("{}.svg", chart.name)))?;
    }
    keep(&format!("{suite}-{}", slug(&machine.cpu)), &object, args.json)
}

fn object(suite: &str, machine: &Machine, outcome: &Outcome) -> Value {
    json!({
        "suite": suite,
        "day": machine.day,
        "machine": machine.object(),
        "rows": outcome.rows.iter().map(Row::object).collect::<Vec<_>>(),
        "notes": outcome.notes,
    })
}

fn document(suite: &str, machine: &Machine, outcome: &Outcome) -> String {
    let notes: String = outcome.notes.iter().map(|note| format!("- {note}\n")).collect();
    let charts: String =
        outcome.charts.iter().map(|chart| format!("\n![{}]({}.svg)\n", chart.title, chart.name)).collect();
    format!(
        "# `pbig bench {suite}`\n\nWritten by that command, nothing by hand. {}.\n\n{notes}\n{}{charts}",
        machine.line(),
        table::markdown(&outcome.rows)
    )
}

/// Writes results where the project keeps them, named by day, suite and machine.
pub(crate) fn keep(name: &str, object: &Value, quiet: bool) -> Result<(), Failure> {
    let day = time::OffsetDateTime::now_utc().date();
    let path: PathBuf = Path::new(DOCUMENTS).join("results").join(format!("{day}-{name}.json"));
    save(&path, &format!("{object:#}\n"))?;
    if quiet { Ok(()) } else { print(&format!("written to {}", path.display())) }
}

pub(crate) fn save(path: &Path, text: &str) -> Result<(), Failure> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let written = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(path, text));
    written.map_err(|error| Failure::Input(format!("{}: {error}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_has_the_machine_the_table_and_the_charts() {
        let (name, title, lines) = ("some-chart".into(), "a chart".into(), vec![]);
        let chart = LogLog { name, title, x: "boxes", y: "ms", lines, exponents: true };
        let rows = vec![Row::new("a case", 10, 3).ours(2.0)];
        let outcome = Outcome { rows, notes: vec!["a note".into()], charts: vec![chart] };
        let text = document("some", &Machine::here(), &outcome);
        for part in ["threads", "- a note\n", "| a case | 10 | 3 | 2.000 ms |", "![a chart](some-chart.svg)"]
        {
            assert!(text.contains(part), "{part} is not in:\n{text}");
        }
    }
}

//! `pbig bench papers`: the experiments of PBIG's and Avril's papers, the printed figures beside ours.
//!
//! The printed numbers are in `printed`, each with its place. Counts compare as numbers; times are of other
//! machines and stand beside ours to show how they grow.

mod avril;
mod cells;
mod claims;
mod coverage;
mod density;
mod device;
mod forms;
mod lazy;
mod lengths;
mod lockstep;
mod mapping;
mod matrix;
mod model;
mod numbers;
mod output;
mod printed;
mod sheet;
mod steps;
mod switches;
mod timing;

use super::finders::{Side, Way};
use super::machine::{Machine, slug};
use super::measure::{Effort, timed};
use super::{Args, DOCUMENTS, keep, save};
use crate::output::{Failure, print, progress};
use device::Device;
use pbig_core::{Aabb, Checks, Config, Limits, Order};
use pbig_harness::chart::{Line, LogLog};
use serde_json::{Value, json};
use sheet::Sheet;
use std::path::Path;
use std::time::{Duration, Instant};
use timing::Timing;

/// Unlimited and in no order, as the papers' programs.
const UNSORTED: Config = Config { limits: Limits::UNLIMITED, order: Order::Unspecified, ..Config::DEFAULT };

/// The size of the experiments.
struct Scale {
    quick: bool,
    /// Boxes of the experiment on readings of DoC.
    experiment: &'static [usize],
    /// Boxes where the papers have most.
    most_boxes: usize,
    /// Boxes of figures 8, 9 and 11 of PBIG.
    numbers: &'static [usize],
}

impl Scale {
    fn new(quick: bool) -> Self {
        if quick {
            Self { quick, experiment: &[10_000], most_boxes: 100_000, numbers: &[1000, 10_000, 100_000] }
        } else {
            let numbers = &[1000, 10_000, 100_000, 1_000_000, printed::MOST_BOXES];
            Self { quick, experiment: &[100_000, 1_000_000], most_boxes: printed::MOST_BOXES, numbers }
        }
    }
}

/// Rounds for so many boxes: a median where a call is short, the least where it takes seconds.
fn effort(boxes: usize) -> Effort {
    let (warm_up, rounds) = if boxes > 200_000 { (1, 3) } else { (3, 15) };
    Effort { warm_up, rounds, budget: Duration::from_secs(5) }
}

/// The results of one call from nothing, and its time.
struct Once {
    pairs: u64,
    checks: Checks,
    ms: f64,
    /// The length of PBIG's cells, where it has them.
    cell: Option<f32>,
}

fn once(way: impl Into<Way>, boxes: &[Aabb]) -> Result<Once, Failure> {
    let mut side = Side::new(way, None);
    let (found, ms) = timed(|| side.find(boxes));
    found.map_err(|error| Failure::Input(error.to_string()))?;
    Ok(Once { pairs: side.pairs(), checks: side.checks(), ms, cell: side.cell() })
}

fn chart(name: &str, title: &str, x: &'static str, lines: impl Into<Vec<Line>>) -> LogLog {
    let (name, title) = (format!("papers-{name}"), title.into());
    LogLog { name, title, x, y: "ms", lines: lines.into(), exponents: true }
}

type Part = fn(&Scale, &Device) -> Result<Vec<Sheet>, Failure>;

/// In the order of the document, with names for their times.
const PARTS: [(&str, Part); 8] = [
    ("PBIG table III and figure 10", |scale, device| {
        let readings = [density::readings(), density::experiment(scale)?, coverage::rule()];
        let counted = [coverage::table(scale)?, coverage::on_device(scale, device)?];
        Ok(readings.into_iter().chain(counted).chain([output::bytes(scale, device)?]).collect())
    }),
    ("PBIG figures 8 and 9", |scale, device| {
        Ok(vec![numbers::uniform(scale, device)?, lengths::cells(scale, device)?])
    }),
    ("PBIG figure 11", |scale, device| Ok(vec![numbers::gaussian(scale, device)?])),
    ("PBIG tables IV to VI", switches::on_gpu),
    ("PBIG table IV on the CPU", |scale, _| Ok(vec![switches::on_cpu(scale)?])),
    ("Avril tables 1, 2, 4 and 5", |scale, device| {
        let mapping = [lazy::table(scale)?, mapping::roots(device)?, mapping::in_cells(device)?];
        let output = [avril::bytes(), forms::on_cpu()?, forms::on_device(device)?];
        Ok([matrix::table(device)?].into_iter().chain(mapping).chain(output).collect())
    }),
    ("Avril figures 4 to 6, tables 6 and 7", |scale, device| {
        let (steps, movers) = (steps::steps(scale, device)?, steps::movers(scale, device)?);
        let steps = [steps, movers, avril::crossover(scale, device)?];
        Ok([avril::brute_force(device)?].into_iter().chain(steps).collect())
    }),
    ("what the papers print", |_, _| Ok(vec![claims::pbig(), claims::avril()])),
];

/// All tables, and how long each part took.
fn made(quick: bool, device: &Device) -> Result<(Vec<Sheet>, Timing), Failure> {
    let (scale, bar) = (Scale::new(quick), progress(PARTS.len(), "tables"));
    let (mut sheets, mut timing) = (Vec::new(), Timing::new(quick));
    for (name, part) in PARTS {
        let clock = Instant::now();
        sheets.extend(part(&scale, device)?);
        timing.note(name, clock.elapsed());
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok((sheets, timing))
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let (device, machine) = (Device::best(args.quick), Machine::here());
    let (sheets, mut timing) = made(args.quick, &device)?;
    let quick = if args.quick { Ok(()) } else { quick_too(&mut timing) };
    let object = object(&machine, &device, &timing, &sheets);
    if args.json {
        print(&object.to_string())?;
    } else {
        let texts: Vec<String> = sheets.iter().map(Sheet::text).collect();
        let head = format!("{}\n{}\n{}", machine.line(), device.about(), timing.text());
        print(&format!("{head}\n\n{}", texts.join("\n")))?;
    }
    if args.quick {
        return Ok(());
    }
    save(&Path::new(DOCUMENTS).join("papers.md"), &document(&machine, &device, &timing, &sheets))?;
    for chart in sheets.iter().flat_map(|sheet| &sheet.charts) {
        chart.write(&Path::new(DOCUMENTS).join(format!("{}.svg", chart.name)))?;
    }
    keep(&format!("papers-{}", slug(&machine.cpu)), &object, args.json)?;
    quick
}

/// Makes all with `--quick`, too. Its error is told with the results that are there, not instead of them.
fn quick_too(timing: &mut Timing) -> Result<(), Failure> {
    let quick = made(true, &Device::best(true)).map(|(_, quick)| quick.seconds());
    timing.note_quick(quick.as_ref().copied().map_err(Failure::to_string));
    quick.map(|_| ())
}

fn object(machine: &Machine, device: &Device, timing: &Timing, sheets: &[Sheet]) -> Value {
    json!({
        "suite": "papers",
        "day": machine.day,
        "machine": machine.object(),
        "adapter": device.adapter(),
        "software": device.is_software(),
        "seconds": timing.seconds(),
        "seconds_wanted": timing.most_seconds(),
        "met": timing.is_met(),
        "seconds_quick": timing.seconds_quick(),
        "parts": timing.object(),
        "tables": sheets.iter().map(Sheet::object).collect::<Vec<_>>(),
    })
}

fn document(machine: &Machine, device: &Device, timing: &Timing, sheets: &[Sheet]) -> String {
    let sheets: Vec<String> = sheets.iter().map(Sheet::markdown).collect();
    format!(
        "# `pbig bench papers`\n\nWritten by that command, nothing by hand. {}. {}\n\n{}\n\n*PBIG*: Lo, Lee, Chung, \
         Chung, \"Optimizing Pairwise Box Intersection Checking on GPUs for Large-Scale Simulations\", ACM TOMACS \
         23(3), 2013; times on a Tesla C2070. *Avril*: Avril, Gouranton, Arnaldi, \"Fast Collision Culling in \
         Large-Scale Environments Using GPU Mapping Function\", EGPGV 2012; times on a Quadro FX 3600M. \"Printed\" \
         is what they print; their figures are drawings, so of those only what the text says. Printed times are of \
         other machines: compare how they grow, not how long they are. What differs is said above each table.\n\n{}",
        machine.line(),
        device.about(),
        timing.text(),
        sheets.join("\n")
    )
}

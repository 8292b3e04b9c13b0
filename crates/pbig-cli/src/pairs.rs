//! `pbig pairs`: all overlapping pairs of the boxes in a file.

use crate::options::{
    THREADS, check_output, plan_text, print_summary, search_text, stages, whole, with_threads,
};
use pbig_core::{Aabb, Finder};
use pbig_harness::files::{BOXES_OR_PAIRS, BoxList, Location, read_boxes, write_pairs};
use pbig_harness::options::BackendOption;
use pbig_harness::prelude::*;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Boxes: .npy (N,6) float32 or float64, or .csv, columns min_x,min_y,min_z,max_x,max_y,max_z.
    input: PathBuf,
    /// File for the pairs: .npy (K,2) uint32 or .csv; `-` is stdout, as .csv.
    #[arg(short, value_name = "OUT")]
    output: Option<PathBuf>,
    /// The backend that searches.
    #[arg(long, value_enum, default_value_t)]
    backend: BackendOption,
    /// Threads; all by default.
    #[arg(long, value_name = "N", value_parser = whole::<usize>(THREADS), allow_negative_numbers = true)]
    threads: Option<usize>,
    /// Number of searches, for the times.
    #[arg(long, value_name = "K", default_value = "1", value_parser = whole::<usize>(1..=u64::MAX), allow_negative_numbers = true)]
    repeat: usize,
    /// An invalid box (NaN, or min > max) is an error.
    #[arg(long)]
    strict: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    check_output(args.output.as_deref(), &BOXES_OR_PAIRS, &args.input, args.json)?;
    let list = read_boxes(&args.input)?;
    if args.strict {
        refuse_invalid(&args.input, &list)?;
    }
    let mut finder = args.backend.finder();
    let times = with_threads(args.threads, || find(&mut finder, &list.boxes, args))?;
    if let Some(output) = &args.output {
        write_pairs(output, finder.pairs())?;
    }
    report(args, &finder, &list, Spread::of(times))
}

fn refuse_invalid(path: &Path, list: &BoxList) -> Result<(), Failure> {
    let Some((index, place)) = list.first_invalid else { return Ok(()) };
    let line = if let Location::Line(_) = place { format!("{place}: ") } else { String::new() };
    let what = "has a NaN or a minimum above its maximum; mend it, or leave out --strict";
    Err(Failure::Input(format!("{}: {line}box {index} (counted from 0) {what}", path.display())))
}

fn find(finder: &mut Finder, boxes: &[Aabb], args: &Args) -> Result<Vec<f64>, Failure> {
    let about = |error| format!("{}: {}", args.input.display(), search_text(&error));
    let once = |_| {
        let (found, ms) = timed(|| finder.find(boxes).map(|_| ()));
        Ok(found.map(|()| ms).map_err(about)?)
    };
    progress(args.repeat, "finding pairs").wrap_iter(0..args.repeat).map(once).collect()
}

fn report(args: &Args, finder: &Finder, list: &BoxList, ms: Spread) -> Result<(), Failure> {
    let report = finder.report();
    let (boxes, pairs, invalid) = (report.boxes, report.pairs, report.invalid);
    if args.json {
        let object = serde_json::json!({
            "boxes": boxes,
            "pairs": pairs,
            "invalid": invalid,
            "backend": args.backend.in_use(report.fallback.as_deref()),
            "adapter": report.device.as_ref().map(|device| &device.name),
            "plan": plan_text(report),
            "ms": ms,
            "stages": stages(report),
        });
        return print(&object.to_string());
    }
    let plan = plan_text(report);
    let first = list.first_invalid.map_or(String::new(), |(_, place)| format!(", the first in {place}"));
    let summary =
        format!("{boxes} boxes ({invalid} invalid{first}), {pairs} overlapping pairs\n{ms}\n{plan}");
    print_summary(args.output.as_deref(), "pairs", &summary)
}

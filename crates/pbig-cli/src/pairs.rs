//! `pbig pairs`: all overlapping pairs of the boxes in a file, or of a box of each of two files.

use crate::backend::{BackendArgs, adapter_line, is_software};
use crate::mesh::{self, Kinds, kinds};
use crate::options::{
    THREADS, check_inputs, check_output, plan_text, print_summary, search_text, stages, thickness, whole,
    with_threads,
};
use pbig_core::{Error, Finder, Report};
use pbig_harness::files::{
    BOXES_OR_PAIRS, BoxList, Location, ending, grown, name, read_boxes, write_id_pairs, write_pairs,
};
use pbig_harness::mesh::MESHES;
use pbig_harness::prelude::*;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Boxes: .npy (N,6) float32 or float64, or .csv, columns min_x,min_y,min_z,max_x,max_y,max_z; `-` is stdin.
    #[arg(required_unless_present = "mesh")]
    input: Option<PathBuf>,
    /// More boxes: only pairs of a box `a` of INPUT with a box `b` of OTHER.
    #[arg(long, value_name = "OTHER")]
    with: Option<PathBuf>,
    /// A mesh in place of boxes, .ply or .obj, `-` for stdin: pairs of its elements that share no vertex.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["input", "with"], requires = "elements")]
    mesh: Option<PathBuf>,
    /// The mesh a step later: boxes hold each element on its way there.
    // Without the conflict `requires` has no effect beside INPUT, which a mesh cannot have.
    #[arg(long, value_name = "FRAME", requires = "mesh", conflicts_with = "input")]
    pub(crate) next: Option<PathBuf>,
    /// Pairs of elements: ee, vf or any two of v (vertex), e (edge) and f (face), with commas.
    #[arg(long, value_name = "KINDS", value_parser = kinds, value_delimiter = ',', requires = "mesh", conflicts_with = "input")]
    pub(crate) elements: Vec<Kinds>,
    /// File for the vertices of each edge: .npy (E,2) uint32 or .csv; row `i` has those of the edge `i`.
    #[arg(long, value_name = "TABLE", requires = "mesh", conflicts_with = "input")]
    pub(crate) edges: Option<PathBuf>,
    /// Distance by which every box grows on all sides, rounded outward: half a thickness.
    #[arg(long, value_name = "M", default_value = "0", value_parser = thickness, allow_negative_numbers = true)]
    pub(crate) margin: f64,
    /// File for the pairs: .npy (K,2) uint32 or .csv; `-` is stdout, as .csv. Of several KINDS a .npy gets one each: OUT-ee.npy.
    #[arg(short, value_name = "OUT")]
    pub(crate) output: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) backend: BackendArgs,
    /// Threads; all by default.
    #[arg(long, value_name = "N", value_parser = whole::<usize>(THREADS), allow_negative_numbers = true)]
    pub(crate) threads: Option<usize>,
    /// Number of searches, for the times.
    #[arg(long, value_name = "K", default_value = "1", value_parser = whole::<usize>(1..=u64::MAX), allow_negative_numbers = true)]
    pub(crate) repeat: usize,
    /// An invalid box (NaN, or min > max), or vertex of a mesh (NaN), is an error.
    #[arg(long)]
    pub(crate) strict: bool,
    /// Print one JSON object.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Boxes and the file that they come from.
type Named<'a> = (&'a Path, BoxList);

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    match (&args.mesh, &args.input) {
        (Some(mesh), _) => mesh::run(args, mesh),
        (None, Some(input)) => search(args, input),
        (None, None) => Err(Failure::Input("INPUT or --mesh is missing".into())),
    }
}

fn search(args: &Args, input: &Path) -> Result<(), Failure> {
    let lists = read(args, input)?;
    let mut finder = if args.with.is_none() { args.backend.finder() } else { args.backend.finder_on_cpu() }?;
    let times = with_threads(args.threads, || find(&mut finder, &lists, args))?;
    args.backend.check_use(adapter(finder.report()), finder.report().fallback.as_deref())?;
    match &args.output {
        Some(output) if args.with.is_some() => {
            write_id_pairs(output, finder.pairs_between().iter().map(|pair| [pair.a, pair.b]))?;
        }
        Some(output) => write_pairs(output, finder.pairs())?,
        None => {}
    }
    report(args, &finder, &lists, Spread::of(times))
}

/// Reads the boxes of one file or two.
fn read<'a>(args: &'a Args, input: &'a Path) -> Result<Vec<Named<'a>>, Failure> {
    let paths: Vec<&Path> = [Some(input), args.with.as_deref()].into_iter().flatten().collect();
    for path in &paths {
        refuse_mesh(path)?;
        check_output("-o", args.output.as_deref(), &BOXES_OR_PAIRS, path, args.json)?;
    }
    check_inputs(&paths)?;
    let mut lists: Vec<Named<'_>> =
        paths.into_iter().map(|path| Ok((path, read_boxes(path)?))).collect::<Result<_, String>>()?;
    if args.strict {
        lists.iter().try_for_each(|(path, list)| refuse_invalid(path, list))?;
    }
    let boxes = lists.iter_mut().flat_map(|(_, list)| &mut list.boxes);
    boxes.for_each(|aabb| *aabb = grown(aabb, args.margin));
    Ok(lists)
}

/// Refuses a mesh with the options that read it.
fn refuse_mesh(path: &Path) -> Result<(), Failure> {
    if ending(path, &MESHES).is_err() {
        return Ok(());
    }
    let path = path.display();
    Err(Failure::Input(format!("{path}: this is a mesh; use --mesh {path} --elements ee, or vf")))
}

fn refuse_invalid(path: &Path, list: &BoxList) -> Result<(), Failure> {
    let Some((index, place)) = list.first_invalid else { return Ok(()) };
    let line = if let Location::Line(_) = place { format!("{place}: ") } else { String::new() };
    let what = "has a NaN or a minimum above its maximum; mend it, or leave out --strict";
    Err(Failure::Input(format!("{}: {line}box {index} (counted from 0) {what}", name(path))))
}

fn find(finder: &mut Finder, lists: &[Named<'_>], args: &Args) -> Result<Vec<f64>, Failure> {
    let names: Vec<String> = lists.iter().map(|(path, _)| name(path).to_string()).collect();
    repeated(args, &names.join(" with "), || match lists {
        [(_, a), (_, b)] => finder.find_between(&a.boxes, &b.boxes).map(|_| ()),
        [(_, all), ..] => finder.find(&all.boxes).map(|_| ()),
        [] => Ok(()),
    })
}

/// Repeats a search, and returns the milliseconds of each. An error begins with the subject.
pub(crate) fn repeated(
    args: &Args,
    subject: &str,
    mut search: impl FnMut() -> Result<(), Error>,
) -> Result<Vec<f64>, Failure> {
    let once = |_| {
        let (found, ms) = timed(&mut search);
        found.map_err(|error| format!("{subject}: {}", search_text(&error)))?;
        Ok(ms)
    };
    progress(args.repeat, "finding pairs").wrap_iter(0..args.repeat).map(once).collect()
}

fn report(args: &Args, finder: &Finder, lists: &[Named<'_>], ms: Spread) -> Result<(), Failure> {
    let report = finder.report();
    let (boxes, pairs, invalid) = (report.boxes, report.pairs, report.invalid);
    if args.json {
        let object = serde_json::json!({
            "boxes": boxes,
            "pairs": pairs,
            "invalid": invalid,
            "backend": args.backend.in_use(report.fallback.as_deref()),
            "adapter": adapter(report),
            "is_software": adapter(report).map(is_software),
            "fallback": report.fallback,
            "plan": plan_text(report),
            "margin": args.margin,
            "ms": ms,
            "stages": stages(report),
        });
        return print(&object.to_string());
    }
    let plan = plan_text(report);
    let mut first = lists.iter().filter_map(|(path, list)| Some((path, list.first_invalid?.1)));
    let first = first.next().map_or(String::new(), |(path, place)| first_text(lists.len(), path, &place));
    let adapter = adapter_line(adapter(report));
    let summary =
        format!("{boxes} boxes ({invalid} invalid{first}), {pairs} overlapping pairs\n{ms}\n{plan}{adapter}");
    print_summary(&[args.output.as_deref()], &summary)
}

/// Returns the name of the adapter that did the work, if one did.
pub(crate) fn adapter(report: &Report) -> Option<&str> {
    report.device.as_ref().map(|device| device.name.as_str())
}

/// Says where the first invalid box is; of two files, in which.
fn first_text(files: usize, path: &Path, place: &Location) -> String {
    let file = if files > 1 { format!(" of {}", name(path)) } else { String::new() };
    format!(", the first in {place}{file}")
}

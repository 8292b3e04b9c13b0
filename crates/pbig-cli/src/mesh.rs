//! `pbig pairs --mesh`: candidate pairs of the vertices, edges and faces of a mesh, without those that share a vertex.

use crate::options::{check_output, plan_text, print_summary, with_threads};
use crate::pairs::{Args, repeated};
use pbig_core::{Finder, Report};
use pbig_harness::files::{BOXES_OR_PAIRS, Location, counted, ending, is_stdout, write_csv, write_id_pairs};
use pbig_harness::mesh::{Elements, Mesh, MeshElements};
use pbig_harness::output::warn;
use pbig_harness::prelude::*;
use std::path::Path;

/// Two kinds of elements: `v` for vertices, `e` for edges or `f` for faces, twice.
#[derive(Clone, Debug)]
pub(crate) struct Kinds(String);

/// Reads two kinds of elements.
pub(crate) fn kinds(text: &str) -> Result<Kinds, String> {
    let is_kind = text.len() == 2 && text.chars().all(|kind| "vef".contains(kind));
    let kinds = is_kind.then(|| Kinds(text.into()));
    kinds.ok_or_else(|| "must be two of v (vertex), e (edge) and f (face), such as ee or vf".into())
}

impl Kinds {
    /// Returns the elements of both kinds; one list if the kinds are the same.
    fn of<'a>(&self, elements: &'a MeshElements) -> (&'a Elements, Option<&'a Elements>) {
        let [a, b] = self.both();
        (elements.of(a), (a != b).then(|| elements.of(b)))
    }

    fn both(&self) -> [char; 2] {
        let mut kinds = self.0.chars();
        [kinds.next(), kinds.next()].map(|kind| kind.expect("two, as parsed"))
    }
}

/// The pairs of two kinds of elements.
struct Found {
    kinds: Kinds,
    pairs: Vec<[u32; 2]>,
    ms: Spread,
    report: Report,
}

/// A mesh and the file that it comes from.
type Frame<'a> = (&'a Path, Mesh);

pub(crate) fn run(args: &Args, path: &Path) -> Result<(), Failure> {
    check_outputs(args, path)?;
    let frames = [Some(path), args.next.as_deref()].into_iter().flatten();
    let frames: Vec<Frame<'_>> =
        frames.map(|path| Ok((path, Mesh::read(path)?))).collect::<Result<_, String>>()?;
    if args.strict {
        frames.iter().try_for_each(refuse_invalid)?;
    }
    let elements = elements(&frames)?;
    warn_of_none(args, path, &elements);
    let find_all = || args.elements.iter().map(|kinds| find(args, path, kinds, &elements)).collect();
    let all: Vec<Found> = with_threads(args.threads, find_all)?;
    if let Some(output) = &args.output {
        write(output, &all)?;
    }
    report(args, &frames, &elements, &all)
}

/// Returns the elements of one frame, or of two.
fn elements(frames: &[Frame<'_>]) -> Result<MeshElements, Failure> {
    let elements = frames[0].1.elements(frames.get(1).map(|(_, mesh)| mesh));
    let next = frames[frames.len() - 1].0.display();
    elements.map_err(|what| Failure::Input(format!("{next}: {what}")))
}

/// Warns of kinds that the mesh has none of: a search that cannot find a pair is seldom wanted.
fn warn_of_none(args: &Args, path: &Path, elements: &MeshElements) {
    for Kinds(kinds) in &args.elements {
        for (kind, name) in [('v', "vertices"), ('e', "edges"), ('f', "faces")] {
            if kinds.contains(kind) && elements.of(kind).boxes.is_empty() {
                warn(&format!("{}: the mesh has no {name}, and {kinds} no pairs", path.display()));
            }
        }
    }
}

/// Refuses a vertex that is not a number in a frame.
fn refuse_invalid((path, mesh): &Frame<'_>) -> Result<(), Failure> {
    let Some((vertex, place)) = mesh.first_invalid else { return Ok(()) };
    let line = if let Location::Line(_) = place { format!("{place}: ") } else { String::new() };
    let (first, what) = (mesh.first_number, "has a NaN; mend it, or leave out --strict");
    let vertex = vertex + first;
    Err(Failure::Input(format!("{}: {line}vertex {vertex} (counted from {first}) {what}", path.display())))
}

/// Returns what the files have that a reader may not expect, a line each.
fn notes(frames: &[Frame<'_>]) -> Vec<String> {
    let of_file = |(path, mesh): &Frame<'_>| {
        let line = |note| format!("{}: {note}", path.display());
        mesh.notes().into_iter().map(line).collect::<Vec<_>>()
    };
    frames.iter().flat_map(of_file).collect()
}

/// Checks the output before the work: `.npy` has no column for kinds.
fn check_outputs(args: &Args, path: &Path) -> Result<(), Failure> {
    for input in [Some(path), args.next.as_deref()].into_iter().flatten() {
        check_output(args.output.as_deref(), &BOXES_OR_PAIRS, input, args.json)?;
    }
    match &args.output {
        Some(output)
            if has_kinds(&args.elements)
                && !is_stdout(output)
                && ending(output, &BOXES_OR_PAIRS)? == "npy" =>
        {
            let what = "a .npy holds pairs of one entry of --elements; use .csv";
            Err(Failure::Input(format!("{}: {what}", output.display())))
        }
        _ => Ok(()),
    }
}

/// Returns true if the output needs a column for the kinds of elements.
fn has_kinds<T>(all: &[T]) -> bool {
    all.len() > 1
}

fn find(args: &Args, path: &Path, kinds: &Kinds, elements: &MeshElements) -> Result<Found, Failure> {
    let mut finder = args.backend.finder();
    let subject = format!("{}: {}", path.display(), kinds.0);
    let times = repeated(args, &subject, || search(&mut finder, kinds.of(elements)))?;
    let pairs = finder.pairs().iter().map(|pair| [pair.a, pair.b]);
    let between = finder.pairs_between().iter().map(|pair| [pair.a, pair.b]);
    let pairs = pairs.chain(between).collect();
    Ok(Found { kinds: kinds.clone(), pairs, ms: Spread::of(times), report: finder.report().clone() })
}

fn search(finder: &mut Finder, (a, b): (&Elements, Option<&Elements>)) -> Result<(), pbig_core::Error> {
    match b {
        Some(b) => finder.find_between(a.apart(), b.apart()).map(|_| ()),
        None => finder.find_without_shared(&a.boxes, &a.keys).map(|_| ()),
    }
}

fn write(output: &Path, all: &[Found]) -> Result<(), String> {
    let [one] = all else {
        let lines = all
            .iter()
            .flat_map(|found| found.pairs.iter().map(|[a, b]| format!("{},{a},{b}", found.kinds.0)));
        return write_csv(output, "elements,a,b", lines);
    };
    write_id_pairs(output, one.pairs.iter().copied())
}

fn report(args: &Args, frames: &[Frame<'_>], elements: &MeshElements, all: &[Found]) -> Result<(), Failure> {
    let (rods, notes) = (frames[0].1.rods.len(), notes(frames));
    let counts = [&elements.vertices, &elements.edges, &elements.faces].map(|all| all.boxes.len());
    let [vertices, edges, faces] = counts;
    if args.json {
        let object = |found: &Found| {
            serde_json::json!({
                "elements": found.kinds.0,
                "boxes": found.report.boxes,
                "pairs": found.report.pairs,
                "invalid": found.report.invalid,
                "backend": args.backend.in_use(found.report.fallback.as_deref()),
                "plan": plan_text(&found.report),
                "ms": found.ms,
            })
        };
        let searches: Vec<_> = all.iter().map(object).collect();
        let object = serde_json::json!({
            "vertices": vertices,
            "edges": edges,
            "rods": rods,
            "faces": faces,
            "notes": notes,
            "searches": searches,
        });
        return print(&object.to_string());
    }
    let line = |found: &Found| {
        let (kinds, pairs, ms) = (&found.kinds.0, found.report.pairs, &found.ms);
        let (invalid, plan) = (invalid_text(found, elements), plan_text(&found.report));
        let pairs = counted(pairs as usize, "candidate pair", "candidate pairs");
        format!("\n{kinds}: {pairs} without a common vertex ({invalid})\n{ms}\n{plan}")
    };
    let lines: String = all.iter().map(line).collect();
    let notes: String = notes.iter().map(|note| format!("\n{note}")).collect();
    let vertices = counted(vertices, "vertex", "vertices");
    let (edges, rods) = (counted(edges, "edge", "edges"), counted(rods, "rod", "rods"));
    let faces = counted(faces, "face", "faces");
    let summary = format!("{vertices}, {edges} ({rods}), {faces}{notes}{lines}");
    print_summary(args.output.as_deref(), &summary)
}

/// Number of invalid elements that a summary names.
const MOST_NAMED: usize = 3;

/// Says how many elements are invalid, and names the first.
fn invalid_text(found: &Found, elements: &MeshElements) -> String {
    let names = invalid_names(found, elements);
    let invalid = counted(found.report.invalid as usize, "element", "elements");
    if names.is_empty() {
        format!("{invalid} invalid")
    } else {
        format!("{invalid} invalid: {}", names.join(", "))
    }
}

/// Returns the first invalid elements, such as `f 0`, with `...` if there are more.
fn invalid_names(found: &Found, elements: &MeshElements) -> Vec<String> {
    let [a, b] = found.kinds.both();
    let mut kinds = vec![a, b];
    kinds.dedup();
    let of_kind = |kind: char| {
        let boxes = elements.of(kind).boxes.iter().enumerate();
        boxes.filter(|(_, aabb)| !aabb.is_valid()).map(move |(element, _)| format!("{kind} {element}"))
    };
    let mut names: Vec<String> = kinds.into_iter().flat_map(of_kind).take(MOST_NAMED + 1).collect();
    if let Some(last) = names.get_mut(MOST_NAMED) {
        *last = "...".into();
    }
    names
}

//! `pbig pairs --mesh`: candidate pairs of the vertices, edges and faces of a mesh, without those that share a vertex.

use crate::options::{check_inputs, check_output, plan_text, print_summary, with_threads};
use crate::pairs::{Args, adapter, repeated};
use pbig_core::{Finder, Report};
use pbig_harness::files::{BOXES_OR_PAIRS, Location, counted, ending, name, write_csv, write_id_pairs};
use pbig_harness::mesh::{Elements, Mesh, MeshElements, NO_ELEMENTS};
use pbig_harness::output::warn;
use pbig_harness::prelude::*;
use std::path::{Path, PathBuf};

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
    let paths: Vec<&Path> = [Some(path), args.next.as_deref()].into_iter().flatten().collect();
    let outputs = check_files(args, &paths)?;
    let frames = paths.into_iter().map(|path| Ok((path, Mesh::read(path)?)));
    let frames: Vec<Frame<'_>> = frames.collect::<Result<_, String>>()?;
    if args.strict {
        frames.iter().try_for_each(refuse_invalid)?;
    }
    let mut elements = elements(&frames)?;
    elements.grow(args.margin);
    warn_of_none(args, path, &elements);
    let find_all = || args.elements.iter().map(|kinds| find(args, path, kinds, &elements)).collect();
    let all: Vec<Found> = with_threads(args.threads, find_all)?;
    for Found { report, .. } in &all {
        args.backend.check_use(adapter(report), report.fallback.as_deref())?;
    }
    write(&outputs, &all)?;
    if let Some(table) = &args.edges {
        write_id_pairs(table, elements.edges.keys.iter().map(|[a, b, ..]| [*b, *a]))?;
    }
    report(args, &frames, &elements, &all)
}

/// Returns the elements of one frame, or of two.
fn elements(frames: &[Frame<'_>]) -> Result<MeshElements, Failure> {
    let elements = frames[0].1.elements(frames.get(1).map(|(_, mesh)| mesh));
    let next = name(frames[frames.len() - 1].0);
    elements.map_err(|what| Failure::Input(format!("{next}: {what}")))
}

/// Warns of kinds that the mesh has none of: a search that cannot find a pair is seldom wanted.
fn warn_of_none(args: &Args, path: &Path, elements: &MeshElements) {
    for Kinds(kinds) in &args.elements {
        for (kind, noun) in [('v', "vertices"), ('e', "edges"), ('f', "faces")] {
            if kinds.contains(kind) && elements.of(kind).boxes.is_empty() {
                warn(&format!("{}: the mesh has no {noun}, and {kinds} no pairs", name(path)));
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
    Err(Failure::Input(format!("{}: {line}vertex {vertex} (counted from {first}) {what}", name(path))))
}

/// Returns what the files have that a reader may not expect, a line each.
fn notes(frames: &[Frame<'_>]) -> Vec<String> {
    let of_file = |(i, (path, mesh)): (usize, &Frame<'_>)| {
        // A later frame may be vertices alone.
        let notes = mesh.notes().into_iter().filter(move |note| i == 0 || note != NO_ELEMENTS);
        notes.map(|note| format!("{}: {note}", name(path))).collect::<Vec<_>>()
    };
    frames.iter().enumerate().flat_map(of_file).collect()
}

/// Checks inputs and outputs before the work, and returns the files for pairs: one, or one for each kind if a `.npy` is wanted,
/// which has no column for kinds.
fn check_files(args: &Args, inputs: &[&Path]) -> Result<Vec<PathBuf>, Failure> {
    check_inputs(inputs)?;
    let outputs = match &args.output {
        Some(output) if args.elements.len() > 1 && ending(output, &["npy"]).is_ok() => {
            args.elements.iter().map(|kinds| for_kinds(output, kinds)).collect()
        }
        output => Vec::from_iter(output.clone()),
    };
    let of_pairs = outputs.iter().map(|output| ("-o", output));
    for (option, output) in of_pairs.chain(args.edges.iter().map(|table| ("--edges", table))) {
        let check = |input: &&Path| check_output(option, Some(output), &BOXES_OR_PAIRS, input, args.json);
        inputs.iter().try_for_each(check)?;
    }
    match &args.edges {
        Some(table) if outputs.contains(table) => {
            Err(Failure::Input(format!("{}: -o and --edges name one file; name another", table.display())))
        }
        _ => Ok(outputs),
    }
}

/// Returns the file for pairs of these kinds: `out-ee.npy` beside `out.npy`.
fn for_kinds(output: &Path, Kinds(kinds): &Kinds) -> PathBuf {
    let mut name = output.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{kinds}."));
    name.push(output.extension().unwrap_or_default());
    output.with_file_name(name)
}

fn find(args: &Args, path: &Path, kinds: &Kinds, elements: &MeshElements) -> Result<Found, Failure> {
    let mut finder = args.backend.finder_on_cpu()?;
    let subject = format!("{}: {}", name(path), kinds.0);
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

/// Writes the pairs into a file for each kind, or all into one text.
fn write(outputs: &[PathBuf], all: &[Found]) -> Result<(), String> {
    if let ([output], true) = (outputs, all.len() > 1) {
        let line = |kinds: &Kinds, [a, b]: &[u32; 2]| format!("{},{a},{b}", kinds.0);
        let lines = all.iter().flat_map(|found| found.pairs.iter().map(move |pair| line(&found.kinds, pair)));
        return write_csv(output, "elements,a,b", lines);
    }
    outputs
        .iter()
        .zip(all)
        .try_for_each(|(output, found)| write_id_pairs(output, found.pairs.iter().copied()))
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
                "fallback": found.report.fallback,
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
            "margin": args.margin,
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
    print_summary(&[args.output.as_deref(), args.edges.as_deref()], &summary)
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

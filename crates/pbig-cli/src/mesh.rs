//! `pbig pairs --mesh`: candidate pairs of the vertices, edges and faces of a mesh, without those that share a vertex.

use crate::options::{check_output, plan_text, print_summary, with_threads};
use crate::pairs::{Args, repeated};
use pbig_core::{Finder, Report};
use pbig_harness::files::{BOXES_OR_PAIRS, ending, is_stdout, write_csv, write_id_pairs};
use pbig_harness::mesh::{Elements, Mesh, MeshElements};
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
        let of_kind = |kind: &str| match kind {
            "v" => &elements.vertices,
            "e" => &elements.edges,
            _ => &elements.faces,
        };
        let (a, b) = self.0.split_at(1);
        (of_kind(a), (a != b).then(|| of_kind(b)))
    }
}

/// The pairs of two kinds of elements.
struct Found {
    kinds: Kinds,
    pairs: Vec<[u32; 2]>,
    ms: Spread,
    report: Report,
}

pub(crate) fn run(args: &Args, path: &Path) -> Result<(), Failure> {
    check_outputs(args, path)?;
    let mesh = Mesh::read(path)?;
    let next = args.next.as_deref().map(|next| Mesh::read(next).map(|mesh| (next, mesh))).transpose()?;
    let elements = mesh.elements(next.as_ref().map(|(_, mesh)| mesh));
    let named = next.as_ref().map_or(path, |(path, _)| path);
    let elements = elements.map_err(|what| format!("{}: {what}", named.display()))?;
    if args.strict {
        refuse_invalid(path, &elements)?;
    }
    let find_all = || args.elements.iter().map(|kinds| find(args, path, kinds, &elements)).collect();
    let all: Vec<Found> = with_threads(args.threads, find_all)?;
    if let Some(output) = &args.output {
        write(output, &all)?;
    }
    report(args, &elements, &all)
}

/// Refuses a vertex that is not finite in a frame.
fn refuse_invalid(path: &Path, elements: &MeshElements) -> Result<(), Failure> {
    let Some(vertex) = elements.vertices.boxes.iter().position(|aabb| !aabb.is_valid()) else {
        return Ok(());
    };
    let what = "has a NaN; mend it, or leave out --strict";
    Err(Failure::Input(format!("{}: vertex {vertex} (counted from 0) {what}", path.display())))
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

fn report(args: &Args, elements: &MeshElements, all: &[Found]) -> Result<(), Failure> {
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
        let counts =
            serde_json::json!({"vertices": vertices, "edges": edges, "faces": faces, "searches": searches});
        return print(&counts.to_string());
    }
    let line = |found: &Found| {
        let (kinds, Report { pairs, invalid, .. }, ms) = (&found.kinds.0, &found.report, &found.ms);
        format!(
            "\n{kinds}: {pairs} candidate pairs without a common vertex ({invalid} elements invalid)\n{ms}\n{}",
            plan_text(&found.report)
        )
    };
    let lines: String = all.iter().map(line).collect();
    let summary = format!("{vertices} vertices, {edges} edges, {faces} faces{lines}");
    print_summary(args.output.as_deref(), &summary)
}

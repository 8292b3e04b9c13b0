//! `pbig pairs --margin` and `--edges`: boxes and meshes with a thickness, and the numbers of edges.

use super::{array, degenerate, json, pbig, read_pairs, refused, save};
use ndarray::Array2;
use pbig_core::{Aabb, CrossPair, Pair, oracle};
use pbig_harness::files::grown;
use std::path::Path;

fn all_grown(boxes: &[Aabb], margin: f64) -> Vec<Aabb> {
    boxes.iter().map(|aabb| grown(aabb, margin)).collect()
}

#[test]
fn pairs_with_a_margin_are_those_of_grown_boxes() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    let (a, b) = (degenerate(400, 7), degenerate(200, 8));
    save(here, "a.npy", &array(&a));
    save(here, "b.npy", &array(&b));
    let mut counts = vec![];
    for margin in ["0", "0.3"] {
        let m = margin.parse().expect("a number");
        let args = ["pairs", "a.npy", "--margin", margin, "-o", "out.npy", "--json"];
        let object = json(&pbig(here, &args));
        let found = read_pairs(&here.join("out.npy"));
        assert_eq!(found, oracle::pairs(&all_grown(&a, m)), "{margin}");
        let invalid = a.iter().filter(|aabb| !aabb.is_valid()).count();
        assert_eq!((&object["margin"], &object["invalid"]), (&m.into(), &invalid.into()));
        counts.push(found.len());
        json(&pbig(here, &[&args[..], &["--with", "b.npy"]].concat()));
        let wanted = oracle::pairs_between(&all_grown(&a, m), &all_grown(&b, m));
        let cross = |pair: &Pair| CrossPair { a: pair.a, b: pair.b };
        assert_eq!(
            read_pairs(&here.join("out.npy")).iter().map(cross).collect::<Vec<_>>(),
            wanted,
            "{margin}"
        );
    }
    assert!(counts[0] < counts[1], "{counts:?}");
    refused(&pbig(here, &["pairs", "a.npy", "--margin", "-1"]), &["--margin -1: must be at least 0"]);
}

/// A triangle, and a second one 1 above it.
const TWO: &str = "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 1\nv 2 0 1\nv 0 2 1\nf 1 2 3\nf 4 5 6\n";

fn counts(here: &Path, args: &[&str]) -> Vec<u64> {
    let object = json(&pbig(here, &[&["pairs", "--mesh", "m.obj", "--json"], args].concat()));
    object["searches"].as_array().expect("a list").iter().filter_map(|one| one["pairs"].as_u64()).collect()
}

#[test]
fn a_mesh_has_a_thickness_and_a_file_for_each_kind() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    std::fs::write(here.join("m.obj"), TWO).expect("written");
    assert_eq!(counts(here, &["--elements", "ee,vf,ff", "--margin", "0.49"]), [0, 0, 0]);
    let args = ["--elements", "ee,vf,ff", "--margin", "0.5", "-o", "out.npy", "--edges", "edges.npy"];
    let found = counts(here, &args);
    assert!(found[0] > 0 && found[1] == 6 && found[2] == 1, "{found:?}");
    for (kinds, count) in ["ee", "vf", "ff"].iter().zip(found) {
        assert_eq!(read_pairs(&here.join(format!("out-{kinds}.npy"))).len() as u64, count, "{kinds}");
    }
    assert!(!here.join("out.npy").exists());
    // Each edge's vertices, as `--elements vf` numbers them; by larger, then smaller vertex.
    let edges: Array2<u32> = ndarray_npy::read_npy(here.join("edges.npy")).expect("(E,2) uint32");
    assert_eq!(edges, ndarray::arr2(&[[0, 1], [0, 2], [1, 2], [3, 4], [3, 5], [4, 5]]));
    for pair in read_pairs(&here.join("out-ee.npy")) {
        let [a, b] = [pair.a, pair.b].map(|edge| edges.row(edge as usize).to_vec());
        assert!(a.iter().all(|vertex| !b.contains(vertex)), "{a:?} and {b:?} have a common vertex");
    }
}

#[test]
fn a_table_of_edges_is_refused_where_it_cannot_be_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    std::fs::write(here.join("m.obj"), TWO).expect("written");
    let mesh = |args: &[&str]| pbig(here, &[&["pairs", "--mesh", "m.obj", "--elements"], args].concat());
    refused(&mesh(&["ee", "--edges", "e.txt"]), &["e.txt: expected a file that ends in .npy or .csv"]);
    let same = "-o and --edges name one file; name another";
    refused(&mesh(&["ee,vf", "-o", "e.npy", "--edges", "e-ee.npy"]), &[&format!("e-ee.npy: {same}")]);
    refused(&mesh(&["ee", "-o", "-", "--edges", "-"]), &[&format!("-: {same}")]);
    std::fs::hard_link(here.join("m.obj"), here.join("link.csv")).expect("a link");
    refused(&mesh(&["ee", "--edges", "link.csv"]), &["link.csv: --edges names the input, m.obj"]);
    refused(
        &pbig(here, &["pairs", "a.csv", "--edges", "e.csv"]),
        &["'[INPUT]' cannot be used with '--edges"],
    );
    let output = mesh(&["ee", "--edges", "-"]);
    assert_eq!(String::from_utf8_lossy(&output.stdout), "a,b\n0,1\n0,2\n1,2\n3,4\n3,5\n4,5\n");
    assert!(String::from_utf8_lossy(&output.stderr).starts_with("6 vertices, 6 edges (0 rods), 2 faces\n"));
}

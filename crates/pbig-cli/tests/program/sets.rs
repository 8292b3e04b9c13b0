//! `pbig pairs` of two files, and of a mesh.

use super::{array, degenerate, json, pbig, read_pairs, refused, save};
use ndarray::Array2;
use pbig_core::oracle;
use std::path::Path;

/// Two triangles that share an edge, and two more above them.
const MESH: &str =
    "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 2 2 0\nv 0 0 1\nv 2 0 1\nv 0 2 1\nf 1 2 3\nf 2 4 3\nf 5 6 7\n";

fn write(folder: &Path, name: &str, content: &str) {
    std::fs::write(folder.join(name), content).expect("written");
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).expect("a text")
}

#[test]
fn pairs_of_two_files_are_the_oracles() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    let (a, b) = (degenerate(300, 3), degenerate(200, 4));
    save(here, "a.npy", &array(&a));
    save(here, "b.npy", &array(&b));
    let wanted = oracle::pairs_between(&a, &b);
    let invalid = a.iter().chain(&b).filter(|aabb| !aabb.is_valid()).count();
    for backend in ["auto", "brute", "gpu"] {
        let object = json(&pbig(
            here,
            &["pairs", "a.npy", "--with", "b.npy", "-o", "out.npy", "--backend", backend, "--json"],
        ));
        let found = read_pairs(&here.join("out.npy"));
        assert!(found.iter().map(|pair| (pair.a, pair.b)).eq(wanted.iter().map(|pair| (pair.a, pair.b))));
        let counts = [&object["boxes"], &object["pairs"], &object["invalid"]]
            .map(|count| count.as_u64().expect("a count") as usize);
        assert_eq!(counts, [500, wanted.len(), invalid], "{backend}");
        assert_eq!(object["backend"], if backend == "brute" { "brute" } else { "cpu" });
    }
}

#[test]
fn the_second_file_is_checked_like_the_first() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    write(here, "a.csv", "0,0,0,1,1,1\n");
    write(here, "b.csv", "1,1,1,0,0,0\n");
    let with = |more: &[&str]| pbig(here, &[&["pairs", "a.csv", "--with"], more].concat());
    refused(&with(&["b.csv", "--strict"]), &["pbig: b.csv: line 1: box 0"]);
    refused(&with(&["b.csv", "-o", "b.csv"]), &["b.csv: -o names the input, b.csv"]);
    refused(&with(&["none.csv"]), &["none.csv: "]);
    let summary = String::from_utf8(with(&["b.csv"]).stdout).expect("UTF-8");
    assert!(
        summary.starts_with("2 boxes (1 invalid, the first in line 1 of b.csv), 0 overlapping"),
        "{summary}"
    );
    save(here, "empty.npy", &Array2::<f32>::zeros((0, 6)));
    assert_eq!(json(&with(&["empty.npy", "--json"]))["pairs"], 0);
}

#[test]
fn pairs_of_a_mesh_leave_out_neighbours() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    write(here, "mesh.obj", MESH);
    // In the next frame vertex 6 has fallen through the lower triangles.
    write(here, "next.obj", &MESH.replace("v 0 2 1", "v 0 2 -1"));
    let args = ["pairs", "--mesh", "mesh.obj", "--next", "next.obj", "--elements", "ee,vf,ff"];
    let object = json(&pbig(here, &[&args[..], &["--json", "-o", "out.csv"]].concat()));
    assert_eq!([&object["vertices"], &object["edges"], &object["faces"]], [7, 8, 3]);
    let searches = object["searches"].as_array().expect("a list");
    let pairs: Vec<_> =
        searches.iter().map(|one| (one["elements"].as_str(), one["pairs"].as_u64())).collect();
    let text = read(here, "out.csv");
    assert!(
        text.starts_with("elements,a,b\nee,")
            && text.contains("\nvf,6,0\n")
            && text.ends_with("ff,0,2\nff,1,2\n"),
        "{text}"
    );
    let lines = |kind: &str| Some(text.lines().filter(|line| line.starts_with(kind)).count() as u64);
    assert_eq!(pairs, ["ee", "vf", "ff"].map(|kind| (Some(kind), lines(kind))));
    assert!(searches.iter().all(|one| one.get("fallback").is_some()), "{object}");
    // Without the motion nothing meets.
    let still =
        json(&pbig(here, &["pairs", "--mesh", "mesh.obj", "--elements", "ff", "-o", "ff.npy", "--json"]));
    assert_eq!((&still["searches"][0]["pairs"], read_pairs(&here.join("ff.npy")).len()), (&0.into(), 0));
}

#[test]
fn a_mesh_tells_what_it_lacks_and_which_elements_are_invalid() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    let run = |name: &str, kinds: &str| {
        let output = pbig(here, &["pairs", "--mesh", name, "--elements", kinds]);
        assert!(output.status.success());
        [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("UTF-8"))
    };
    write(here, "point.obj", "v 0 0 0\n");
    let [summary, warnings] = run("point.obj", "vf,vv");
    assert!(
        summary.starts_with("1 vertex, 0 edges (0 rods), 0 faces\npoint.obj: no faces and no rods\n"),
        "{summary}"
    );
    assert_eq!(warnings, "pbig: warning: point.obj: the mesh has no faces, and vf no pairs\n");
    let object = json(&pbig(here, &["pairs", "--mesh", "point.obj", "--elements", "vv", "--json"]));
    assert_eq!(object["notes"], serde_json::json!(["point.obj: no faces and no rods"]));
    write(here, "flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    write(here, "later.obj", "v 0 0 1\nv 1 0 1\nv 0 1 1\n");
    let later = ["pairs", "--mesh", "flat.obj", "--next", "later.obj", "--elements", "ee", "--json"];
    assert_eq!(json(&pbig(here, &later))["notes"], serde_json::json!([]), "vertices are enough");
    let faces = "f 1 2 3\nf 2 3 4\nf 1 2 4\nf 1 3 4\n";
    write(here, "nan.obj", &format!("v 0 0 0\nv nan 0 0\nv 0 nan 0\nv 0 0 1\n{faces}"));
    let [summary, warnings] = run("nan.obj", "vf,vv,ff");
    assert_eq!(warnings, "");
    for line in [
        "\nvf: 0 candidate pairs without a common vertex (6 elements invalid: v 1, v 2, f 0, ...)\n",
        "\nvv: 0 candidate pairs without a common vertex (2 elements invalid: v 1, v 2)\n",
        "\nff: 0 candidate pairs without a common vertex (4 elements invalid: f 0, f 1, f 2, ...)\n",
    ] {
        assert!(summary.contains(line), "{line}: {summary}");
    }
}

#[test]
fn a_wrong_mesh_or_option_is_refused_in_one_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    write(here, "mesh.obj", MESH);
    write(here, "less.obj", "v 0 0 0\n");
    write(here, "wrong.obj", "v 0 0 0\nf 1 2 zero\n");
    let mesh = |name: &str, more: &[&str]| pbig(here, &[&["pairs", "--mesh", name], more].concat());
    refused(
        &mesh("wrong.obj", &["--elements", "ee"]),
        &["pbig: wrong.obj: line 2: 'zero' is not the number of a vertex"],
    );
    refused(
        &mesh("mesh.obj", &["--elements", "ee", "--next", "less.obj"]),
        &["less.obj: not a frame of the same mesh"],
    );
    write(here, "nan.obj", &MESH.replace("v 2 2 0", "v 2 2 nan"));
    refused(
        &mesh("mesh.obj", &["--elements", "ee", "--next", "nan.obj", "--strict"]),
        &["nan.obj: line 4: vertex 4 (counted from 1) has a NaN; mend it, or leave out --strict"],
    );
    refused(
        &pbig(here, &["pairs", "mesh.obj"]),
        &["this is a mesh; use --mesh mesh.obj --elements ee, or vf"],
    );
    write(here, "a.csv", "0,0,0,1,1,1\n");
    refused(
        &pbig(here, &["pairs", "a.csv", "--with", "cloth.OBJ"]),
        &["this is a mesh; use --mesh cloth.OBJ"],
    );
    refused(&mesh("mesh.obj", &["--elements", "xx"]), &["--elements xx: must be two of v (vertex)"]);
    refused(&mesh("mesh.obj", &[]), &["--elements"]);
    refused(
        &mesh("mesh.stl", &["--elements", "ee"]),
        &["mesh.stl: expected a file that ends in .ply or .obj"],
    );
    refused(
        &mesh("mesh.obj", &["--elements", "ee", "-o", "mesh.obj"]),
        &["mesh.obj: expected a file that ends in .npy or .csv"],
    );
    refused(&pbig(here, &["pairs"]), &["INPUT"]);
}

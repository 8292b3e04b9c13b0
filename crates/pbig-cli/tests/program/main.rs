//! The program `pbig` as other programs see it: files, JSON, exit status, one line on stderr.

mod bench;
mod files;
mod gpu;
mod margin;
mod refused;
mod replay;
mod sets;
mod streams;
mod usage;

use ndarray::{Array, Array2, Array3, Dimension, ShapeBuilder};
use ndarray_npy::{WritableElement, read_npy, write_npy};
use pbig_core::{Aabb, Pair, oracle};
use pbig_harness::boxes::BoxSet;
use pbig_harness::scenes::Scene;
use serde_json::Value;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn pbig(folder: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pbig"));
    command.current_dir(folder).args(args).output().expect("the program starts")
}

/// As `pbig`, where a variable has a value.
fn pbig_where(folder: &Path, variable: &str, value: &str, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pbig"));
    // Some drivers complain on stderr when they have no such folder.
    let command = command.env(variable, value).env("XDG_RUNTIME_DIR", folder);
    command.current_dir(folder).args(args).output().expect("the program starts")
}

/// As `pbig`, with these bytes on stdin.
fn pbig_fed(folder: &Path, bytes: &[u8], args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pbig"));
    let command = command.current_dir(folder).args(args);
    let pipes = [Stdio::piped(), Stdio::piped(), Stdio::piped()];
    let [stdin, stdout, stderr] = pipes;
    let mut child = command.stdin(stdin).stdout(stdout).stderr(stderr).spawn().expect("the program starts");
    // It may refuse before it has read all.
    _ = child.stdin.take().expect("a pipe").write_all(bytes);
    child.wait_with_output().expect("the program ends")
}

fn json(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("not one JSON object: {error}: {text}"))
}

/// Checks that the exit status is 2 and that the one line on stderr contains all the words; returns the line.
fn refused(output: &Output, words: &[&str]) -> String {
    let line = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{line}");
    assert_eq!(line.lines().count(), 1, "{line}");
    assert!(output.stdout.is_empty());
    for word in words {
        assert!(line.contains(word), "'{word}' is not in: {line}");
    }
    line.trim_end().into()
}

fn six(b: &Aabb) -> [f32; 6] {
    [b.min[0], b.min[1], b.min[2], b.max[0], b.max[1], b.max[2]]
}

fn array(boxes: &[Aabb]) -> Array2<f32> {
    Array2::from_shape_fn((boxes.len(), 6), |(i, k)| six(&boxes[i])[k])
}

fn save<T: WritableElement, D: Dimension>(folder: &Path, name: &str, array: &Array<T, D>) {
    write_npy(folder.join(name), array).expect("written");
}

fn read_pairs(path: &Path) -> Vec<Pair> {
    let array: Array2<u32> = read_npy(path).expect("(K,2) uint32");
    assert_eq!(array.ncols(), 2);
    array.outer_iter().map(|row| Pair { a: row[0], b: row[1] }).collect()
}

fn degenerate(n: usize, seed: u64) -> Vec<Aabb> {
    BoxSet::named("degenerate").expect("the set exists").boxes(n, seed)
}

#[test]
fn pairs_of_every_input_format_and_backend_are_the_oracles() {
    let folder = tempfile::tempdir().expect("a folder");
    let boxes = degenerate(400, 1);
    let wanted = oracle::pairs(&boxes);
    let rows = array(&boxes);
    save(folder.path(), "f32.npy", &rows);
    save(folder.path(), "f64.npy", &rows.mapv(f64::from));
    let mut fortran = Array2::<f32>::zeros(rows.raw_dim().f());
    fortran.assign(&rows);
    save(folder.path(), "fortran.npy", &fortran);
    let lines: Vec<String> = boxes.iter().map(|b| six(b).map(|x| x.to_string()).join(",")).collect();
    std::fs::write(folder.path().join("plain.csv"), lines.join("\n")).expect("written");
    let header = "min_x,min_y,min_z,max_x,max_y,max_z\n";
    std::fs::write(folder.path().join("header.csv"), format!("{header}{}\n", lines.join("\n")))
        .expect("written");
    for input in ["f32.npy", "f64.npy", "fortran.npy", "plain.csv", "header.csv"] {
        for backend in ["auto", "cpu", "gpu", "brute"] {
            let object = json(&pbig(
                folder.path(),
                &["pairs", input, "-o", "out.npy", "--backend", backend, "--json"],
            ));
            assert_eq!(read_pairs(&folder.path().join("out.npy")), wanted, "{input}, {backend}");
            assert_eq!(object["boxes"], 400, "{input}");
            assert_eq!(object["pairs"], wanted.len());
            assert_eq!(object["invalid"], boxes.iter().filter(|b| !b.is_valid()).count());
        }
    }
}

#[test]
fn pairs_writes_csv_too_and_reports_as_documented() {
    let folder = tempfile::tempdir().expect("a folder");
    let boxes = BoxSet::named("unit").expect("the set exists").boxes(500, 2);
    save(folder.path(), "boxes.npy", &array(&boxes));
    let args =
        ["pairs", "boxes.npy", "-o", "out.csv", "--threads", "1", "--repeat", "3", "--strict", "--json"];
    let object = json(&pbig(folder.path(), &args));
    for key in ["boxes", "pairs", "invalid", "backend", "adapter", "is_software", "fallback", "plan"] {
        assert!(object.get(key).is_some(), "{key} is missing");
    }
    let ms = |key: &str| object["ms"][key].as_f64().expect("a number");
    assert!(ms("min") > 0.0 && ms("min") <= ms("median") && ms("median") <= ms("max"));
    assert!(object["stages"]["check"].is_f64());
    let text = std::fs::read_to_string(folder.path().join("out.csv")).expect("the output");
    let wanted: Vec<String> = oracle::pairs(&boxes).iter().map(|p| format!("{},{}", p.a, p.b)).collect();
    assert_eq!(text, format!("a,b\n{}\n", wanted.join("\n")));
}

#[test]
fn f64_boxes_are_rounded_outward() {
    let folder = tempfile::tempdir().expect("a folder");
    let on_x = |min: f64, max: f64| [min, 0.0, 0.0, max, 1.0, 1.0];
    // In f64 the first two are apart, and rounded to nearest they still are; the third is inverted by
    // less than f32 can tell.
    let rows = [on_x(0.0, 1.0 + 1e-8), on_x(1.0 + 1.1e-7, 2.0), on_x(5.0 + 1e-12, 5.0)].concat();
    save(folder.path(), "boxes.npy", &Array2::from_shape_vec((3, 6), rows).expect("3 x 6"));
    let object = json(&pbig(folder.path(), &["pairs", "boxes.npy", "--json"]));
    assert_eq!((&object["pairs"], &object["invalid"]), (&Value::from(1), &Value::from(1)));
}

#[test]
fn frames_without_boxes_and_boxes_without_frames() {
    let folder = tempfile::tempdir().expect("a folder");
    for (frames, boxes) in [(0, 5), (3, 0), (0, 0)] {
        save(folder.path(), "frames.npy", &Array3::<f32>::zeros((frames, boxes, 6)));
        let object = json(&pbig(folder.path(), &["replay", "frames.npy", "-o", "events.csv", "--json"]));
        assert_eq!((&object["frames"], &object["boxes"]), (&frames.into(), &boxes.into()));
        let text = std::fs::read_to_string(folder.path().join("events.csv")).expect("the events");
        assert_eq!(text, "frame,event,a,b\n");
    }
}

#[test]
fn a_missing_backend_is_replaced_and_the_output_says_so() {
    let folder = tempfile::tempdir().expect("a folder");
    save(folder.path(), "boxes.npy", &Array2::<f32>::zeros((3, 6)));
    save(folder.path(), "frames.npy", &Array3::<f32>::zeros((3, 3, 6)));
    let without_gpu = |args: &[&str]| pbig_where(folder.path(), "WGPU_ADAPTER_NAME", "no such adapter", args);
    // More boxes than a device leaves to one kernel that tests all.
    let scene = ["simulate", "--scene", "pile", "--bodies", "1100", "--steps", "5"];
    for args in [&["pairs", "boxes.npy"][..], &["replay", "frames.npy"], &scene] {
        let gpu = [args, &["--backend", "gpu"]].concat();
        let text = String::from_utf8_lossy(&without_gpu(&gpu).stdout).into_owned();
        assert!(text.contains("no GPU adapter named"), "{args:?}: {text}");
        let gpu = [&gpu[..], &["--json"]].concat();
        let object = json(&without_gpu(&gpu));
        assert_eq!((&object["backend"], &object["adapter"]), (&Value::from("cpu"), &Value::Null), "{args:?}");
        assert!(object.to_string().contains("no GPU adapter named"), "{args:?}: {object}");
        let object = json(&pbig(folder.path(), &gpu));
        assert_eq!(object["backend"], "gpu", "{args:?}: {object}");
        assert!(object["adapter"].as_str().is_some_and(|name| !name.is_empty()), "{args:?}: {object}");
    }
    refused(&without_gpu(&["bench", "gpu", "--quick"]), &["no such adapter"]);
}

#[test]
fn simulate_checks_and_reports() {
    let folder = tempfile::tempdir().expect("a folder");
    let args = ["simulate", "--scene", "column", "--bodies", "100", "--steps", "30", "--json"];
    let object = json(&pbig(folder.path(), &[&args[..], &["--check"]].concat()));
    assert_eq!(
        (&object["scene"], &object["bodies"], &object["steps"]),
        (&"column".into(), &100.into(), &30.into())
    );
    assert_eq!(object["check"]["missing"], 0);
    assert!(object["check"]["oracle_pairs"].as_u64() > Some(0));
    let stock = json(&pbig(folder.path(), &[&args[..], &["--broad-phase", "stock"]].concat()));
    assert_eq!(stock["broad_phase"], "stock");
    assert!(stock["check"].is_null() && stock["ms"]["step"]["median"].as_f64() > Some(0.0));
}

#[test]
fn a_misspelt_api_is_named_and_so_are_those_that_there_are() {
    let folder = tempfile::tempdir().expect("a folder");
    save(folder.path(), "boxes.npy", &Array2::<f32>::zeros((3, 6)));
    let run = |args: &[&str]| pbig_where(folder.path(), "WGPU_BACKEND", "vulcan", args);
    let words = "WGPU_BACKEND=\"vulcan\" names no API (known: vulkan, metal, dx12)";
    let object = json(&run(&["pairs", "boxes.npy", "--backend", "gpu", "--json"]));
    assert!(object["plan"].as_str().is_some_and(|plan| plan.contains(words)), "{object}");
    refused(&run(&["bench", "gpu", "--quick"]), &[words]);
    let doctor = String::from_utf8_lossy(&run(&["doctor"]).stdout).into_owned();
    assert!(doctor.contains(&format!("falls back to the CPU: no GPU adapter: {words}\n")), "{doctor}");
    // One that is known is enough.
    let known = pbig_where(folder.path(), "WGPU_BACKEND", "vulcan,gl,vulkan", &["doctor"]);
    assert!(!String::from_utf8_lossy(&known.stdout).contains("names no API"));
}

#[test]
fn scenes_and_doctor_say_what_there_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let scenes = pbig(folder.path(), &["scenes"]);
    let text = String::from_utf8_lossy(&scenes.stdout).into_owned();
    assert!(scenes.status.success() && text.lines().count() == Scene::ALL.len());
    for (line, scene) in text.lines().zip(Scene::ALL) {
        assert!(line.starts_with(scene.name) && line.contains(&format!("; hard: {}", scene.hard)), "{line}");
    }
    let doctor = pbig(folder.path(), &["doctor"]);
    let text = String::from_utf8_lossy(&doctor.stdout).into_owned();
    assert!(doctor.status.success() && text.contains("self-test") && !text.contains("WRONG"), "{text}");
    assert!(text.contains("\n  gpu 0  "), "a software adapter at least is tested: {text}");
    save(folder.path(), "boxes.npy", &Array2::<f32>::zeros((3, 6)));
    let object = json(&pbig(folder.path(), &["pairs", "boxes.npy", "--backend", "gpu", "--json"]));
    let adapter = object["adapter"].as_str().expect("the same adapter");
    assert!(text.contains(&format!("adapter gpu 0: {adapter}, driver")), "{adapter} is not in: {text}");
}

#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let mut child = Command::new(env!("CARGO_BIN_EXE_pbig"))
        .arg("scenes")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    drop(child.stdout.take());
    let output = child.wait_with_output().expect("the program ends");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

//! `pbig bench`: each suite's shape, and that its figures are finite; never how large they are.

use super::{json, pbig, refused};
use serde_json::Value;

/// Returns the object and the warnings of a quick run, which writes nothing into the folder.
fn quick(suite: &str) -> (Value, String) {
    let folder = tempfile::tempdir().expect("a folder");
    let output = pbig(folder.path(), &["bench", suite, "--quick", "--json"]);
    let object = json(&output);
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0, "nothing is written");
    assert_eq!(object["suite"], suite);
    for key in ["machine", "cores", "threads", "simd", "day", "commit"] {
        assert!(object["head"][key].is_string(), "{key} is missing");
    }
    (object, String::from_utf8(output.stderr).expect("UTF-8"))
}

fn rows<'a>(tables: &'a Value, name: &str) -> &'a Vec<Value> {
    tables[name].as_array().unwrap_or_else(|| panic!("no table {name}"))
}

fn number(row: &Value, key: &str) -> f64 {
    row[key].as_f64().unwrap_or_else(|| panic!("{key}: {row}"))
}

/// Returns how many rows are about something.
fn about(rows: &[Value], word: &str) -> usize {
    rows.iter().filter(|row| format!("{} {}", row["case"], row["other"]).contains(word)).count()
}

#[test]
fn bench_update_has_stock_and_memory() {
    let (object, _) = quick("update");
    let rows = rows(&object["tables"], "update");
    for word in ["stock", "nothing moved", "1% moved"] {
        assert!(about(rows, word) > 0, "{word}");
    }
    for row in rows.iter().filter(|row| row["other"].is_string()) {
        assert!(number(row, "other_over_pbig_median") > 0.0 && number(row, "pbig_mean") > 0.0, "{row}");
    }
    let memory = rows.iter().filter(|row| row["unit"] == "MB");
    assert_eq!(memory.clone().count(), 2);
    assert!(!cfg!(target_os = "linux") || memory.clone().all(|row| number(row, "pbig_median") > 0.0));
}

#[test]
fn bench_step_has_every_scene_and_writes_a_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let object = json(&pbig(folder.path(), &["bench", "step", "--quick", "--json", "--write", "out"]));
    let rows = rows(&object["tables"], "step");
    assert_eq!(rows.len(), pbig_harness::scenes::Scene::ALL.len());
    for row in rows {
        for side in ["stock", "pbig"] {
            let of = |what: &str| number(row, &format!("{side}_{what}"));
            assert!(0.0 < of("broad_mean_ms") && of("broad_mean_ms") < of("step_mean_ms"), "{row}");
        }
    }
    let text = std::fs::read_to_string(folder.path().join("out/step.csv")).expect("the file");
    assert!(text.starts_with("# machine: ") && text.contains("\nscene,bodies,threads,steps,"), "{text}");
    assert_eq!(text.lines().filter(|line| !line.starts_with('#')).count(), 1 + rows.len());
}

#[test]
fn bench_gpu_has_both_backends_and_a_verdict() {
    let (object, aside) = quick("gpu");
    let searches = rows(&object["tables"], "searches");
    let is_software = object["head"]["software"] == "true";
    assert_eq!(searches.len(), if is_software { 4 } else { 8 });
    assert!(searches.iter().all(|row| number(row, "cpu_over_gpu") > 0.0));
    assert_eq!(aside.contains("the times say nothing about a GPU"), is_software, "{aside}");
    let verdict = object["verdict"].as_str().expect("a sentence");
    let device = if is_software { "software adapter" } else { "GPU" };
    let starts = [format!("The CPU was faster than this {device}"), format!("The {device} ")];
    assert!(starts.iter().any(|start| verdict.starts_with(start)), "{verdict}");
}

#[test]
fn a_missing_program_of_studies_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let alone = folder.path().join("pbig");
    std::fs::copy(env!("CARGO_BIN_EXE_pbig"), &alone).expect("a copy");
    let run = |args: &[&str]| std::process::Command::new(&alone).args(args).output().expect("it starts");
    let studies = "cargo run --release -p pbig-studies --";
    let build = "build it with `cargo build --release -p pbig-studies`";
    refused(&run(&["bench", "papers", "--quick"]), &[build, &format!("{studies} papers --quick")]);
    refused(&run(&["bench", "steady", "--write", "out"]), &[&format!("{studies} steady --write out")]);
    refused(&run(&["accuracy", "--quick"]), &[&format!("{studies} accuracy --quick")]);
}

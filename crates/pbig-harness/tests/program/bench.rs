//! `pbig bench`: each suite's shape, and that its figures are finite; never how large they are.

use super::{json, pbig, pbig_without_gpu, refused};
use serde_json::Value;
use std::path::Path;

/// One object, in which every row has what it is about, ours, and a finite ratio where there is another side;
/// nothing is written. What the times are is no matter of tests.
fn bench_rows(suite: &str) -> Vec<Value> {
    let folder = tempfile::tempdir().expect("a folder");
    let rows = bench_rows_in(folder.path(), &[suite]);
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0);
    rows
}

/// The same with more arguments, in a folder.
fn bench_rows_in(folder: &Path, args: &[&str]) -> Vec<Value> {
    let object = json(&pbig(folder, &[&["bench"], args, &["--quick", "--json"]].concat()));
    assert_eq!(object["suite"], args[0]);
    for key in ["cpu", "cores", "threads", "simd"] {
        assert!(!object["machine"][key].is_null(), "{key} is missing");
    }
    let rows = object["rows"].as_array().expect("rows").clone();
    for row in &rows {
        assert!(row["case"].is_string() && row["boxes"].is_u64() && row["pairs"].is_u64(), "{row}");
        assert!(row["ours_ms"].is_f64() || row["ours_mb"].is_f64() || row["note"].is_string(), "{row}");
        if row["other"].is_string() {
            let (ratio, other) = (row["ratio"].as_f64(), row["other_ms"].as_f64());
            assert!(ratio.is_some_and(|x| x.is_finite() && x > 0.0) && other > Some(0.0), "{row}");
        }
        assert_eq!(row["target"].is_string(), row["met"].is_boolean(), "{row}");
    }
    rows
}

/// How many rows are about something.
fn about(rows: &[Value], word: &str) -> usize {
    let has = |row: &&Value| format!("{} {}", row["case"], row["other"]).contains(word);
    rows.iter().filter(has).count()
}

#[test]
fn bench_update_compares_with_stock_and_the_floor_and_measures_memory() {
    let rows = bench_rows("update");
    let others = ["stock", "floor, one thread", "floor, all threads", "nothing moved", "1% moved", "memory"];
    for word in others {
        assert!(about(&rows, word) > 0, "{word}");
    }
    let of = |case: &str| {
        let has = move |row: &&Value| row["case"].as_str().is_some_and(|name| name.starts_with(case));
        rows.iter().filter(has).collect::<Vec<_>>()
    };
    let memory = of("memory, ");
    assert!(memory.len() > 2);
    assert!(!cfg!(target_os = "linux") || memory.iter().all(|row| row["ours_mb"].as_f64() > Some(0.0)));
    let requests = of("requests for memory, ");
    assert!(requests.len() > 2 && requests.iter().all(|row| row["ours_requests"].is_number()));
    assert_eq!(
        (&requests[0]["target"], &requests[0]["met"]),
        (&"none".into(), &true.into()),
        "{}",
        requests[0]
    );
}

#[test]
fn bench_peers_agree_on_the_pairs() {
    let rows = bench_rows("peers");
    for word in ["one thread", "all threads", "changed pairs", "refit_partial", "rebuilt", "obvhs", "per box"]
    {
        assert!(about(&rows, word) > 0, "{word}");
    }
    assert!(rows.iter().all(|row| row["pairs"].as_u64() > Some(0)));
}

#[test]
fn bench_step_has_every_scene_and_names_the_worst() {
    let rows = bench_rows("step");
    for scene in pbig_harness::scenes::Scene::ALL {
        assert!(about(&rows, scene.name) > 0, "{}", scene.name);
    }
    assert!(about(&rows, "uniform, 100% moved") > 0);
    assert!(rows.iter().all(|row| row["target"] == "at least 1x"));
}

#[test]
fn bench_steady_has_every_motion_and_every_scene_and_writes_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let rows = bench_rows_in(folder.path(), &["steady", "--boxes", "60", "--write", "out"]);
    let motions = pbig_harness::motions::Motion::ALL.map(|motion| motion.name());
    let scenes = pbig_harness::scenes::Scene::ALL.map(|scene| scene.name);
    for name in motions.iter().flat_map(|name| ["dense", "sparse"].map(|of| format!("{name}, {of}"))) {
        assert_eq!(about(&rows, &format!("\"{name}\" \"parry")), 1, "{name}");
        assert_eq!(about(&rows, &format!("\"{name}\" \"search from nothing")), 1, "{name}");
    }
    for name in scenes {
        assert_eq!(about(&rows, &format!("\"{name}, scene\" \"stock")), 1, "{name}");
    }
    let compared = rows.iter().filter(|row| row["stages_ms"]["median"].is_number());
    assert_eq!(compared.clone().count(), 2 * motions.len() + 2 + scenes.len());
    for row in compared {
        let of = |key: &str| row["stages_ms"][key].as_f64().expect("a number");
        assert!(of("median") <= of("p99") && of("p99") <= of("worst") && of("first") > 0.0, "{row}");
    }
    let written = |end: &str| {
        let files = std::fs::read_dir(folder.path().join("out")).expect("the folder");
        let mut paths = files.map(|file| file.expect("a file").path());
        let path = paths.find(|path| path.to_string_lossy().ends_with(end)).expect("a file of this kind");
        std::fs::read_to_string(path).expect("text")
    };
    let csv = written(".csv");
    let lines: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(lines[0][4..], ["what", "mean_ms", "median_ms", "p99_ms", "worst_ms", "first_ms"]);
    // Ours on all threads and on one, the finder and parry; ours and stock.
    assert_eq!(lines.len(), 1 + 4 * (2 * motions.len() + 2) + 2 * scenes.len());
    for line in &lines[1..] {
        let number = |k: usize| line[k].parse::<f64>().expect("a number");
        assert!(line.len() == 10 && number(6) <= number(7) && number(7) <= number(8), "{line:?}");
    }
    assert!(
        ["drift, dense: 60 boxes", "fall, dense", "parry 0.31"]
            .iter()
            .all(|words| written(".svg").contains(words))
    );
    refused(&pbig(folder.path(), &["bench", "step", "--quick", "--boxes", "60"]), &["--boxes", "steady"]);
}

#[test]
fn bench_stages_has_the_time_of_each_stage() {
    let rows = bench_rows("stages");
    for word in ["from scratch, boxes", "events, boxes", "share moved", "pairs a box", "largest edge"] {
        assert!(about(&rows, word) > 0, "{word}");
    }
    let of_events = rows.iter().filter(|row| row["case"].to_string().contains("events"));
    assert!(of_events.into_iter().all(|row| row["mean_ms"].as_f64() > Some(0.0)));
    let of_stages = |row: &Value| row["stages_ms"].as_object().map(serde_json::Map::len);
    assert!(rows.iter().all(|row| of_stages(row) > Some(1)), "{rows:?}");
}

/// On whatever adapter there is: what goes up and comes back is a matter of counts.
#[test]
fn bench_gpu_has_both_backends_and_moves_no_more_bytes_than_have_changed() {
    let folder = tempfile::tempdir().expect("a folder");
    let object = json(&pbig(folder.path(), &["bench", "gpu", "--quick", "--json"]));
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0);
    let rows = |of: &str| object[of].as_array().expect(of).clone();
    let number = |row: &Value, key: &str| row[key].as_f64().unwrap_or_else(|| panic!("{key}: {row}"));
    assert!(rows("rows").len() == 6 && rows("rows").iter().all(|row| number(row, "ratio") > 0.0));
    let events = rows("events");
    assert_eq!(events.len(), 4);
    for row in &events {
        for key in ["cpu_ms", "gpu_ms"] {
            assert!(number(&row[key], "median") > 0.0, "{key}: {row}");
        }
        let changed = number(row, "boxes") * number(row, "share");
        assert!(number(row, "uploaded") < 64.0 * changed + 4096.0, "{row}");
        assert!(number(row, "downloaded") < 32.0 * number(row, "events") + 4096.0, "{row}");
    }
    assert!(number(&events[3], "events") > 1000.0);
}

#[test]
fn bench_papers_has_every_table_and_says_that_there_is_no_gpu() {
    let folder = tempfile::tempdir().expect("a folder");
    let object = json(&pbig_without_gpu(folder.path(), &["bench", "papers", "--quick", "--json"]));
    assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0);
    assert!(object["suite"] == "papers" && object["adapter"].is_null());
    let parts = object["parts"].as_array().expect("parts");
    let sum: f64 = parts.iter().filter_map(|part| part["seconds"].as_f64()).sum();
    assert!(parts.len() > 5 && object["seconds"].as_f64().is_some_and(|all| (all - sum).abs() < 1e-6));
    assert!(object["seconds_wanted"] == 60.0);
    assert_eq!(object["met"], object["seconds"].as_f64() < Some(60.0));
    let tables = object["tables"].as_array().expect("tables");
    let title = |word: &str| tables.iter().filter(|table| table["title"].to_string().contains(word)).count();
    for name in
        ["PBIG figure 8", "figure 9", "figure 10", "figure 11", "table III", "table IV", "tables V and VI"]
    {
        assert!(title(name) > 0, "{name}");
    }
    for name in [
        "figure 3",
        "figure 4",
        "figure 5",
        "figure 6",
        "Avril table 1:",
        "table 2",
        "tables 2 and 4",
        "table 5",
        "table 6",
        "table 7",
    ] {
        assert!(title(name) > 0, "Avril {name}");
    }
    let counted = tables
        .iter()
        .flat_map(|table| table["rows"].as_array().expect("rows"))
        .filter(|row| row["pairs"].as_u64() > Some(0));
    assert!(counted.count() > 20);
}

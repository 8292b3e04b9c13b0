//! `pbig accuracy`: its shape, that its figures are finite, and that what must be right is; never how long it took.

use super::{json, pbig};
use serde_json::Value;
use std::path::Path;

fn rows<'a>(object: &'a Value, study: &str, table: &str) -> &'a Vec<Value> {
    let rows = object["studies"][study]["tables"][table]["rows"].as_array();
    rows.unwrap_or_else(|| panic!("{study} has no table {table}"))
}

fn files(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).expect("the folder");
    let mut names: Vec<String> =
        names.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort_unstable();
    names
}

#[test]
fn a_quick_run_is_one_object_and_writes_what_it_is_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let object = json(&pbig(folder.path(), &["accuracy", "--quick", "--json", "--plot", "charts"]));
    assert_eq!(files(folder.path()), ["charts"], "no document");
    assert_eq!(
        files(&folder.path().join("charts")),
        [
            "accuracy-coordinates.svg",
            "accuracy-index.svg",
            "accuracy-margin.svg",
            "accuracy-simulation.svg",
            "accuracy-wide.svg"
        ],
        "a chart for each study"
    );
    let seconds = |of: &Value| of["seconds"].as_f64().expect("how long it took");
    assert_eq!((&object["seconds_wanted"], &object["seconds_quick"]), (&Value::from(60.0), &Value::Null));
    assert_eq!(object["met"], seconds(&object) < 60.0);
    let studies = object["studies"].as_object().expect("studies");
    assert!(studies.values().all(|study| seconds(study) > 0.0), "each took some time");
    assert!(studies.values().map(seconds).sum::<f64>() <= seconds(&object), "no less than all of it");
    for (name, study) in studies {
        for point in study["points"].as_array().expect("points") {
            assert!(
                point["time"].as_f64() > Some(0.0) && point["error"].as_f64() >= Some(0.0),
                "{name}: {point}"
            );
        }
    }
    for row in rows(&object, "index", "all_pairs").iter().filter(|row| row["correction"] == "integers") {
        assert_eq!((&row["wrong"], &row["missed"]), (&Value::from(0), &Value::from(0)), "{row}");
    }
    let by_rules = |row: &&Value| row["root"] == "Carmack 1" && row["correction"] == "the paper's rules";
    let wrong = rows(&object, "index", "all_pairs").iter().find(by_rules).map(|row| row["wrong"].as_u64());
    assert!(wrong.flatten() > Some(0), "one step is more than the rules mend");
    for row in rows(&object, "index", "all_pairs") {
        let count = |name: &str| row[name].as_u64().unwrap_or_else(|| panic!("{name} is no count: {row}"));
        assert_eq!(count("missed"), count("doubled") + count("no_pair"), "{row}");
    }
    // There is no such table without an adapter.
    let kernels = object["studies"]["index"]["tables"]["kernels"]["rows"].as_array();
    for row in kernels.into_iter().flatten() {
        let sum = |of: &str| row[format!("doubled{of}")].as_u64().zip(row[format!("no_pair{of}")].as_u64());
        let is_lazy = row["root"] == "lazy way";
        assert!(!is_lazy || row["missed_by_the_rules"].is_null(), "no row is estimated: {row}");
        for of in ["", "_by_the_rules"].into_iter().take(if is_lazy { 1 } else { 2 }) {
            let missed = row[format!("missed{of}")].as_u64();
            assert!(missed.is_some() && missed == sum(of).map(|(doubled, none)| doubled + none), "{row}");
        }
    }
    let doubled = rows(&object, "index", "all_pairs").iter().filter(|row| row["doubled"].as_u64() > Some(0));
    assert!(doubled.count() > 0, "an error makes two indices test one pair");
    for (study, table) in [("coordinates", "tests"), ("margin", "margins"), ("simulation", "runs")] {
        assert!(rows(&object, study, table).iter().all(|row| row["missed"] == 0), "{study}");
    }
    let missed = |boxes: &str| {
        let rows = rows(&object, "wide", "ways").iter().filter(|row| row["boxes"] == boxes);
        rows.map(|row| row["missed_at_the_poses"].as_u64().expect("a count")).sum::<u64>()
    };
    assert!(missed("rapier's boxes") > 0 && missed("widened by 2 ulps") == 0);
}

#[test]
fn one_study_alone_and_no_other_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let object = json(&pbig(folder.path(), &["accuracy", "--quick", "--json", "--only", "coordinates"]));
    assert_eq!(object["studies"].as_object().map(serde_json::Map::len), Some(1));
    super::refused(&pbig(folder.path(), &["accuracy", "--only", "nothing"]), &["nothing", "index"]);
}

//! Runs on a GPU: the adapter in the output, its choice, and what `doctor` says of it. A software adapter at least is there.

use super::{json, pbig, pbig_where, refused, save};
use ndarray::{Array2, Array3};
use serde_json::Value;
use std::path::Path;
use std::process::Output;

const COMMANDS: [&[&str]; 3] = [
    &["pairs", "boxes.npy"],
    &["replay", "frames.npy"],
    &["simulate", "--scene", "pile", "--bodies", "1100", "--steps", "3"],
];

fn on_gpu(folder: &Path, command: &[&str], more: &[&str]) -> Output {
    pbig(folder, &[command, &["--backend", "gpu"], more].concat())
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    save(folder.path(), "boxes.npy", &Array2::<f32>::zeros((3, 6)));
    save(folder.path(), "frames.npy", &Array3::<f32>::zeros((3, 3, 6)));
    folder
}

/// The adapter of `--backend gpu`, true if it is software, and its number.
fn adapter(folder: &Path) -> (String, bool, usize) {
    let doctor = json(&pbig(folder, &["doctor", "--json"]));
    let name = doctor["adapter"].as_str().expect("an adapter").to_owned();
    let adapters = doctor["adapters"].as_array().expect("a list");
    let used: Vec<_> = adapters.iter().enumerate().filter(|(_, one)| one["is_used"] == true).collect();
    let [(number, used)] = used[..] else { panic!("{doctor}") };
    assert!(used["adapter"] == name.as_str() && used["error"].is_null(), "{doctor}");
    assert!(doctor["self_test"].as_array().is_some_and(|all| all.len() >= 18), "{doctor}");
    (name, used["is_software"] == true, number)
}

#[test]
fn the_summary_names_the_adapter_and_software_is_warned_of() {
    let folder = folder();
    let (name, is_software, _) = adapter(folder.path());
    for command in COMMANDS {
        let output = on_gpu(folder.path(), command, &[]);
        let [text, aside] =
            [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).expect("UTF-8"));
        assert!(text.contains(&format!("\nadapter: {name}\n")) && !text.contains("\n\n"), "{text}");
        let warning = format!("pbig: warning: {name} is a program on the CPU, slower than --backend cpu");
        // Nothing else, such as a driver's complaint.
        assert_eq!(
            (aside.starts_with(&warning), aside.lines().count()),
            (is_software, usize::from(is_software))
        );
        let object = json(&on_gpu(folder.path(), command, &["--json"]));
        let said = (&object["is_software"], object.get("fallback"));
        assert_eq!(said, (&is_software.into(), Some(&Value::Null)), "{object}");
        let required = on_gpu(folder.path(), command, &["--require-gpu"]);
        let status = required.status.code();
        let line = String::from_utf8_lossy(&required.stderr).into_owned();
        assert_eq!(
            (status, line.contains("is a software adapter")),
            (Some(i32::from(is_software)), is_software),
            "{line}"
        );
        let cpu = pbig(folder.path(), command);
        assert!(!String::from_utf8_lossy(&cpu.stdout).contains("adapter:") && cpu.stderr.is_empty());
    }
}

#[test]
fn a_required_gpu_that_is_missing_is_a_failure_without_output() {
    let folder = folder();
    for command in COMMANDS {
        let args = [command, &["--backend", "gpu", "--require-gpu", "--json"]].concat();
        let output = pbig_where(folder.path(), "WGPU_ADAPTER_NAME", "no such adapter", &args);
        let line = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!((output.status.code(), output.stdout.len()), (Some(1), 0), "{line}");
        // After a search the line would say that the CPU did work.
        assert!(line.starts_with("pbig: --require-gpu: no GPU adapter named"), "{line}");
        let args = [command, &["--backend", "gpu", "--json"]].concat();
        let warned = pbig_where(folder.path(), "WGPU_ADAPTER_NAME", "no such adapter", &args);
        let line = String::from_utf8_lossy(&warned.stderr).into_owned();
        let words = "the CPU did work: no GPU adapter named \"no such adapter\"; found: ";
        assert!(
            warned.status.success() && line.contains(words) && line.contains("; `pbig doctor` says more"),
            "{line}"
        );
        let object = json(&warned);
        let said = (object.get("is_software"), object["fallback"].is_string());
        assert_eq!(said, (Some(&Value::Null), true), "{object}");
        for option in [&["--require-gpu"][..], &["--adapter", "x"]] {
            refused(
                &pbig(folder.path(), &[command, option].concat()),
                &[&format!("{} needs --backend gpu", option[0])],
            );
        }
    }
    std::fs::write(folder.path().join("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").expect("written");
    for input in [&["boxes.npy", "--with", "boxes.npy"][..], &["--mesh", "m.obj", "--elements", "ff"]] {
        let command = [&["pairs"][..], input].concat();
        let output = on_gpu(folder.path(), &command, &["--require-gpu", "-o", "out.csv"]);
        let line = String::from_utf8_lossy(&output.stderr);
        assert_eq!(line, "pbig: --require-gpu: a search with --with or --mesh runs on the CPU\n");
        assert!(output.status.code() == Some(1) && !folder.path().join("out.csv").exists());
        refused(
            &on_gpu(folder.path(), &command, &["--adapter", "0"]),
            &["--adapter: a search with --with or --mesh"],
        );
        // No adapter is opened for it, so none is named.
        let warned =
            String::from_utf8(on_gpu(folder.path(), &command, &["-o", "cpu.csv"]).stderr).expect("UTF-8");
        assert!(
            warned.starts_with("pbig: warning: the CPU did work: ") && warned.lines().count() == 1,
            "{warned}"
        );
    }
    let args = ["pairs", "boxes.npy", "--backend", "gpu", "--require-gpu", "--adapter", "no such"];
    let output = pbig(folder.path(), &args);
    let line = String::from_utf8_lossy(&output.stderr);
    assert!(line.starts_with("pbig: --require-gpu: --adapter no such: no GPU adapter named"), "{line}");
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn an_adapter_is_chosen_by_a_part_of_its_name_or_its_number() {
    let folder = folder();
    let (name, _, number) = adapter(folder.path());
    let part = name.split(' ').next().expect("a word").to_uppercase();
    let number = format!("gpu {number}");
    for command in COMMANDS {
        for choice in [&part, &number] {
            let object = json(&on_gpu(folder.path(), command, &["--adapter", choice, "--json"]));
            assert_eq!(object["adapter"], name.as_str());
        }
        let words = "--adapter no such: no GPU adapter named \"no such\"; found: ";
        refused(&on_gpu(folder.path(), command, &["--adapter", "no such"]), &[words]);
    }
    // The flag counts before the variable.
    let args = ["pairs", "boxes.npy", "--backend", "gpu", "--adapter", &part, "--json"];
    let object = json(&pbig_where(folder.path(), "WGPU_ADAPTER_NAME", "no such", &args));
    assert_eq!(object["adapter"], name.as_str());
}

#[test]
fn doctor_obeys_what_pairs_obeys() {
    let folder = folder();
    let (name, is_software, _) = adapter(folder.path());
    let doctor = |variable: &str, value: &str| {
        let text = pbig_where(folder.path(), variable, value, &["doctor"]);
        let object = json(&pbig_where(folder.path(), variable, value, &["doctor", "--json"]));
        (String::from_utf8_lossy(&text.stdout).into_owned(), object)
    };
    let (text, object) = doctor("WGPU_ADAPTER_NAME", "no such");
    let why = "no GPU adapter named \"no such\"; found: ";
    assert!(text.contains(&format!("\n`--backend gpu` falls back to the CPU: {why}")), "{text}");
    assert!(!text.contains("used by `--backend gpu`") && object["adapter"].is_null(), "{text}");
    let is_told =
        |fallback: &str| fallback.starts_with(why) && fallback.ends_with("; WGPU_ADAPTER_NAME has that name");
    assert!(object["fallback"].as_str().is_some_and(is_told), "{object}");
    let (text, object) = doctor("WGPU_BACKEND", if cfg!(target_os = "windows") { "metal" } else { "dx12" });
    assert!(text.contains("adapters: none; `--backend gpu` falls back to the CPU: no GPU adapter; found: none; WGPU_BACKEND="), "{text}");
    assert!(
        text.contains(": unset it, or install its driver with Vulkan")
            && object["adapters"] == serde_json::json!([]),
        "{text}"
    );
    if cfg!(target_os = "linux") {
        let (text, _) = doctor("VK_DRIVER_FILES", "/no/such.json");
        let cause = "no GPU is found: VK_DRIVER_FILES names /no/such.json, which does not exist: unset it, or install";
        assert!(text.contains(cause) && !text.contains("WGPU_BACKEND"), "{text}");
    }
    let (text, object) = doctor("RAYON_NUM_THREADS", "1");
    assert!(
        text.contains(&format!(": {name}, driver")) && text.contains(", used by `--backend gpu`\n"),
        "{text}"
    );
    assert_eq!(text.contains("no GPU is found: install its driver with Vulkan"), is_software, "{text}");
    assert_eq!((&object["threads"], object["advice"].is_string()), (&1.into(), is_software));
    refused(
        &pbig(folder.path(), &["doctor", "--adapter", "no such"]),
        &["--adapter no such: no GPU adapter named"],
    );
}

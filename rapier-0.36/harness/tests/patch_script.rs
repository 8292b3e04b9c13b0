//! scripts/patch-rapier.sh in a project of its own: what it makes, what it removes, what it prints, and its errors.
#![cfg(not(any(feature = "dim2", feature = "f64")))]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().expect("the repository")
}

/// A user's project, with the script that patches it; removed in the end.
struct Project {
    work: PathBuf,
    script: PathBuf,
}

impl Project {
    fn new(name: &str) -> Self {
        let work = std::env::temp_dir().join(format!("pbig-patch-{name}-{}", std::process::id()));
        fs::create_dir_all(work.join("a project")).expect("a folder");
        let work = work.canonicalize().expect("a folder");
        Self { work, script: root().join("scripts/patch-rapier.sh") }
    }

    fn folder(&self) -> PathBuf {
        self.work.join("a project")
    }

    fn copy(&self) -> PathBuf {
        self.folder().join("patched/rapier3d-0.36.1")
    }

    fn write(&self, file: &str, text: &str) {
        let path = self.folder().join(file);
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        fs::write(path, text).expect("written");
    }

    /// Copies script and patches into a folder, and uses that copy from now on.
    fn clone_into(&mut self, folder: &Path) {
        for part in ["scripts", "patches"] {
            fs::create_dir_all(folder.join(part)).expect("a folder");
        }
        fs::copy(root().join("scripts/patch-rapier.sh"), folder.join("scripts/patch-rapier.sh"))
            .expect("copied");
        for file in fs::read_dir(root().join("patches")).expect("patches") {
            let path = file.expect("a file").path();
            fs::copy(&path, folder.join("patches").join(path.file_name().expect("a name"))).expect("copied");
        }
        self.script = folder.join("scripts/patch-rapier.sh");
    }

    /// Runs the script in the project, and returns what it prints, or its errors.
    fn run(&self, arguments: &[&str]) -> Result<String, String> {
        let mut command = Command::new("bash");
        let run =
            command.arg(&self.script).args(arguments).current_dir(self.folder()).output().expect("bash");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        if run.status.success() { Ok(text(&run.stdout)) } else { Err(text(&run.stderr)) }
    }

    #[track_caller]
    fn fails_with(&self, text: &str, arguments: &[&str]) {
        let error = self.run(arguments).expect_err("an error");
        assert!(error.contains(text), "{error}");
        assert!(!self.copy().exists() && !self.folder().join("patched/rapier3d-0.36.1.new").exists());
    }

    #[track_caller]
    fn prints(&self, text: &str, arguments: &[&str]) {
        let printed = self.run(arguments).expect("success");
        let text = text.replace("PROJECT", &self.folder().display().to_string());
        assert!(printed.contains(&text), "{printed}\nnot: {text}");
    }
}

impl Drop for Project {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.work);
    }
}

const RAPIER: &str = "[dependencies]\nrapier3d = \"0.36\"\n";

fn package(name: &str) -> String {
    format!("[package]\nname = \"{name}\"\nversion = \"0.0.0\"\n")
}

fn locked(version: &str) -> String {
    locked_crate("rapier3d", version)
}

fn locked_crate(name: &str, version: &str) -> String {
    format!("[[package]]\nname = \"{name}\"\nversion = \"{version}\"\n")
}

#[test]
fn an_error_says_what_is_wrong_and_leaves_no_copy() {
    let mut project = Project::new("errors");
    project.fails_with("no Cargo.toml in '.'", &[]);
    project.write("src/lib.rs", "");
    project.write("Cargo.toml", "package");
    project.fails_with("mend the manifest, or name rapier's crate by --crate: error: ", &[]);
    project.write("Cargo.toml", &(package("plain") + RAPIER));
    project.fails_with("unknown option '--fast'", &["--fast", "."]);
    project.fails_with("'--undo' after the folder '.': options go before it", &[".", "--undo"]);
    project.write("Cargo.lock", &locked("0.30.0"));
    project.fails_with("Cargo.lock has rapier3d 0.30.0; the patch is for 0.36.1", &[]);
    project.fails_with("run 'cargo update -p rapier3d --precise 0.36.1'", &["--crate", "rapier3d"]);
    fs::remove_file(project.folder().join("Cargo.lock")).expect("removed");
    project.clone_into(&project.work.join("old"));
    let patch = project.work.join("old/patches/rapier3d+0.36.1.patch");
    let text = fs::read_to_string(&patch).expect("the patch");
    let other: Vec<&str> =
        text.lines().map(|line| if line.starts_with(' ') { " none" } else { line }).collect();
    fs::write(&patch, other.join("\n")).expect("written");
    project.fails_with("the patch rapier3d+0.36.1.patch does not apply", &[]);
    fs::remove_file(&patch).expect("removed");
    project.fails_with("run the script from a copy of pbig's repository", &[]);
}

#[test]
fn another_version_of_rapier_is_refused_and_so_is_none() {
    let project = Project::new("versions");
    project.write("src/lib.rs", "");
    let uses = |line: &str| project.write("Cargo.toml", &(package("plain") + "[dependencies]\n" + line));
    for (line, words) in [
        ("rapier2d = \"0.35\"", "Cargo.toml asks for rapier2d ^0.35; the patch is for 0.36.1"),
        ("rapier3d = \"0.27\"", "needs no patch: use pbig's crate rapier-pbig"),
        ("r = { package = \"rapier3d\", version = \"=0.36.0\" }", "asks for rapier3d =0.36.0; the patch"),
        (
            "bevy_rapier2d = \"0.36\"",
            "asks for bevy_rapier2d ^0.36; the patch is for 0.36.1 (bevy_rapier 0.37)",
        ),
        ("", "depends on rapier: run 'cargo add rapier3d@0.36.1'"),
    ] {
        uses(line);
        project.fails_with(words, &[]);
    }
    // Cargo.lock still has what an earlier manifest asked for.
    uses("rapier3d = \"0.35\"");
    project.write("Cargo.lock", &locked("0.36.1"));
    project.fails_with("Cargo.toml asks for rapier3d ^0.35; the patch is for 0.36.1", &[]);
    fs::remove_file(project.folder().join("Cargo.lock")).expect("removed");
    for line in [
        "rapier3d = \"0.36.1\"",
        "rapier3d = \"=0.36\"",
        "rapier3d = \"0.36.0\"",
        "rapier3d = \">=0.30, <1\"",
    ] {
        uses(line);
        project.run(&[]).expect(line);
        assert!(project.copy().exists(), "{line}");
        project.run(&["--undo"]).expect("success");
    }
}

#[test]
fn every_member_that_uses_rapier_is_named_with_its_lines() {
    let project = Project::new("members");
    project.write(
        "Cargo.toml",
        "[workspace]\nmembers = [\"crates/*\"]\n[workspace.dependencies]\nrapier2d = \"0.36\"\n",
    );
    for (name, dependencies) in [
        ("both", "rapier2d.workspace = true\nrapier3d = \"0.36\"\n"),
        ("none", ""),
        ("old", "rapier3d = \"0.27\"\n"),
        ("tests", ""),
    ] {
        let tests = if name == "tests" { "[dev-dependencies]\nrapier2d = \"0.36\"\n" } else { "" };
        project.write(&format!("crates/{name}/src/lib.rs"), "");
        project.write(
            &format!("crates/{name}/Cargo.toml"),
            &(package(name) + tests + "[dependencies]\n" + dependencies),
        );
    }
    let line = |name: &str| {
        format!("    {name}-pbig = {{ path = \"{}/rapier-0.36/{name}-pbig\" }}\n", root().display())
    };
    let add = |member: &str| format!("\nAdd to PROJECT/crates/{member}/Cargo.toml:\n\n    [dependencies]\n");
    let blocks = add("both") + &line("rapier2d") + &line("rapier3d") + &add("tests") + &line("rapier2d");
    for folder in [".", "crates/none"] {
        project.prints(&blocks, &[folder]);
        let printed = project.run(&[folder]).expect("success");
        assert!(!printed.contains("crates/old") && !printed.contains("crates/none"), "{printed}");
    }
    project.write(
        "crates/tests/Cargo.toml",
        &(package("tests") + "exclude = [\"patched\"]\n[dependencies]\nrapier2d-pbig = \"1\"\n"),
    );
    let file = "PROJECT/crates/tests/Cargo.toml";
    let wanted = &format!("\n{file}:4:exclude = [\"patched\"]\n{file}:6:rapier2d-pbig = \"1\"\n");
    project.prints(wanted, &["--undo", "crates/none"]);
}

#[test]
fn help_lists_every_option() {
    let printed = Project::new("help").run(&["--help"]).expect("success");
    for option in ["[PROJECT]", "--crate NAME", "--edge-lookup", "--undo", "--help"] {
        assert!(printed.contains(&format!("    patch-rapier.sh {option}")), "{option}: {printed}");
    }
    assert!(!printed.contains("#!") && !printed.contains("set -"), "{printed}");
}

#[test]
fn the_copy_is_made_anew_and_removed_alone() {
    let project = Project::new("copies");
    project.write("Cargo.toml", &package("plain"));
    project.write("src/lib.rs", "");
    // The version for 0.27 may stand beside it.
    project.write("Cargo.lock", &(locked("0.27.0") + &locked("0.36.1")));
    let has = |file: &str, word: &str| {
        fs::read_to_string(project.copy().join(file)).expect("a file").contains(word)
    };
    project.run(&["--edge-lookup"]).expect("success");
    assert!(has("src/data/graph.rs", "find_edge_visiting"));
    project.write("patched/rapier3d-0.36.1/left", "");
    project.run(&[]).expect("success");
    assert!(has("src/geometry/broad_phase_bvh/pair_finder.rs", "PairFinder"));
    assert!(!has("src/data/graph.rs", "find_edge_visiting") && !project.copy().join("left").exists());
    // A copy that is made anew is compiled anew.
    project.prints("patched/rapier3d-0.36.1 is as it should be.", &[]);
    project.write("patched/mine", "");
    project.run(&["--undo"]).expect("success");
    assert!(!project.copy().exists() && project.folder().join("patched/mine").exists());
    project.prints("There were no copies in PROJECT/patched.", &["--undo"]);
}

const IN_A_WORKSPACE: &str = "Add to PROJECT/Cargo.toml, the root of the workspace, unless it has them:

    [workspace]
    exclude = [\"third party/pbig\", \"patched\"]

    [patch.crates-io]
    rapier3d = { path = \"patched/rapier3d-0.36.1\" }

Add to PROJECT/crates/app/Cargo.toml:

    [dependencies]
    rapier3d-pbig = { path = \"../../third party/pbig/rapier-0.36/rapier3d-pbig\" }
";

#[test]
fn it_prints_the_lines_for_each_manifest() {
    let mut project = Project::new("lines");
    project.write("Cargo.toml", &(package("plain") + RAPIER));
    project.write("src/lib.rs", "");
    project.prints(&format!("path = \"{}/rapier-0.36/rapier3d-pbig\"", root().display()), &[]);
    project.clone_into(&project.folder().join("third party/pbig"));
    project.prints("rapier3d-pbig = { path = \"third party/pbig/rapier-0.36/rapier3d-pbig\" }", &[]);
    // A virtual workspace, named by its member and by its root.
    fs::remove_dir_all(project.folder().join("src")).expect("removed");
    project.write("Cargo.toml", "[workspace]\nmembers = [\"crates/app\"]\n");
    project.write("crates/app/Cargo.toml", &(package("app") + RAPIER));
    project.write("crates/app/src/lib.rs", "");
    project.prints(IN_A_WORKSPACE, &["crates/app"]);
    assert!(project.copy().exists() && !project.folder().join("crates/app/patched").exists());
    project.prints(IN_A_WORKSPACE, &[]);
    project.write("crates/app/Cargo.toml", &package("app"));
    // Another crate may bring rapier.
    project.prints("Add to the Cargo.toml of each member that uses rapier:", &["--crate", "rapier3d"]);
    // A root that is a package as well.
    let top = package("top") + "[lib]\npath = \"crates/app/src/lib.rs\"\n[workspace]\n";
    project.write("Cargo.toml", &(top + RAPIER));
    project.prints("Add to PROJECT/Cargo.toml:\n\n    [dependencies]\n", &[]);
}

#[test]
fn it_patches_the_crates_of_rapier_that_the_project_has() {
    let project = Project::new("crates");
    project.write("Cargo.toml", &(package("plain") + "[dependencies]\nbevy_rapier2d = \"0.37\"\n"));
    project.write("src/lib.rs", "");
    let copies = || {
        let all = fs::read_dir(project.folder().join("patched")).into_iter().flatten();
        let mut names: Vec<_> =
            all.map(|file| file.expect("a file").file_name().into_string().expect("a name")).collect();
        names.sort_unstable();
        names
    };
    project.prints("/rapier-0.36/rapier2d-pbig\"", &[]);
    assert_eq!(copies(), ["rapier2d-0.36.1"]);
    project.fails_with("--crate needs rapier2d,", &["--crate", "rapier4d"]);
    project.run(&["--undo"]).expect("success");
    // The lock file counts before the manifest; a crate of another version stays as it is.
    project.write("Cargo.lock", &(locked("0.27.0") + &locked_crate("rapier3d-f64", "0.36.1")));
    project.prints("    rapier3d-f64 = { path = \"patched/rapier3d-f64-0.36.1\" }\n", &[]);
    assert_eq!(copies(), ["rapier3d-f64-0.36.1"]);
    project.run(&["--crate", "rapier2d-f64"]).expect("success");
    assert_eq!(copies(), ["rapier2d-f64-0.36.1", "rapier3d-f64-0.36.1"]);
    project.run(&["--undo"]).expect("success");
    assert!(copies().is_empty());
}

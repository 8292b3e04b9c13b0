//! The window obeys each key and ends cleanly; pictures need no display. These tests need a graphics adapter, a software one
//! will do, and those of the window also Xvfb and xdotool. `scripts/extra.sh viewer` installs them and runs the tests.
//! Screenshots are left in `out/` beside this folder.

#![allow(clippy::unwrap_used, reason = "helpers of tests end them, too")]

use image::RgbImage;
use std::collections::HashMap;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// A software adapter on a busy machine draws a frame in seconds; this only ends a test that hangs.
const PATIENCE: Duration = Duration::from_secs(120);

/// A program that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        self.0.kill().ok();
        self.0.wait().ok();
    }
}

fn spawn(command: &mut Command) -> (Running, BufReader<ChildStdout>) {
    let mut child = command.stdout(Stdio::piped()).spawn().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let output = BufReader::new(child.stdout.take().unwrap());
    (Running(child), output)
}

/// A screen without a monitor. The server chooses a free number and prints it.
fn screen() -> (Running, String) {
    let (server, mut output) = spawn(Command::new("Xvfb").args([
        "-displayfd",
        "1",
        "-screen",
        "0",
        "1280x800x24",
        "-nolisten",
        "tcp",
    ]));
    let mut number = String::new();
    output.read_line(&mut number).unwrap();
    (server, format!(":{}", number.trim()))
}

/// The viewer in a window, and the lines that it prints.
struct Viewer {
    process: Running,
    lines: Receiver<String>,
    display: String,
    window: String,
    state: HashMap<String, String>,
    _server: Running,
}

impl Viewer {
    fn start(options: &[&str]) -> Self {
        let (server, display) = screen();
        let mut command = Command::new(env!("CARGO_BIN_EXE_viewer"));
        let (process, output) =
            spawn(command.args(options).env("DISPLAY", &display).env_remove("WAYLAND_DISPLAY"));
        let (send, lines) = channel();
        std::thread::spawn(move || output.lines().map_while(Result::ok).try_for_each(|line| send.send(line)));
        let window = String::new();
        let mut viewer = Self { process, lines, display, window, state: HashMap::new(), _server: server };
        viewer.expect("ready");
        viewer.window = viewer.xdotool(&["search", "--sync", "--onlyvisible", "--name", "^pbig$"]);
        let window = viewer.window.clone();
        viewer.xdotool(&["windowfocus", "--sync", &window]);
        viewer
    }

    fn xdotool(&self, arguments: &[&str]) -> String {
        let output = Command::new("xdotool").args(arguments).env("DISPLAY", &self.display).output().unwrap();
        assert!(
            output.status.success(),
            "xdotool {arguments:?}: {}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    }

    /// Waits for a line that begins with this word, notes the state in it, and returns the rest of the line.
    fn expect(&mut self, word: &str) -> String {
        loop {
            let line =
                self.lines.recv_timeout(PATIENCE).unwrap_or_else(|_| panic!("no line began with '{word}'"));
            let (first, rest) = line.split_once(' ').unwrap_or((&line, ""));
            if first == word {
                let pairs = rest.split(' ').filter_map(|part| part.split_once('='));
                self.state.extend(pairs.map(|(name, value)| (name.to_owned(), value.to_owned())));
                return rest.to_owned();
            }
        }
    }

    fn press(&mut self, key: &str, word: &str) {
        self.xdotool(&["key", key]);
        self.expect(word);
    }

    fn get(&self, name: &str) -> &str {
        &self.state[name]
    }

    fn number(&self, name: &str) -> u64 {
        self.get(name).parse().unwrap()
    }

    /// Takes a picture by the key for it.
    fn picture(&mut self) -> RgbImage {
        self.press("p", "SavePicture");
        open(Path::new(&self.expect("saved")))
    }
}

fn open(path: &Path) -> RgbImage {
    image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display())).to_rgb8()
}

/// The share of pixels that differ.
fn difference(a: &RgbImage, b: &RgbImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let differ = a.pixels().zip(b.pixels()).filter(|(a, b)| a != b).count();
    differ as f64 / a.pixels().len() as f64
}

/// The number of colours.
fn colours(picture: &RgbImage) -> usize {
    picture.pixels().collect::<std::collections::HashSet<_>>().len()
}

fn out(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("out").join(name);
    std::fs::remove_dir_all(&folder).ok();
    folder
}

#[test]
#[ignore = "needs Xvfb, xdotool and a graphics adapter: scripts/extra.sh viewer"]
fn the_window_obeys_each_key() {
    let folder = out("keys");
    let pictures = folder.to_str().unwrap();
    let mut viewer = Viewer::start(&[
        "--bodies",
        "300",
        "--backend",
        "stock",
        "--size",
        "800x600",
        "--pictures",
        pictures,
    ]);
    viewer.press("space", "Pause");
    assert_eq!(viewer.get("paused"), "true");
    let stopped = viewer.number("step");
    for step in 1..=15 {
        viewer.press("s", "Step");
        assert_eq!(viewer.number("step"), stopped + step, "one step for each press");
    }

    let start = viewer.picture();
    assert!(colours(&start) > 100, "a picture of objects");
    assert!(difference(&start, &viewer.picture()) < 1e-3, "nothing moves while paused");
    obey_broad_phases(&mut viewer);
    obey_looks(&mut viewer);
    obey_scenes(&mut viewer);

    viewer.xdotool(&["key", "Escape"]);
    viewer.expect("ended");
    let started = Instant::now();
    let status = loop {
        if let Some(status) = viewer.process.0.try_wait().unwrap() {
            break status;
        }
        assert!(started.elapsed() < PATIENCE, "the program does not end");
        std::thread::sleep(Duration::from_millis(50));
    };
    assert!(status.success(), "{status}");
}

fn obey_broad_phases(viewer: &mut Viewer) {
    let keys = [("b", "Cpu"), ("b", "Gpu"), ("b", "Stock"), ("3", "Gpu"), ("1", "Stock"), ("2", "Cpu")];
    for (key, backend) in keys {
        let (step, pairs) = (viewer.number("step"), viewer.number("pairs"));
        let word = if key == "b" { "NextBroadPhase".to_owned() } else { format!("Use({backend})") };
        viewer.press(key, &word);
        assert_eq!((viewer.get("backend"), viewer.number("step")), (backend, step));
        viewer.press("s", "Step");
        let now = viewer.number("pairs");
        assert!(now > 0 && now.abs_diff(pairs) < pairs / 4, "{pairs} pairs, and {now} with {backend}");
    }
}

fn obey_looks(viewer: &mut Viewer) {
    let mut before = viewer.picture();
    let keys = [
        ("c", "NextColouring", "colouring", "Contacts"),
        ("c", "NextColouring", "colouring", "Sleeping"),
        ("h", "ToggleHelp", "help", "false"),
        ("h", "ToggleHelp", "help", "true"),
        ("c", "NextColouring", "colouring", "Shape"),
    ];
    for (key, word, name, value) in keys {
        viewer.press(key, word);
        assert_eq!(viewer.get(name), value);
        let after = viewer.picture();
        assert!(difference(&before, &after) > 0.005, "{word} changes the picture");
        before = after;
    }
    let bodies = viewer.number("bodies");
    viewer.press("t", "ThrowBall");
    assert_eq!(viewer.number("bodies"), bodies + 1);
    (0..6).for_each(|_| viewer.press("s", "Step"));
    assert!(difference(&before, &viewer.picture()) > 0.005, "a ball flies");
}

fn obey_scenes(viewer: &mut Viewer) {
    viewer.press("r", "Reset");
    assert_eq!((viewer.number("step"), viewer.number("bodies"), viewer.get("scene")), (0, 300, "column"));
    let before = viewer.picture();
    viewer.press("n", "NextScene");
    assert!(viewer.get("scene") != "column" && viewer.number("step") == 0);
    assert!(difference(&before, &viewer.picture()) > 0.005, "another scene");
    viewer.press("space", "Pause");
    assert_eq!(viewer.get("paused"), "false");
    viewer.press("space", "Pause");
    assert!(viewer.number("step") > 0, "the scene has gone on");
}

/// Runs the viewer without a display.
fn without_display(options: &[&str]) -> std::process::Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewer"));
    command.args(options).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").output().unwrap()
}

#[test]
#[ignore = "needs a graphics adapter: scripts/extra.sh viewer"]
fn pictures_need_no_display() {
    let folder = out("frames");
    let path = folder.to_str().unwrap();
    let options =
        ["--frames", path, "--steps", "20", "--every", "10", "--bodies", "300", "--size", "720x500"];
    let output = without_display(&options);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let pictures = ["00000.png", "00010.png", "00020.png"].map(|name| open(&folder.join(name)));
    assert_eq!(std::fs::read_dir(&folder).unwrap().count(), pictures.len());
    for two in pictures.windows(2) {
        assert!(two[0].dimensions() == (720, 500) && colours(&two[0]) > 100);
        assert!(difference(&two[0], &two[1]) > 0.005, "objects fall");
    }
}

#[test]
#[ignore = "needs a graphics adapter: scripts/extra.sh viewer"]
fn a_comparison_shows_the_same_start_on_both_sides() {
    let folder = out("compare");
    let path = folder.to_str().unwrap();
    let options = ["--frames", path, "--steps", "0", "--compare", "--bodies", "300", "--size", "800x500"];
    assert!(without_display(&options).status.success());
    let picture = open(&folder.join("00000.png"));
    let half = |x| image::imageops::crop_imm(&picture, x, 160, 400, 180).to_image();
    assert!(colours(&half(0)) > 100 && difference(&half(0), &half(400)) == 0.0);
    let whole = |x| image::imageops::crop_imm(&picture, x, 0, 400, 500).to_image();
    assert!(difference(&whole(0), &whole(400)) > 0.005, "the captions differ");
}

#[test]
#[ignore = "needs a graphics adapter: scripts/extra.sh viewer"]
fn without_a_display_the_window_says_what_is_missing() {
    let output = without_display(&["--bodies", "10"]);
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(
        !output.status.success() && text.contains("there is no display") && !text.contains("panicked"),
        "{text}"
    );
}

#[test]
#[cfg(target_os = "linux")]
#[ignore = "needs a graphics adapter: scripts/extra.sh viewer"]
fn a_display_that_nobody_serves_is_an_error_with_its_reason() {
    for (name, value) in [("DISPLAY", ":9999"), ("WAYLAND_DISPLAY", "nothing")] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_viewer"));
        command.args(["--bodies", "10"]).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").env(name, value);
        let output = command.output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{text}");
        assert!(text.contains("there is no display") && text.contains("event loop"), "{text}");
        assert!(!text.contains("panicked"), "{text}");
    }
}

#[test]
#[ignore = "needs Xvfb, xdotool and a graphics adapter: scripts/extra.sh viewer"]
fn a_picture_that_cannot_be_written_does_not_end_the_window() {
    let folder = out("unwritable");
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("file");
    std::fs::write(&file, "").unwrap();
    let mut viewer = Viewer::start(&["--bodies", "50", "--pictures", file.to_str().unwrap()]);
    viewer.press("p", "SavePicture");
    // The frame of the next key comes after the picture, and that of the one after it shows that the window goes on.
    (0..2).for_each(|_| viewer.press("s", "Step"));
    assert!(!file.is_dir() && viewer.process.0.try_wait().unwrap().is_none());
}

#[test]
#[cfg(target_os = "linux")]
#[ignore = "needs the software adapter's libraries alone: scripts/extra.sh viewer"]
fn without_an_adapter_the_program_says_what_is_missing() {
    let nothing =
        ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "__EGL_VENDOR_LIBRARY_FILENAMES"].map(|name| (name, "/none"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_viewer"));
    let output = command.args(["--frames", "out/none", "--bodies", "10"]).envs(nothing).output().unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(
        !output.status.success() && text.contains("no graphics adapter") && !text.contains("panicked"),
        "{text}"
    );
}

//! Input and output of the commands: an input that is not overwritten, pairs on stdout, hints.

use super::{array, pbig, read_pairs, refused, save};
use ndarray::{Array2, Array3};
use pbig_core::Aabb;
use std::path::Path;
use std::process::Output;

const THREE: &str = "0,0,0,1,1,1\n0,0,0,1,1,1\n1,1,1,0,0,0\n";

fn write(folder: &Path, name: &str, content: impl AsRef<[u8]>) {
    std::fs::write(folder.join(name), content).expect("written");
}

fn stdout(output: &Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

#[test]
fn the_input_is_not_overwritten() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    write(here, "boxes.csv", THREE);
    save(here, "frames.npy", &Array3::<f32>::zeros((2, 3, 6)));
    std::fs::copy(here.join("frames.npy"), here.join("before.npy")).expect("a copy");
    std::fs::hard_link(here.join("boxes.csv"), here.join("hard.csv")).expect("a link");
    std::fs::hard_link(here.join("frames.npy"), here.join("events.csv")).expect("a link");
    let absolute = here.join("boxes.csv");
    let mut outputs = vec!["boxes.csv", "./boxes.csv", "hard.csv", absolute.to_str().expect("UTF-8")];
    if cfg!(unix) {
        #[cfg(unix)]
        std::os::unix::fs::symlink("boxes.csv", here.join("soft.csv")).expect("a link");
        outputs.push("soft.csv");
    }
    for output in outputs {
        let line = refused(&pbig(here, &["pairs", "boxes.csv", "-o", output]), &[]);
        assert_eq!(line, format!("pbig: {output}: -o names the input, boxes.csv; name another file"));
    }
    refused(&pbig(here, &["replay", "frames.npy", "-o", "events.csv"]), &["events.csv: -o names the input"]);
    assert_eq!(std::fs::read_to_string(absolute).expect("the boxes"), THREE);
    let bytes = |name| std::fs::read(here.join(name)).expect("the frames");
    assert_eq!(bytes("frames.npy"), bytes("before.npy"));
    // Another file with the same content is another file.
    write(here, "other.csv", THREE);
    stdout(&pbig(here, &["pairs", "boxes.csv", "-o", "other.csv"]));
    assert_eq!(std::fs::read_to_string(here.join("other.csv")).expect("the pairs"), "a,b\n0,1\n");
}

#[test]
fn a_hyphen_writes_csv_to_stdout_and_the_summary_to_stderr() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    write(here, "boxes.csv", THREE);
    let output = pbig(here, &["pairs", "boxes.csv", "-o", "-"]);
    assert_eq!(stdout(&output), "a,b\n0,1\n");
    assert!(String::from_utf8_lossy(&output.stderr).starts_with("3 boxes (1 invalid"));
    save(here, "frames.npy", &Array3::<f32>::zeros((1, 2, 6)));
    let replay = stdout(&pbig(here, &["replay", "frames.npy", "-o", "-"]));
    assert_eq!(replay, "frame,event,a,b\n0,+,0,1\n");
    for (command, input) in [("pairs", "boxes.csv"), ("replay", "frames.npy")] {
        let both = pbig(here, &[command, input, "-o", "-", "--json"]);
        refused(&both, &["-o - and --json both write to stdout: leave out one"]);
    }
}

#[test]
fn the_first_invalid_box_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    write(here, "boxes.csv", format!("min_x,min_y,min_z,max_x,max_y,max_z\n\n{THREE}1,1,1,0,0,0\n"));
    let text = stdout(&pbig(here, &["pairs", "boxes.csv"]));
    assert!(text.starts_with("4 boxes (2 invalid, the first in line 5), 1 overlapping pairs\n"), "{text}");
    assert!(!text.contains("no device"), "nothing has failed: {text}");
    let what = "boxes.csv: line 5: box 2 (counted from 0) has a NaN or a minimum above its maximum";
    refused(&pbig(here, &["pairs", "boxes.csv", "--strict"]), &[what]);
    save(here, "boxes.npy", &array(&[Aabb::new([0.0; 3], [1.0; 3]), Aabb::new([1.0; 3], [0.0; 3])]));
    let text = stdout(&pbig(here, &["pairs", "boxes.npy"]));
    assert!(text.starts_with("2 boxes (1 invalid, the first in row 1, counted from 0), 0 over"), "{text}");
    let mut frames = Array3::<f32>::zeros((3, 3, 6));
    (frames[[1, 2, 0]], frames[[2, 0, 0]]) = (f32::NAN, f32::NAN);
    // An absent box is no invalid one.
    frames.slice_mut(ndarray::s![0, 0, ..]).fill(f32::NAN);
    save(here, "frames.npy", &frames);
    let text = stdout(&pbig(here, &["replay", "frames.npy"]));
    let line = "invalid boxes, over all frames: 2, the first in frame 1, row 2, counted from 0\n";
    assert!(text.contains(line), "{text}");
}

#[test]
fn no_boxes_are_an_answer_and_no_bytes_an_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    save(here, "none.npy", &Array2::<f32>::zeros((0, 6)));
    write(here, "header.csv", "min_x,min_y,min_z,max_x,max_y,max_z\n");
    // As `numpy.savetxt(.., delimiter=",", header="min_x,..")` writes it.
    write(here, "savetxt.csv", "# min_x,min_y,min_z,max_x,max_y,max_z\n");
    write(here, "blank.csv", "\n");
    for input in ["none.npy", "header.csv", "savetxt.csv", "blank.csv"] {
        let text = stdout(&pbig(here, &["pairs", input, "-o", "out.npy"]));
        assert!(text.starts_with("0 boxes (0 invalid), 0 "), "{input}: {text}");
        assert_eq!(read_pairs(&here.join("out.npy")), []);
    }
    for (command, input) in [("pairs", "zero.npy"), ("pairs", "zero.csv"), ("replay", "zero.npy")] {
        write(here, input, "");
        refused(&pbig(here, &[command, input]), &[&format!("pbig: {input}: the file is empty")]);
    }
}

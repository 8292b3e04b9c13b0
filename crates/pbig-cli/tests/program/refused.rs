//! Files that cannot be read: what the one line on stderr says was found, where, and what to do.

use super::{array, json, pbig, read_pairs, refused, save};
use ndarray::{Array2, Array3};
use pbig_core::Aabb;
#[cfg(target_os = "linux")]
use std::io::Write;
use std::path::Path;
#[cfg(target_os = "linux")]
use std::process::Command;

/// The one line on stderr about this content of a file.
fn line_about(folder: &Path, command: &str, name: &str, content: &[u8]) -> String {
    std::fs::write(folder.join(name), content).expect("written");
    refused(&pbig(folder, &[command, name]), &[name])
}

#[test]
fn bad_input_is_refused_in_one_line_that_says_what_and_where() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    let write = |name: &str, text: &str| std::fs::write(here.join(name), text).expect("written");
    let refuse = |args: &[&str], words: &[&str]| refused(&pbig(here, args), words);
    refuse(&["pairs", "nothing.npy"], &["nothing.npy", "No such file"]);
    write("boxes.txt", "");
    refuse(&["pairs", "boxes.txt"], &["boxes.txt", ".npy or .csv"]);
    write("word.csv", "0,0,0,1,1,1\n0,0,zero,1,1,1\n");
    refuse(&["pairs", "word.csv"], &["word.csv", "line 2", "column 3", "'zero'"]);
    write("short.csv", "0,0,0,1,1,1\n\n0,0,0,1,1\n");
    refuse(&["pairs", "short.csv"], &["short.csv", "line 3", "6 columns", "5"]);
    save(here, "five.npy", &Array2::<f32>::zeros((4, 5)));
    refuse(&["pairs", "five.npy"], &["five.npy", "(N, 6)", "(4, 5)"]);
    save(here, "flat.npy", &Array2::<f32>::zeros((4, 6)));
    refuse(&["pairs", "flat.npy", "-o", "out.txt"], &["out.txt", ".npy or .csv"]);
    save(here, "frames.npy", &Array3::<f32>::zeros((1, 2, 6)));
    refuse(&["replay", "frames.npy", "-o", "events.npy"], &["events.npy", ".csv"]);
    refuse(&["pairs", "flat.npy", "-o", "no/such/folder.npy"], &["no/such/folder.npy"]);
    let whole = std::fs::read(here.join("flat.npy")).expect("written above");
    std::fs::write(here.join("cut.npy"), &whole[..whole.len() - 10]).expect("written");
    refuse(&["pairs", "cut.npy"], &["cut.npy"]);
    save(here, "inverted.npy", &array(&[Aabb::new([0.0; 3], [1.0; 3]), Aabb::new([1.0; 3], [0.0; 3])]));
    refuse(&["pairs", "inverted.npy", "--strict"], &["inverted.npy", "box 1"]);
}

/// A `.npy` file with this header text and nothing behind it.
fn header_of(text: &str) -> Vec<u8> {
    let length = (text.len() as u16 + 1).to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], text.as_bytes(), b"\n"].concat()
}

fn header(kind: &str, shape: &str) -> Vec<u8> {
    header_of(&format!("{{'descr': {kind}, 'fortran_order': False, 'shape': ({shape}), }}"))
}

/// The parser of headers understands more than numpy writes, and checks all that it understands. A header that promises more than
/// the file holds is refused before anything is allocated, and values that are no floats are named as numpy names them.
#[test]
fn a_header_cannot_lie_and_says_what_the_values_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let quoted = |shape: &str| format!(r#"{{"descr": "<f4", "fortran_order": False, "shape": {shape}}}"#);
    let twice = quoted("(1, 6)").replace('}', ", 'shape': (2_199_023_255_552, 6)}");
    let nested = quoted(&format!("{}{}", "[".repeat(40), "]".repeat(40)));
    let floats = |shape: &str| header("'<f4'", shape);
    let others = |kind: &str, size: usize| [header(kind, "1, 6"), vec![0; 6 * size]].concat();
    for (command, content, words) in [
        ("pairs", header_of(&quoted("(0x20000000000, 6)")), "bytes of values"),
        ("pairs", header_of(&twice), "bytes of values"),
        ("replay", header_of(&quoted("(0, 0x4000000000000000, 6)")), "larger than any file"),
        ("replay", header_of(&quoted("(20000000, 0, 6)")), "too many empty frames"),
        ("pairs", header_of(&nested), "none that numpy writes"),
        ("pairs", header_of(&quoted("(0x20000000000, 6)").replace("f4", "f0")), "values are float0"),
        ("pairs", floats("1000000000000, 6"), "24000000000000 bytes"),
        ("pairs", floats("10, 6"), "needs 240 bytes"),
        ("pairs", floats("4611686018427387904, 6"), "larger than any file"),
        ("replay", floats("1000000000, 1000, 6"), "bytes"),
        ("replay", floats("9223372036854775807, 0, 6"), "larger than any file"),
        ("replay", floats("1000000000000, 0, 6"), "too many empty frames"),
        (
            "pairs",
            others("'<i4'", 4),
            "values are int32; expected float32 or float64 (numpy: `.astype('float32')`)",
        ),
        ("pairs", others("'>u8'", 8), "values are uint64; expected"),
        ("pairs", others("'|b1'", 1), "values are bool; expected"),
        ("pairs", others("'<f2'", 2), "values are float16; expected"),
        ("pairs", others("'<c8'", 8), "values are complex64; expected"),
        ("pairs", others("'<U1'", 4), "values are of type '<U1'; expected"),
        ("pairs", others("[('a', '<f4')]", 4), "values are records; expected"),
    ] {
        let line = line_about(folder.path(), command, "x.npy", &content);
        assert!(line.starts_with("pbig: x.npy: ") && line.contains(words), "{words}: {line}");
    }
}

/// Memory does not follow what a file promises, nor its length: with 1 GiB of addresses the program still answers.
#[cfg(target_os = "linux")]
#[test]
fn wrong_files_are_refused_in_little_memory() {
    let folder = tempfile::tempdir().expect("a folder");
    let floats = |rows: u64| header("'<f4'", &format!("{rows}, 6"));
    let ply = "ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\n\
               property float x\nproperty float y\nproperty float z\nend_header\n";
    let mesh = ["--elements", "vv", "--mesh", "x.ply"];
    for (content, holes, args) in [
        (floats(1 << 27), 0, &["x.npy"][..]),
        (floats(1 << 28), 24 << 28, &["x.npy"]),
        (vec![], 1 << 33, &["x.npy"]),
        (vec![], 1 << 33, &["x.csv"]),
        (ply.into(), 0, &mesh),
        (vec![], 1 << 33, &mesh),
        (vec![], 1 << 33, &["--elements", "vv", "--mesh", "x.obj"]),
    ] {
        let name = args[args.len() - 1];
        let mut file = std::fs::File::create(folder.path().join(name)).expect("a file");
        file.write_all(&content).expect("written");
        file.set_len(content.len() as u64 + holes).expect("holes, which take no place on the disk");
        let limited = ["-c", "ulimit -v 1048576 && exec \"$@\"", "sh", env!("CARGO_BIN_EXE_pbig"), "pairs"];
        // Stacks and arenas of many threads take addresses, too.
        let few = [("RAYON_NUM_THREADS", "1"), ("MALLOC_ARENA_MAX", "1")];
        let output =
            Command::new("sh").current_dir(folder.path()).envs(few).args(limited).args(args).output();
        refused(&output.expect("a shell"), &[name]);
    }
}

#[test]
fn long_values_are_cut_in_errors_and_the_expected_form_stays() {
    let folder = tempfile::tempdir().expect("a folder");
    let long = "é".repeat(20_000);
    let version_3 = |text: String| {
        [b"\x93NUMPY\x03\x00", &(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat()
    };
    let of_kind = format!("{{'descr': '{long}', 'fortran_order': False, 'shape': (1, 6)}}\n");
    let ones = "1, ".repeat(20_000);
    for (name, content, words) in [
        ("x.npy", version_3(of_kind), "é...'; expected float32 or float64"),
        ("x.npy", version_3(format!("{{'{long}': 1}}\n")), r"unknown key: '\xe9"),
        ("x.npy", version_3(long.clone()), "not a readable .npy file: "),
        ("x.npy", [header("'<f4'", &ones), vec![0; 4]].concat(), "found (1, 1, "),
        ("x.npy", header("'<f4'", &ones), "1,... needs 4 bytes of values, the file has 0"),
        ("x.csv", format!("0,0,{long},1,1,1\n").into_bytes(), "é...' is not a number"),
    ] {
        let line = line_about(folder.path(), "pairs", name, &content);
        assert!(line.contains(words) && line.chars().count() < 250, "{words}: {line}");
    }
}

#[test]
fn a_list_of_frames_and_one_of_boxes_are_told_apart() {
    let folder = tempfile::tempdir().expect("a folder");
    let refuse = |command, words: &str| refused(&pbig(folder.path(), &[command, "x.npy"]), &[words]);
    save(folder.path(), "x.npy", &Array3::<f64>::zeros((4, 3, 6)));
    refuse("pairs", "shape (4, 3, 6) is a list of frames: use `pbig replay`; `pbig pairs` expects (N, 6)");
    save(folder.path(), "x.npy", &Array2::<f32>::zeros((4, 6)));
    refuse("replay", "shape (4, 6) is one list of boxes: use `pbig pairs`; `pbig replay` expects (F, N, 6)");
    save(folder.path(), "x.npy", &Array3::<f32>::zeros((6, 4, 3)));
    refuse("pairs", "expected an array of shape (N, 6), found (6, 4, 3)");
    refuse("replay", "expected an array of shape (F, N, 6), found (6, 4, 3)");
}

#[test]
fn other_separators_or_headers_are_told_what_is_expected() {
    let folder = tempfile::tempdir().expect("a folder");
    let header = "the header must be min_x,min_y,min_z,max_x,max_y,max_z, or be left out";
    for (text, wanted) in [
        ("0;0;0;1;1;1\n", "line 1: values are separated by semicolons; expected commas"),
        (
            "min_x;min_y;min_z;max_x;max_y;max_z\n",
            "line 1: values are separated by semicolons; expected commas",
        ),
        ("0,5;0,5;0,5;1;1;1\n", "line 1: values are separated by semicolons; expected commas"),
        ("0,0,0,1,1,1\n0\t0\t0\t1\t1\t1\n", "line 2: values are separated by tabs; expected commas"),
        (
            "0 0 0 1 1 1\n",
            "line 1: values are separated by spaces; expected commas: numpy.savetxt takes delimiter=','",
        ),
        ("max_x,max_y,max_z,min_x,min_y,min_z\n1,1,1,0,0,0\n", &format!("line 1: {header}")),
        ("\u{feff}id,min_x,min_y,min_z,max_x,max_y,max_z\n", &format!("line 1: {header}")),
        ("hello world\n", &format!("line 1: {header}")),
        ("0,0,0,1,1,1\na,b,c,d,e,f\n", "line 2: column 1: 'a' is not a number"),
        ("\"0,0,0,1,1,1\n0,0,0,1,1,1\n", "line 1: expected 6 columns, separated by commas, found 1"),
    ] {
        let line = line_about(folder.path(), "pairs", "x.csv", text.as_bytes());
        assert_eq!(line, format!("pbig: x.csv: {wanted}"));
    }
    let line = line_about(folder.path(), "pairs", "x.csv", b"0,0,0,1,1,1\n\n0,0,0,1,1,\xff\n");
    assert_eq!(line, "pbig: x.csv: line 3: this is not UTF-8; save the file as UTF-8 text");
}

#[test]
fn endings_in_capitals_are_the_same_endings() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    save(here, "A.NPY", &Array2::<f32>::zeros((2, 6)));
    std::fs::write(here.join("B.CSV"), "0,0,0,1,1,1\n0,0,0,1,1,1\n").expect("written");
    for input in ["A.NPY", "B.CSV"] {
        json(&pbig(here, &["pairs", input, "-o", "OUT.Npy", "--json"]));
        assert_eq!(read_pairs(&here.join("OUT.Npy")).len(), 1, "{input}");
    }
    json(&pbig(here, &["pairs", "A.NPY", "-o", "OUT.CSV", "--json"]));
    assert_eq!(std::fs::read_to_string(here.join("OUT.CSV")).expect("the output"), "a,b\n0,1\n");
    save(here, "F.NPY", &Array3::<f32>::zeros((1, 2, 6)));
    json(&pbig(here, &["replay", "F.NPY", "-o", "EVENTS.CSV", "--json"]));
}

//! `-` as an input: boxes, frames and meshes on stdin, told apart by their first bytes.

use super::{array, degenerate, pbig, pbig_fed, refused, save};
use ndarray::Array3;
use pbig_core::oracle;

#[test]
fn stdin_has_boxes_frames_or_a_mesh() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = folder.path();
    let read = |name: &str| std::fs::read(here.join(name)).expect("a file");
    let boxes = degenerate(300, 5);
    save(here, "boxes.npy", &array(&boxes));
    save(here, "frames.npy", &Array3::<f32>::zeros((2, 3, 6)));
    let obj = "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\nf 4 5 6\n";
    let ply = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n\
               element face 2\nproperty list uchar int vertex_index\nend_header\n\
               0 0 0\n2 0 0\n0 2 0\n0 0 0\n2 0 0\n0 2 0\n3 0 1 2\n3 3 4 5\n";
    let wanted: Vec<String> =
        oracle::pairs(&boxes).iter().map(|pair| format!("{},{}\n", pair.a, pair.b)).collect();
    let mesh = ["pairs", "--mesh", "-", "--elements", "ff", "-o", "-"];
    for (bytes, args, wanted) in [
        (read("boxes.npy"), &["pairs", "-", "-o", "-"][..], format!("a,b\n{}", wanted.concat())),
        (b"0,0,0,1,1,1\n1,1,1,2,2,2\n".into(), &["pairs", "-", "-o", "-"], "a,b\n0,1\n".into()),
        (b"0,0,0,1,1,1\n".into(), &["pairs", "-", "-o", "-", "--with", "-"], String::new()),
        (
            read("frames.npy"),
            &["replay", "-", "-o", "-"],
            "frame,event,a,b\n0,+,0,1\n0,+,0,2\n0,+,1,2\n".into(),
        ),
        (obj.into(), &mesh, "a,b\n0,1\n".into()),
        (ply.into(), &mesh, "a,b\n0,1\n".into()),
        ([b"\xef\xbb\xbf", ply.as_bytes()].concat(), &mesh, "a,b\n0,1\n".into()),
    ] {
        let output = pbig_fed(here, &bytes, args);
        assert_eq!(String::from_utf8_lossy(&output.stdout), wanted, "{args:?}");
        assert_eq!(output.status.success(), !wanted.is_empty());
    }
    let file = pbig(here, &["pairs", "boxes.npy", "--with", "boxes.npy", "-o", "-"]);
    let piped = pbig_fed(here, &read("boxes.npy"), &["pairs", "boxes.npy", "--with", "-", "-o", "-"]);
    assert_eq!(file.stdout, piped.stdout);
}

#[test]
fn errors_name_stdin() {
    let folder = tempfile::tempdir().expect("a folder");
    let fed = |bytes: &[u8], args: &[&str], words: &str| {
        let line = refused(&pbig_fed(folder.path(), bytes, args), &[]);
        assert!(line.starts_with(&format!("pbig: {words}")), "{line}");
    };
    let mesh = |next| ["pairs", "--mesh", "-", "--elements", "ff", "--next", next];
    fed(b"0,0,0,1,1\n", &["pairs", "-"], "stdin: line 1: expected 6 columns");
    fed(b"1,1,1,0,0,0\n", &["pairs", "-", "--strict"], "stdin: line 1: box 0");
    fed(b"", &["pairs", "-"], "stdin: the file is empty");
    fed(b"\x93NUMPY\x01", &["pairs", "-"], "stdin: not a readable .npy file");
    fed(b"hello", &["replay", "-"], "stdin: not a .npy file");
    fed(b"hello", &mesh("-")[..5], "stdin: no vertices");
    fed(b"ply\nhello", &mesh("-")[..5], "stdin: line 2: 'hello' is no line of a header");
    fed(b"v 0 0 0", &mesh("-"), "- is stdin, and cannot be two inputs: name a file");
}

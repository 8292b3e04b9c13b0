//! Writes the seeds of the fuzz targets that read files into `fuzz/corpus`. Bytes of the other targets mean something wherever a
//! mutation changes them.
//!
//! `cargo run --release --example fuzz_seeds`

use ndarray::Array2;
use ndarray_npy::WriteNpyExt;
use pbig_core::Aabb;
use pbig_tests::corpus;
use std::path::PathBuf;

/// Boxes of a set that go into a seed: mutations of long inputs are slow and seldom hit what matters.
const MOST: usize = 60;

fn main() -> std::io::Result<()> {
    for (i, case) in corpus().iter().enumerate() {
        let boxes = &case.boxes[..case.boxes.len().min(MOST)];
        write("obj_reader", i, obj(boxes).as_bytes())?;
        write("ply_reader", i, &ply(boxes, i % 2 == 1))?;
        write("csv_reader", i, csv(boxes).as_bytes())?;
        write("npy_reader", i, &npy(boxes))?;
    }
    Ok(())
}

fn write(target: &str, number: usize, bytes: &[u8]) -> std::io::Result<()> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(target);
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join(format!("seed-{number}")), bytes)
}

/// A triangle for each box: two corners of it, and one of the box before.
fn triangles(boxes: &[Aabb]) -> Vec<[usize; 3]> {
    (1..boxes.len()).map(|i| [2 * i, 2 * i + 1, 2 * i - 1]).collect()
}

fn obj(boxes: &[Aabb]) -> String {
    let vertex = |[x, y, z]: [f32; 3]| format!("v {x} {y} {z}\n");
    let face = |corners: [usize; 3]| format!("f {}//1 {} -1\n", corners[0] + 1, corners[1] + 1);
    let vertices = boxes.iter().flat_map(|aabb| [aabb.min, aabb.max]).map(vertex);
    vertices.chain(triangles(boxes).into_iter().map(face)).chain(["l 1 2 \\\n-1 # rods\n".into()]).collect()
}

/// A row of the element `edge` and one of `tristrips`.
const RODS_AND_STRIPS: [&[i32]; 2] = [&[0, 1], &[4, 0, 1, -1, 1]];

fn ply(boxes: &[Aabb], is_binary: bool) -> Vec<u8> {
    let (format, faces) = (if is_binary { "binary_little_endian" } else { "ascii" }, triangles(boxes));
    let head = format!(
        "ply\nformat {format} 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n\
         element face {}\nproperty list uchar int vertex_indices\nelement edge 1\nproperty int vertex1\nproperty int vertex2\n\
         element tristrips 1\nproperty list int int vertex_indices\nend_header\n",
        2 * boxes.len(),
        faces.len()
    );
    let vertices = boxes.iter().flat_map(|aabb| [aabb.min, aabb.max]);
    let rows: Vec<u8> = if is_binary {
        let floats = vertices.flatten().flat_map(f32::to_le_bytes);
        let face = |face: [usize; 3]| [vec![3], face.map(|v| (v as u32).to_le_bytes()).concat()].concat();
        let rest = RODS_AND_STRIPS.concat().into_iter().flat_map(i32::to_le_bytes);
        floats.chain(faces.into_iter().flat_map(face)).chain(rest).collect()
    } else {
        let vertices = vertices.map(|[x, y, z]| format!("{x} {y} {z}\n"));
        let faces = faces.into_iter().map(|[a, b, c]| format!("3 {a} {b} {c}\n"));
        let row = |row: &&[i32]| row.iter().map(|number| format!("{number} ")).chain(["\n".into()]).collect();
        let rest = RODS_AND_STRIPS.iter().map(row);
        vertices.chain(faces).chain(rest).collect::<String>().into_bytes()
    };
    [head.into_bytes(), rows].concat()
}

fn csv(boxes: &[Aabb]) -> String {
    let number = |x: &f32| x.to_string();
    let line = |b: &Aabb| b.min.iter().chain(&b.max).map(number).collect::<Vec<_>>().join(",") + "\n";
    boxes.iter().map(line).collect()
}

fn npy(boxes: &[Aabb]) -> Vec<u8> {
    let numbers: Vec<f32> = boxes.iter().flat_map(|b| b.min.into_iter().chain(b.max)).collect();
    let (array, mut bytes) =
        (Array2::from_shape_vec((boxes.len(), 6), numbers).expect("six a box"), Vec::new());
    array.write_npy(&mut bytes).expect("memory takes it all");
    bytes
}

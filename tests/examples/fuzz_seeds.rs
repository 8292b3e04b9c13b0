//! Writes the seeds of the fuzz targets into `fuzz/corpus`: sets of boxes, scenes that run, and files of both.
//!
//! `cargo run --release --example fuzz_seeds`

use ndarray::{Array2, Array3};
use ndarray_npy::WriteNpyExt;
use pbig_core::{Aabb, Pair, oracle};
use pbig_harness::checks::input::raw;
use pbig_harness::scenes::Scene;
use pbig_tests::corpus;
use rapier_pbig::PbigBroadPhase;
use std::path::PathBuf;

/// Boxes of a set that go into a seed: mutations of long inputs are slow and seldom hit what matters.
const MOST: usize = 60;

fn main() -> std::io::Result<()> {
    for (i, case) in corpus().iter().enumerate() {
        let boxes = &case.boxes[..case.boxes.len().min(MOST)];
        // All finders, without filters, for which these bytes have no room.
        let settings = (i % 4) as u8;
        write("finder_against_oracle", i, &[&[settings][..], &concat(boxes)].concat())?;
        write("between_against_oracle", i, &[&[settings][..], &in_turns(boxes)].concat())?;
        write("obj_reader", i, obj(boxes).as_bytes())?;
        write("ply_reader", i, &ply(boxes, i % 2 == 1))?;
        write("csv_reader", i, csv(boxes).as_bytes())?;
        write("npy_reader", i, &npy(boxes, 1))?;
        write("decode", i, &words(boxes))?;
    }
    for (i, scene) in Scene::ALL.iter().enumerate() {
        let frames = frames(scene);
        write("updates_against_scratch", i, &updates(((i % 8) << 4) as u8, &frames))?;
        write("npy_reader", 1000 + i, &npy(&frames[..2].concat(), 2))?;
        write("decode", 1000 + i, &snapshot(&frames))?;
    }
    Ok(())
}

fn write(target: &str, number: usize, bytes: &[u8]) -> std::io::Result<()> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(target);
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join(format!("seed-{number}")), bytes)
}

fn concat(boxes: &[Aabb]) -> Vec<u8> {
    boxes.iter().flat_map(raw).collect()
}

/// Boxes of the first set and of the second one in turns.
fn in_turns(boxes: &[Aabb]) -> Vec<u8> {
    boxes.iter().zip(0..).flat_map(|(aabb, i)| [vec![i], raw(aabb)].concat()).collect()
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

fn npy(boxes: &[Aabb], frames: usize) -> Vec<u8> {
    let numbers: Vec<f32> = boxes.iter().flat_map(|b| b.min.into_iter().chain(b.max)).collect();
    let (n, mut bytes) = (boxes.len() / frames, Vec::new());
    let written = match frames {
        1 => Array2::from_shape_vec((n, 6), numbers).expect("six a box").write_npy(&mut bytes),
        _ => Array3::from_shape_vec((frames, n, 6), numbers).expect("six a box").write_npy(&mut bytes),
    };
    written.expect("memory");
    bytes
}

/// The pairs of a set as a device would return them, in the three formats in turn.
fn words(boxes: &[Aabb]) -> Vec<u8> {
    let pairs = oracle::pairs(boxes);
    let plain: Vec<u32> = pairs.iter().flat_map(|pair| [pair.a, pair.b]).collect();
    let (format, output) = match boxes.len() % 3 {
        0 => (0, plain),
        1 => (1, [vec![1 << 31 | pairs.len() as u32], plain].concat()),
        _ => (2, bits(&pairs, boxes.len())),
    };
    let head = [format, boxes.len() as u8, 0];
    head.into_iter().chain(output.iter().flat_map(|word| word.to_le_bytes())).collect()
}

fn bits(pairs: &[Pair], n: usize) -> Vec<u32> {
    let mut words = vec![0; (n * n.saturating_sub(1) / 2).div_ceil(32)];
    for pair in pairs {
        let (a, b) = (pair.a as usize, pair.b as usize);
        let k = a * (2 * n - a - 1) / 2 + b - a - 1;
        words[k / 32] |= 1 << (k % 32);
    }
    words
}

/// The boxes of a small scene's colliders, now and then while it runs.
fn frames(scene: &Scene) -> Vec<Vec<Aabb>> {
    let (mut world, mut broad_phase) = (scene.build(30, 1), PbigBroadPhase::new());
    let mut frame = || {
        (0..15).for_each(|_| world.step(&mut broad_phase));
        let boxes = world.colliders.iter().map(|(_, collider)| collider.compute_aabb());
        boxes.map(|b| Aabb::new(b.mins.coords.into(), b.maxs.coords.into())).take(40).collect()
    };
    (0..4).map(|_| frame()).collect()
}

/// Every box set, and an update, frame by frame.
fn updates(settings: u8, frames: &[Vec<Aabb>]) -> Vec<u8> {
    let set = |(id, aabb): (usize, &Aabb)| [&[0, id as u8][..], &raw(aabb)].concat();
    let frame = |boxes: &Vec<Aabb>| boxes.iter().enumerate().flat_map(set).chain([10]).collect::<Vec<u8>>();
    [settings, 0].into_iter().chain(frames.iter().flat_map(frame)).collect()
}

/// A broad phase in the middle of a run, saved.
fn snapshot(frames: &[Vec<Aabb>]) -> Vec<u8> {
    let mut broad_phase = pbig_core::BroadPhase::new(pbig_core::Config::DEFAULT).expect("a good margin");
    for boxes in frames {
        _ = broad_phase.update();
        for (id, aabb) in boxes.iter().enumerate() {
            broad_phase.set(id as u32, *aabb, pbig_core::ProxyFilter::ALL).expect("few boxes");
        }
    }
    let saved = postcard::to_stdvec(&broad_phase).expect("a snapshot");
    [&[3, 0, 0][..], &saved].concat()
}

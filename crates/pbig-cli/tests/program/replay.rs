//! `pbig replay`: what its events add up to.

use super::{degenerate, json, pbig, save, six};
use ndarray::Array3;
use pbig_core::{Aabb, oracle};
use pbig_harness::boxes::{BoxSet, moved};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// Frames of moving boxes that come and go, some invalid for a while.
fn frames(n: usize, count: usize, seed: u64) -> Vec<Vec<Option<Aabb>>> {
    let mut rng = StdRng::seed_from_u64(seed);
    let mut boxes = degenerate(n / 2, seed);
    boxes.extend(BoxSet::named("unit").expect("the set exists").boxes(n - n / 2, seed));
    (0..count)
        .map(|frame| {
            if frame % 3 > 0 {
                boxes = moved(&boxes, 0.3, frame as u64);
            }
            boxes.iter().map(|b| (!rng.random_bool(0.1)).then_some(*b)).collect()
        })
        .collect()
}

fn save_frames(folder: &Path, frames: &[Vec<Option<Aabb>>]) {
    let shape = (frames.len(), frames[0].len(), 6);
    let value = |(f, i, k): (usize, usize, usize)| frames[f][i].map_or(f32::NAN, |b| six(&b)[k]);
    save(folder, "frames.npy", &Array3::from_shape_fn(shape, value));
}

/// The pairs after each frame, by the events alone.
fn followed(path: &Path, frames: usize) -> Vec<BTreeSet<(u32, u32)>> {
    let text = std::fs::read_to_string(path).expect("the events");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("frame,event,a,b"));
    let mut states = vec![BTreeSet::new(); frames];
    let mut current = BTreeSet::new();
    let mut at = 0;
    for line in lines {
        let fields: Vec<&str> = line.split(',').collect();
        let [frame, a, b] = [0, 2, 3].map(|i| fields[i].parse::<u32>().expect("a number"));
        for state in &mut states[at..frame as usize] {
            state.clone_from(&current);
        }
        at = frame as usize;
        let known = if fields[1] == "+" { current.insert((a, b)) } else { current.remove(&(a, b)) };
        assert!(known && a < b && ["+", "-"].contains(&fields[1]), "{line}");
    }
    states[at..].fill(current);
    states
}

#[test]
fn replayed_events_add_up_to_the_pairs_of_every_frame() {
    let folder = tempfile::tempdir().expect("a folder");
    for (seed, n) in [(1, 40), (2, 200), (3, 600)] {
        let frames = frames(n, 20, seed);
        save_frames(folder.path(), &frames);
        for backend in ["auto", "cpu", "gpu", "brute"] {
            let args = ["replay", "frames.npy", "-o", "events.csv", "--backend", backend, "--json"];
            let object = json(&pbig(folder.path(), &args));
            assert_eq!((&object["frames"], &object["boxes"]), (&Value::from(20), &Value::from(n)));
            assert_eq!(object["ms"]["per_frame"].as_array().map(Vec::len), Some(20));
            let states = followed(&folder.path().join("events.csv"), frames.len());
            for (frame, state) in frames.iter().zip(&states) {
                let boxes: Vec<Aabb> = frame.iter().map(|b| b.unwrap_or(Aabb::NOWHERE)).collect();
                let wanted = oracle::pairs(&boxes).iter().map(|p| (p.a, p.b)).collect();
                assert_eq!(*state, wanted, "seed {seed}, {backend}");
            }
        }
    }
}

#[test]
fn with_a_margin_pairs_are_at_most_those_of_two_margins() {
    let folder = tempfile::tempdir().expect("a folder");
    let frames = frames(300, 15, 4);
    save_frames(folder.path(), &frames);
    json(&pbig(folder.path(), &["replay", "frames.npy", "-o", "events.csv", "--margin", "0.2", "--json"]));
    let states = followed(&folder.path().join("events.csv"), frames.len());
    for (frame, state) in frames.iter().zip(&states) {
        let boxes: Vec<Aabb> = frame.iter().map(|b| b.unwrap_or(Aabb::NOWHERE)).collect();
        let grown: Vec<Aabb> = boxes.iter().map(|b| b.inflated(0.4)).collect();
        let pairs =
            |boxes: &[Aabb]| -> BTreeSet<_> { oracle::pairs(boxes).iter().map(|p| (p.a, p.b)).collect() };
        assert!(state.is_superset(&pairs(&boxes)), "a pair is missing");
        assert!(state.is_subset(&pairs(&grown)), "{:?}", state.difference(&pairs(&grown)).next());
    }
}

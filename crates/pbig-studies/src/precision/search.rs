//! A plain search to compare coordinates in: one grid by lower corners, cells as large as the largest extent.

use super::{Coordinates, Scale};
use pbig_core::Aabb;
use std::time::{Duration, Instant};

/// The most cells; more make cells larger.
const MOST_CELLS: f64 = (1u64 << 23) as f64;

/// Boxes in the order of their cells, and which of them are tested against which.
pub(crate) struct Candidates {
    scale: Scale,
    boxes: Vec<Aabb>,
    /// A box, and others in consecutive places.
    runs: Vec<[u32; 3]>,
}

/// The findings of tests in some kind of coordinates.
#[derive(Clone, Copy, Default)]
pub(crate) struct Found {
    pub(crate) tests: u64,
    /// Pairs that may overlap, and those of them that do.
    pub(crate) candidates: u64,
    pub(crate) pairs: u64,
    /// Rounding the boxes, testing them, and testing in f32 what may overlap, where that is not exact.
    pub(crate) encode: Duration,
    pub(crate) test: Duration,
    pub(crate) recheck: Duration,
}

impl Candidates {
    /// Sorts boxes by cell: valid and finite ones, at least one.
    pub(crate) fn new(boxes: &[Aabb]) -> Self {
        let all = boxes.iter().fold(boxes[0], |all, b| all.union(b));
        let scale = scale(boxes, &all);
        let dims = std::array::from_fn(|k| scale.cell(k, all.max[k]) as usize + 1);
        sorted(boxes, scale, dims)
    }

    /// Tests all that lie near each other; `kept` is room that is used again.
    pub(crate) fn find<C: Coordinates>(&self, kept: &mut Vec<[u32; 2]>) -> Found {
        let clock = Instant::now();
        let codes: Vec<C> = self.boxes.iter().map(|b| C::of(b, &self.scale)).collect();
        let encode = clock.elapsed();
        let (clock, tests) = (Instant::now(), self.test(&codes, kept));
        let test = clock.elapsed();
        let (clock, candidates) = (Instant::now(), kept.len() as u64);
        let pairs = if C::EXACT { candidates } else { self.recheck(kept) };
        Found { tests, candidates, pairs, encode, test, recheck: clock.elapsed() }
    }

    /// Without a branch on the result, which no processor could foresee.
    fn test<C: Coordinates>(&self, codes: &[C], kept: &mut Vec<[u32; 2]>) -> u64 {
        let (mut tests, mut count) = (0, 0);
        for &[i, from, to] in &self.runs {
            tests += u64::from(to - from);
            if kept.len() < count + (to - from) as usize {
                kept.resize(2 * kept.len() + (to - from) as usize, [0; 2]);
            }
            let code = codes[i as usize];
            for (j, &other) in (from..to).zip(&codes[from as usize..to as usize]) {
                kept[count] = [i, j];
                count += usize::from(code.may_overlap(other));
            }
        }
        kept.truncate(count);
        tests
    }

    fn recheck(&self, kept: &[[u32; 2]]) -> u64 {
        let overlap = |[i, j]: &[u32; 2]| self.boxes[*i as usize].overlaps(&self.boxes[*j as usize]);
        kept.iter().map(|pair| u64::from(overlap(pair))).sum()
    }
}

fn scale(boxes: &[Aabb], all: &Aabb) -> Scale {
    let extents = |b: &Aabb| (0..3).map(|k| b.max[k] - b.min[k]).fold(0.0, f32::max);
    // Up once: the difference may have been rounded down.
    let largest = boxes.iter().map(extents).fold(f32::MIN_POSITIVE, f32::max).next_up();
    let volume: f64 =
        (0..3).map(|k| f64::from(all.max[k]) - f64::from(all.min[k]) + f64::from(largest)).product();
    Scale { origin: all.min, cell: largest.max((volume / MOST_CELLS).cbrt() as f32) }
}

/// Sorts boxes by cell, and lists for each the others in its own and in half of the neighbouring cells.
fn sorted(boxes: &[Aabb], scale: Scale, dims: [usize; 3]) -> Candidates {
    let place = |b: &Aabb| -> [usize; 3] { std::array::from_fn(|k| scale.cell(k, b.min[k]) as usize) };
    let key = |[x, y, z]: [usize; 3]| (z * dims[1] + y) * dims[0] + x;
    let mut order: Vec<(usize, Aabb)> = boxes.iter().map(|b| (key(place(b)), *b)).collect();
    order.sort_by_key(|(key, _)| *key);
    let start = |key: usize| order.partition_point(|(other, _)| *other < key) as u32;
    let mut runs = Vec::new();
    for (i, (key_of, b)) in (0u32..).zip(&order) {
        let [x, y, z] = place(b);
        // The rest of its own row, to the next cell; then four rows, from the cell before to the next.
        let last = (x + 1).min(dims[0] - 1);
        runs.push([i, i + 1, start(key_of - x + last + 1)]);
        for (y, z) in [(Some(y + 1), z), (y.checked_sub(1), z + 1), (Some(y), z + 1), (Some(y + 1), z + 1)] {
            let Some(y) = y.filter(|y| *y < dims[1] && z < dims[2]) else { continue };
            let row = key([0, y, z]);
            runs.push([i, start(row + x.saturating_sub(1)), start(row + last + 1)]);
        }
    }
    runs.retain(|[_, from, to]| from < to);
    Candidates { scale, boxes: order.into_iter().map(|(_, b)| b).collect(), runs }
}

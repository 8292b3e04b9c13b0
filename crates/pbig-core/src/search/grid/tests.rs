//! Cells and codes never lose an overlapping pair, and every implementation of the inner loops gives the same values.

use super::cells::Cells;
use crate::Aabb;
use crate::simd::{BLOCK, EightBoxes, Portable, Simd, dispatch, query_of};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

#[derive(Debug, PartialEq)]
struct Values {
    takes: bool,
    key: u32,
    code: u64,
}

fn values(simd: impl Simd, cells: &Cells, aabb: &Aabb) -> Values {
    let (low, high) = cells.steps(simd, aabb);
    let key = simd.key(cells.dims, cells.shift, cells.wraps, low);
    Values { takes: simd.fits(&cells.max_extent, aabb), key, code: simd.code(low, high) }
}

fn may_overlap(simd: impl Simd, code: u64, codes: &[u64; BLOCK]) -> u32 {
    simd.test(query_of(code), codes)
}

/// Boxes of edge 1, some of them flat, touching or far away; in one space or in three far apart.
fn random_boxes(random: &mut StdRng, clusters: u32) -> Vec<Aabb> {
    let mut one = |_: usize| {
        let cluster = random.random_range(0..clusters) as f32 * 1e6;
        let corner: [f32; 3] = std::array::from_fn(|_| cluster + random.random_range(0.0..12.0f32));
        let corner = if random.random_ratio(1, 3) { corner.map(f32::round) } else { corner };
        let corner = if random.random_ratio(1, 40) { corner.map(|x| x * 1e9) } else { corner };
        let extent: [f32; 3] = std::array::from_fn(|_| random.random_range(0.0..=1.0f32));
        Aabb::new(corner, std::array::from_fn(|k| corner[k] + extent[k]))
    };
    (0..600).map(&mut one).collect()
}

#[test]
fn overlapping_boxes_have_codes_that_may_overlap() {
    let mut random = StdRng::seed_from_u64(1);
    let mut met = [0; 2];
    for round in 0..12 {
        let boxes = random_boxes(&mut random, [1, 3][round % 2]);
        let cells = Cells::new(&boxes, None, 1);
        let values: Vec<Values> = boxes.iter().map(|aabb| dispatch!(values, &cells, aabb)).collect();
        for (i, one) in boxes.iter().enumerate().filter(|(i, _)| values[*i].takes) {
            for (j, other) in boxes.iter().enumerate().filter(|(j, _)| values[*j].takes) {
                if one.overlaps(other) {
                    assert_eq!(dispatch!(may_overlap, values[i].code, &[values[j].code; BLOCK]), 255);
                    met[usize::from(cells.wraps)] += 1;
                }
            }
        }
    }
    assert!(met.iter().all(|pairs| *pairs > 1000), "{met:?} in clamped and wrapped grids");
}

#[test]
fn every_implementation_computes_the_same_values() {
    let mut random = StdRng::seed_from_u64(2);
    let infinite = Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);
    for clusters in [1, 3] {
        let mut boxes = random_boxes(&mut random, clusters);
        let cells = Cells::new(&boxes, None, 1);
        boxes.extend([Aabb::NOWHERE, infinite, Aabb::new([f32::MAX; 3], [f32::MIN; 3])]);
        for aabb in &boxes {
            assert_eq!(dispatch!(values, &cells, aabb), values(Portable, &cells, aabb), "{aabb:?}");
        }
    }
    for _ in 0..2000 {
        let query = random.random::<u64>() & 0x1FF7_FDFF_1FF7_FDFF;
        let codes: [u64; BLOCK] = std::array::from_fn(|_| random.random::<u64>() & 0x5FF7_FDFF_5FF7_FDFF);
        assert_eq!(dispatch!(may_overlap, query, &codes), may_overlap(Portable, query, &codes));
    }
}

fn rows(simd: impl Simd, row: &[u32; 8], len: usize) -> (Vec<u32>, [bool; 2], [u32; 2]) {
    let mut other = *row;
    let same = simd.same_short(row, &other, len);
    other[len - 1] += 100;
    let absent = [row, &other].map(|numbers| simd.absent(numbers, row, len) & ((1 << len) - 1));
    (simd.sorted_short(row, len)[..len].to_vec(), [same, simd.same_short(row, &other, len)], absent)
}

#[test]
fn short_rows_are_sorted_and_compared() {
    let mut random = StdRng::seed_from_u64(3);
    for _ in 0..3000 {
        let len = random.random_range(1..=8);
        let mut row: [u32; 8] = std::array::from_fn(|_| random.random_range(0..20));
        if len < 8 {
            // Behind the row, as other rows are: the number that the other row ends with.
            row[len] = row[len - 1] + 100;
        }
        let mut wanted = row[..len].to_vec();
        wanted.sort_unstable();
        for found in [dispatch!(rows, &row, len), rows(Portable, &row, len)] {
            assert_eq!(found, (wanted.clone(), [true, false], [0, 1 << (len - 1)]));
        }
    }
}

fn overlaps(simd: impl Simd, boxes: &EightBoxes, aabb: &Aabb) -> u32 {
    simd.overlaps_eight(boxes, aabb)
}

#[test]
fn eight_boxes_at_once_overlap_as_one_by_one() {
    let mut random = StdRng::seed_from_u64(4);
    let boxes = random_boxes(&mut random, 1);
    for (eight, one) in boxes.chunks_exact(BLOCK).zip(&boxes) {
        let value = |aabb: &Aabb, row: usize| if row < 3 { aabb.min[row] } else { aabb.max[row - 3] };
        let columns: EightBoxes =
            std::array::from_fn(|row| std::array::from_fn(|lane| value(&eight[lane], row)));
        let wanted = (0..BLOCK).fold(0, |mask, lane| mask | u32::from(eight[lane].overlaps(one)) << lane);
        assert_eq!(dispatch!(overlaps, &columns, one), wanted);
        assert_eq!(overlaps(Portable, &columns, one), wanted);
    }
}

//! The kernels of the studies: Avril's mapping and the lazy way, for given indices or identifiers.

use super::*;

/// Returns the state for `count` indices from `first` on.
pub(super) fn indices(n: u32, first: u32, count: u32) -> State {
    let params = Params { boxes: n, split: first, cells: count, ..Params::default() };
    State { params, ..State::default() }
}

/// Returns the state for the ends of rows of `low..=high` boxes, with `of_row` places for a row.
pub(super) fn ends(low: u32, high: u32, of_row: u32) -> State {
    let split = of_row * (high - 1);
    let params = Params { boxes: low, split, cells: split * (high - low + 1), ..Params::default() };
    State { params, ..State::default() }
}

/// Writes the words of each place of each row, and zeros for rows that a number of boxes does not have.
fn by_places<const N: usize>(s: &mut State, of_row: u32, place: impl Fn(u32, u32, u32) -> [u32; N]) {
    let Params { boxes, split, cells, .. } = s.params;
    let places = (0..cells).map(|i| (boxes + i / split, i % split / of_row, i % split % of_row));
    s.out = places.flat_map(|(n, row, at)| if row + 1 < n { place(n, row, at) } else { [0; N] }).collect();
}

/// Writes both ends of each row: it begins with the next box, and ends with the last.
pub(super) fn row_ends(s: &mut State) {
    by_places(s, 2, |n, row, at| [row, row, [row + 1, n - 1][at as usize]]);
}

pub(super) fn lazy_ends(s: &mut State) {
    by_places(s, 5, |n, row, at| {
        let column = [0, row.saturating_sub(1), row, row + 1, n - 1][at as usize];
        if row < column { [row, column] } else { [u32::MAX; 2] }
    });
}

/// Writes the pair of each index. The estimated row is exact here; a kernel's may be off by a few.
pub(super) fn index_pairs(s: &mut State) {
    s.out.clear();
    for i in 0..s.params.cells {
        let (a, b) = pair_of((s.params.split + i).into(), s.params.boxes.into());
        s.out.extend([a as u32, a as u32, b as u32]);
    }
}

/// Writes the pair of each of n^2 identifiers, smaller box first. Other identifiers give no box.
pub(super) fn lazy_pairs(s: &mut State) {
    s.out.clear();
    for id in s.params.split..s.params.split + s.params.cells {
        let (a, b) = (id / s.params.boxes, id % s.params.boxes);
        s.out.extend(if a < b { [a, b] } else { [u32::MAX; 2] });
    }
}

#[test]
fn lazy_pairs_agrees_with_its_twin_as_far_as_32_bits_reach() {
    for n in [1u32, 2, 3, 31, 32, 33, 1000, 65_535] {
        let all = n * n;
        let count = all.min(20_000);
        for first in [0, (all - count) / 3, all - count] {
            let fault = fault(twin("lazy_pairs"), &GpuOptions::DEFAULT, &indices(n, first, count));
            assert_eq!(fault, None, "n {n}, from {first}");
        }
    }
}

#[test]
fn ends_agree_with_their_twins_for_every_root() {
    for (low, high) in [(2u32, 2), (2, 90), (255, 260), (4999, 5000)] {
        for root in 0..=9 {
            let options = GpuOptions { root, ..GpuOptions::DEFAULT };
            let fault = fault(twin("row_ends"), &options, &ends(low, high, 2));
            assert_eq!(fault, None, "n from {low} to {high}, root {root}");
        }
        let fault = fault(twin("lazy_ends"), &GpuOptions::DEFAULT, &ends(low, high, 5));
        assert_eq!(fault, None, "n from {low} to {high}");
    }
}

#[test]
fn index_pairs_agrees_with_its_twin_for_every_root() {
    needs_gpu!();
    for n in [2u32, 3, 4, 5, 31, 32, 33, 100, 257, 1000, 4097, 16_384, 32_767, 32_768] {
        let all = pair_count(n.into()) as u32;
        let count = all.min(20_000);
        for first in [0, (all - count) / 3, all - count] {
            for root in 0..=9 {
                let place = format!("n {n}, from {first}, root {root}");
                assert_eq!(index_fault(root, &indices(n, first, count)), None, "{place}");
            }
        }
    }
}

/// Returns the first difference of the pairs, or of an estimated row that is too far off.
///
/// A good root is off by one or two rows. One Newton step leaves an error of up to 0.18% of the root, which is up to 2 n.
fn index_fault(root: u32, before: &State) -> Option<String> {
    let options = GpuOptions { root, ..GpuOptions::DEFAULT };
    let kernel = twin("index_pairs");
    let wanted = after_twin(kernel, before);
    let found = on_device(gpu(), kernel, &options, &with_capacity_for(before, &wanted));
    let far = if matches!(root, 1 | 5) { 2 + before.params.boxes / 500 } else { 2 };
    let rows = found.out.iter().zip(&wanted.out).step_by(3);
    let worst = rows.max_by_key(|(estimate, row)| estimate.abs_diff(**row))?;
    let near = worst.0.abs_diff(*worst.1) <= far;
    (kernel.compare)(before, &found, &wanted)
        .or_else(|| (!near).then(|| format!("row {} was estimated as {}", worst.1, worst.0)))
}

//! From the index of a pair to the pair (Avril 3.2), as the kernels that check pairs compute it.

use super::*;

/// Returns the state for `count` indices from `first` on.
pub(super) fn indices(n: u32, first: u32, count: u32) -> State {
    let params = Params { boxes: n, levels: first, cells: count, ..Params::default() };
    State { params, ..State::default() }
}

/// Writes the pair of each index. The estimated row is exact here; a kernel's may be off by a few.
pub(super) fn index_pairs(s: &mut State) {
    s.out.clear();
    for i in 0..s.params.cells {
        let (a, b) = pair_of((s.params.levels + i).into(), s.params.boxes.into());
        s.out.extend([a as u32, a as u32, b as u32]);
    }
}

#[test]
fn index_pairs_agrees_with_its_twin() {
    needs_gpu!();
    for n in (2..90).chain([257, 1000, 4097, 4999, 5000, 16_384, 32_767, 32_768]) {
        let all = pair_count(n.into()) as u32;
        let count = all.min(20_000);
        for first in [0, (all - count) / 3, all - count] {
            assert_eq!(index_fault(&indices(n, first, count)), None, "n {n}, from {first}");
        }
    }
}

/// A device may round a square root as it likes, and a compiler may replace it.
#[test]
fn any_estimate_of_a_row_leads_to_the_pair() {
    needs_gpu!();
    let own = "return min(u32(max(row, 0.0)), n - 2u);";
    for other in ["return 0u;", "return n - 2u;", "return k * 7919u % (n - 1u);"] {
        for n in [2, 3, 90, 700] {
            let before = indices(n, 0, pair_count(n.into()) as u32);
            let wanted = after_twin(twin("index_pairs"), &before);
            let found = counting("index_pairs", &[[own, other]], &with_capacity_for(&before, &wanted));
            assert_eq!(twin("index_pairs").compare(&before, &found, &wanted), None, "{other} n {n}");
        }
    }
}

/// Returns the first difference of the pairs, or of an estimated row that is off by more than two rows.
fn index_fault(before: &State) -> Option<String> {
    let kernel = twin("index_pairs");
    let wanted = after_twin(kernel, before);
    let found = on_device(gpu(), kernel, &GpuOptions::DEFAULT, &with_capacity_for(before, &wanted));
    let mut rows = found.out.iter().zip(&wanted.out).step_by(3);
    let far = rows.find(|(estimate, row)| estimate.abs_diff(**row) > 2);
    kernel
        .compare(before, &found, &wanted)
        .or_else(|| far.map(|(estimate, row)| format!("row {row} was estimated as {estimate}")))
}

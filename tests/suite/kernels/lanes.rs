//! Idle lanes and loads, counted by texts that count what the kernel does instead of redundant tests.

use super::*;

/// Returns the number that a counting text has added to the redundant tests, and the tests.
fn counted(kernel: &str, edits: &[[&str; 2]], before: &State) -> [u64; 2] {
    let wanted = after_twin(twin(kernel), before);
    let before = with_capacity_for(before, &wanted);
    let after = counting(kernel, edits, &before);
    let added = |total: fn(&Totals) -> [u32; 2]| wide(total(&after.totals)) - wide(total(&before.totals));
    [added(|totals| totals.redundant), added(|totals| totals.made)]
}

/// Returns the lane steps of `check_large`, idle ones included, and the tests: all lanes take as long as the slowest one.
/// `planted` is an edit that may make it slower.
fn steps(before: &State, planted: [&str; 2]) -> [u64; 2] {
    let place = "let words = 2u * atomicExchange(&tally[HITS], 0u);";
    let edits = [
        ["var<workgroup> skip: u32;", "var<workgroup> skip: u32; var<workgroup> longest: atomic<u32>;"],
        ["atomicStore(&marks, 0u);", "atomicStore(&marks, 0u); atomicStore(&longest, 0u);"],
        ["let length = partners(lane, s);", "let length = partners(lane, s); atomicMax(&longest, length);"],
        ["note_test(1u, counts.y);", ""],
        [place, &format!("{place} add_total(REDUNDANT, LANES * atomicExchange(&longest, 0u));")],
        planted,
    ];
    counted("check_large", &edits, before)
}

/// Boxes of a pile, on some grounds.
fn on_grounds(grounds: usize) -> Case {
    let mut boxes = set("pile", 6000);
    boxes.extend(vec![Aabb::new([-1e4; 3], [1e4; 3]); grounds]);
    Case { boxes, small_cell: 96, ..pile() }
}

#[test]
fn most_lanes_are_busy_under_few_grounds() {
    needs_gpu!();
    let roles = ["if residents < select(boxes, boxes / 2u, within)", "if false"];
    for grounds in [1, 3, 32] {
        let before = State::before("check_large", &on_grounds(grounds));
        let [all, tests] = steps(&before, [roles[0]; 2]);
        assert!(tests >= 6000 * grounds as u64, "{grounds} grounds: {tests} tests");
        assert!(100 * tests >= 60 * all, "{grounds} grounds: {tests} tests in {all} steps");
        let [all, tests] = steps(&before, roles);
        assert!(
            100 * tests < 20 * all,
            "{grounds} grounds: {tests} tests in {all} steps without a change of roles"
        );
    }
}

/// Returns crowds of 40 boxes, each in cells of its own.
fn crowds() -> State {
    let site = |i: usize| [i % 6, i / 6 % 6, i / 36].map(|x| 8.0 * x as f32 + 0.5);
    let boxes = (0..216 * 40).map(|i| Aabb::from_center(site(i / 40), [0.3; 3])).collect();
    State::before("check_small", &Case { boxes, small_cell: GpuOptions::DEFAULT.small_cell, ..pile() })
}

#[test]
fn most_lanes_are_busy_in_cells_of_forty() {
    let before = crowds();
    let in_forty = before.slots.iter().filter(|slot| slot.shape & 0xFFFF == 40).count();
    assert!(in_forty >= 216 && before.large_items.is_empty(), "{in_forty} of {} cells", before.slots.len());
    let tests: u64 = before.small_items.iter().map(|item| u64::from(item.pairs)).sum();
    let steps = u64::from(LANES) * before.small_items.len() as u64;
    assert!(100 * tests >= 60 * steps, "{tests} tests in {steps} steps");
}

/// Edits of `check_small` that count the loads of boxes.
const LOADS: [[&str; 2]; 3] = [
    ["note_test(1u, 1u);", ""],
    ["staged_entries[lane] = entry;", "staged_entries[lane] = entry; atomicAdd(&tally[1], 1u);"],
    ["return ordered_box(", "atomicAdd(&tally[1], 1u); return ordered_box("],
];

#[test]
fn a_small_item_loads_each_of_its_boxes_once() {
    needs_gpu!();
    let [loads, tests] = counted("check_small", &LOADS, &crowds());
    assert!(tests > 0 && loads > 0 && 4 * loads <= tests, "{loads} loads for {tests} tests");
}

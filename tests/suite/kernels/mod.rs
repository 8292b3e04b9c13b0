//! The contract of the kernels: run alone, each leaves the same content in its buffers as its plain scalar twin. Where the
//! device may choose an order, sets are compared.
//!
//! A twin defines the result of a kernel, not its way. Together the twins find the oracle's pairs. The kernels of the sort are tested
//! together instead.

mod capacity;
mod cells;
mod checks;
mod compare;
mod constants;
mod device;
mod indices;
mod lanes;
mod ordered;
mod plans;
mod poison;
mod single;
mod sort;
mod state;
mod twins;

use bytemuck::{bytes_of_mut, cast_slice_mut};
use checks::*;
use compare::*;
use device::*;
use indices::*;
use ordered::*;
use pbig_core::{Aabb, Pair, ProxyFilter, oracle};
use pbig_gpu::layout::{
    self, BOX_BITS, CELLS_PER_BLOCK, CLASS_WORDS, COUNTED, COUNTS_PER_BLOCK, Cell, Chunk, Counters, FILTERED,
    FIRST_PIECE, GROUPS_PER_ROW, LANES, LargeItem, Level, Located, MAX_SPAN, PairCount, Params, SHORT_ROW,
    SUMMARY_WORDS, Slot, SmallItem, Totals, UNPLANNED, WINDOW, halves, wide,
};
use pbig_gpu::testing::plan_params;
use pbig_gpu::{GpuFinder, GpuOptions};
use pbig_harness::pair_index::{pair_count, pair_of};
use pbig_shaders::{self as shaders, Buffer, KERNELS, Kernel, Stage};
use pbig_tests::{corpus, difference, needs_gpu, without_gpu};
use plans::validate;
use poison::poisoned;
use sort::*;
use state::*;
use std::fmt::Debug;
use std::sync::OnceLock;
use twins::*;

/// Returns the kernels of a search and that of tests.
fn all_kernels() -> impl Iterator<Item = &'static Kernel> {
    KERNELS.iter().copied().chain([&shaders::INDEX_PAIRS])
}

#[test]
fn every_kernel_has_a_twin_or_is_part_of_the_sort() {
    let twins: Vec<_> = TWINS.iter().map(|twin| twin.kernel.name).collect();
    let (search, of_tests) = twins.split_at(TWINS.len() - 1);
    let names = [search, &SORT.map(|(kernel, _)| kernel.name), of_tests].concat();
    assert_eq!(names, all_kernels().map(|kernel| kernel.name).collect::<Vec<_>>());
}

#[test]
fn the_twins_together_find_the_pairs_of_the_oracle() {
    for case in cases() {
        let before = State::before("check_small", &case);
        let filters = &before.filters;
        let wanted =
            [(0, oracle::pairs(&case.boxes)), (FILTERED, oracle::pairs_filtered(&case.boxes, filters))];
        for (flags, wanted) in wanted {
            let state = before.clone().with(flags);
            let pairs = |kernel| pairs_of(&after_twin(twin(kernel), &state)).expect("a twin writes pairs");
            let both = sorted(&[pairs("check_small"), pairs("check_large")].concat());
            assert_eq!(difference(&both, &wanted), None, "{}, flags {flags}", case.name);
            assert_eq!(difference(&pairs("check_all"), &wanted), None, "{}, flags {flags}", case.name);
        }
    }
}

/// The tests below would mean little if the sets did not reach every kind of cell and item.
#[test]
fn the_sets_have_all_kinds_of_cells_levels_and_visitors() {
    let states: Vec<_> = cases().iter().map(|case| State::before("scatter", case)).collect();
    some(&states, "block after the first", |s| s.sums.len() > 1);
    some(&states, "visitors", |s| (0..s.cells.len()).any(|cell| s.counts_of(cell).visitors > 0));
    some(&states, "levels", |s| s.params.levels > 2);
    some(&states, "both kinds of items", |s| s.counters.small_items > 1 && s.counters.large_items > 1);
    some(&states, "rows beyond the first segment", |s| s.large_items.iter().any(|item| item.row > 0));
    some(&states, "columns after a row's own", |s| s.large_items.iter().any(|item| item.column > item.row));
    some(&states, "item of several segments", |s| {
        s.large_items.iter().any(|item| item.end_column > item.column + 1)
    });
    let skips = |case: &Case| {
        let s = State::before("check_large", case);
        s.large_items.iter().any(|item| {
            let mut checked = TestedPairs::default();
            check_large_item(&s, item, &mut checked);
            checked.made == 0
        })
    };
    assert!(cases().iter().any(skips), "no large item is skipped");
}

fn some(states: &[State], what: &str, has: impl Fn(&State) -> bool) {
    assert!(states.iter().any(has), "no {what}");
}

#[test]
fn every_kernel_of_the_map_agrees_with_its_twin() {
    for twin in TWINS.iter().take_while(|twin| twin.kernel.stage == Stage::Map) {
        for case in cases() {
            let before = State::before(twin.kernel.name, &case);
            assert_eq!(fault(twin, &GpuOptions::DEFAULT, &before), None, "{}", case.name);
        }
    }
}

/// Boxes go up as floats: all bit patterns must become what the host would make of them.
#[test]
fn locate_turns_floats_into_ordered_integers() {
    for case in cases() {
        let mut before = State::before("locate", &case);
        let odd = [f32::NAN, -f32::NAN, -0.0, 1e-45, f32::NEG_INFINITY, f32::INFINITY, f32::MAX];
        for (i, odd) in odd.into_iter().enumerate() {
            before.boxes[3 * i].min[i % 3] = odd;
            before.boxes[3 * i + 1].max[i % 3] = odd;
            before.boxes[3 * i + 2] = Aabb::new([odd; 3], [odd; 3]);
        }
        assert_eq!(fault(twin("locate"), &GpuOptions::DEFAULT, &before), None, "{}", case.name);
    }
}

/// With more blocks than lanes the workgroup takes several turns.
#[test]
fn scan_sums_agrees_with_its_twin_on_many_blocks() {
    for blocks in [1u32, 255, 256, 257, 1000] {
        let params = Params { cells: blocks * COUNTS_PER_BLOCK / 2 - 5, ..Params::default() };
        let sums = (0..blocks).map(|i| i * 7919 % 100).collect();
        let before = State { params, sums, ..State::default() };
        assert_eq!(fault(twin("scan_sums"), &GpuOptions::DEFAULT, &before), None, "{blocks} blocks");
    }
}

/// `schedule` numbers the items of a cell by a formula, which must hold for hundreds of segments and every width.
#[test]
fn schedule_numbers_the_items_of_huge_cells_without_gaps() {
    for columns in [1, 2, 3, 8] {
        let shapes = [(1, 0), (256, 1), (257, 0), (1, 5000), (3000, 2000), (90_000, 0), (700, 70_000)];
        let cells = shapes.map(|(residents, visitors)| Cell { residents, visitors }).to_vec();
        let params = Params { cells: 7, small_cell: 32, columns, ..Params::default() };
        let mut before = State { params, cells, sums: vec![0], ..State::default() };
        scan_blocks(&mut before);
        scan_sums(&mut before);
        let wanted = after_twin(twin("schedule"), &before);
        let Counters { entries, slots, small_items, large_items, .. } = wanted.counters;
        set_capacities(&mut before.params, &[entries, slots, small_items, large_items]);
        before.large_items = vec![LargeItem::default(); large_items as usize];
        assert_eq!(fault(twin("schedule"), &GpuOptions::DEFAULT, &before), None, "{columns} columns");
    }
}

#[test]
fn arrange_dispatches_nothing_without_capacity() {
    let found = Counters {
        entries: 10,
        slots: 20,
        small_items: 100_000,
        large_items: 32_769,
        tests: 77,
        ..Counters::default()
    };
    let capacities = [10, 20, 100_000, 32_769];
    let of_chunk = |capacities: [u32; 4], chunk: Chunk, most_tests: u32| {
        let mut before = State { counters: found, ..State::default() };
        set_capacities(&mut before.params, &capacities);
        before.params.most_tests = most_tests;
        before.chunk = chunk;
        assert_eq!(fault(twin("arrange"), &GpuOptions::DEFAULT, &before), None, "{capacities:?}");
        after_twin(twin("arrange"), &before).dispatches
    };
    let items = |first: [u32; 2], [small_items, large_items]: [u32; 2]| Chunk {
        first_small: first[0],
        small_items,
        first_large: first[1],
        large_items,
        ..Chunk::default()
    };
    let dispatches = |capacities: [u32; 4], large_items: u32, most_tests: u32| {
        of_chunk(capacities, items([0; 2], [1 << 16, large_items]), most_tests)
    };
    let later = [([1 << 16, 32_768], [32_768, 2, 1, 1, 1, 1]), ([u32::MAX, 32_769], [0, 0, 1, 0, 0, 1])];
    for (first, wanted) in later {
        assert_eq!(of_chunk(capacities, items(first, [1 << 16, 5]), 77)[..6], wanted, "from {first:?}");
    }
    assert_eq!(dispatches(capacities, 5, 77)[..6], [32_768, 2, 1, 5, 1, 1]);
    assert_eq!(dispatches(capacities, u32::MAX >> 1, 77)[..6], [32_768, 2, 1, 32_768, 2, 1]);
    assert_eq!(dispatches(capacities, 5, 76)[..6], [0, 0, 1, 0, 0, 1], "too many tests");
    assert_eq!(dispatches(capacities, 5, u32::MAX)[..6], [32_768, 2, 1, 5, 1, 1], "any number of tests");
    for list in 0..4 {
        let mut less = capacities;
        less[list] -= 1;
        assert_eq!(dispatches(less, 5, 77)[..6], [0, 0, 1, 0, 0, 1], "list {list}");
    }
}

#[test]
fn conclude_says_what_did_not_fit() {
    let with = |words: u64, capacity: u32, flags: u32| {
        let mut before = State::before("conclude", &pile()).with(flags);
        (before.totals.words, before.chunk.word_capacity) = (halves(words), capacity);
        before.params.most_tests = before.counters.tests;
        // A list of no words would get the capacity for the twin's.
        before.out = vec![0];
        before
    };
    let status = |before: &State| {
        assert_eq!(fault(twin("conclude"), &GpuOptions::DEFAULT, before), None);
        after_twin(twin("conclude"), before).pair_count.status
    };
    let groups = u64::from(2 * LANES * GROUPS_PER_ROW);
    for words in [0, 2, 2 * 255, 2 * 256, 2 * 257, groups, groups + 2] {
        assert_eq!(status(&with(words, words as u32, 0)), layout::COMPLETE, "{words} words");
        assert_eq!(status(&with(words + 2, words as u32, 0)), layout::TOO_LARGE, "{words} words");
    }
    assert_eq!(status(&with((1 << 33) + 2, u32::MAX, 0)), layout::TOO_LARGE);
    assert_eq!(status(&with(2, 2, UNPLANNED)), layout::NOT_PLANNED);
    let mut before = with(2, 2, 0);
    before.params.slot_capacity -= 1;
    assert_eq!(status(&before), layout::TOO_LARGE);
    before.params.most_tests -= 1;
    assert_eq!(status(&before), layout::PLAN_REFUSED);
}

#[test]
fn checks_agree_with_their_twins() {
    let usual = GpuOptions::DEFAULT;
    check_agrees("check_small", &usual, usize::MAX);
    check_agrees("check_large", &usual, usize::MAX);
    check_agrees("check_large", &GpuOptions { load_balancing: false, ..usual }, usize::MAX);
    check_agrees("check_all", &usual, 2000);
}

/// Numbers of pairs around the size of a workgroup, and none.
#[test]
fn check_all_agrees_with_its_twin_on_few_boxes() {
    for n in [1, 2, 3, 8, 9, 23, 24, 33] {
        let case =
            Case { name: "few", boxes: vec![Aabb::new([0.0; 3], [1.0; 3]); n], small_cell: 32, columns: 8 };
        let fault = fault(twin("check_all"), &GpuOptions::DEFAULT, &State::new(&case));
        assert_eq!(fault, None, "{n} boxes");
    }
}

#[test]
fn a_chunk_is_its_items_and_no_others() {
    for (kernel, case) in [("check_small", pile()), ("check_large", crowd())] {
        let mut before = State::before(kernel, &case);
        let Counters { small_items: small, large_items: large, .. } = before.counters;
        for (from, part) in [(0, 3), (1, 3), (2, 1)] {
            before.chunk = Chunk {
                first_small: from * small / 3,
                small_items: small / part,
                first_large: from * large / 3,
                large_items: large / part,
                ..before.chunk
            };
            let fault = fault(twin(kernel), &GpuOptions::DEFAULT, &before);
            assert_eq!(fault, None, "{kernel}, {:?}", before.chunk);
        }
    }
}

/// A function that changes the result of a kernel.
type Plant = fn(&mut State);

/// A comparison that never finds a fault would pass every test above.
#[test]
fn planted_faults_are_noticed() {
    let faults: [(&str, Plant); 23] = [
        ("measure", |s| s.summary.iter_mut().rev().take(3).for_each(|word| *word ^= 1)),
        ("measure", |s| *s.summary.iter_mut().find(|word| **word > 0).expect("a class") += 1),
        ("conclude", |s| s.pair_count.status ^= 1),
        ("locate", |s| s.located[7].shape ^= 1 << (SPAN_BITS + 3)),
        ("locate", |s| full(s).residents -= 1),
        ("locate", |s| s.counters.valid -= 1),
        ("visit", |s| full(s).visitors += 1),
        ("scan_blocks", |s| *s.sums.last_mut().expect("a block") += 1),
        ("scan_blocks", |s| full(s).visitors += 1),
        ("scan_sums", |s| s.sums[0] += 1),
        ("scan_sums", |s| s.counters.entries -= 1),
        ("schedule", |s| s.slots[1].first_pair += 1),
        ("schedule", |s| s.small_items[1].slot -= 1),
        ("schedule", |s| s.small_items[1].pairs -= 1),
        ("schedule", |s| s.large_items.truncate(s.large_items.len() - 1)),
        ("scatter", |s| s.entries[5] ^= 1 << AXIS_BITS),
        ("scatter", |s| s.entries[5] += 1),
        ("arrange", |s| s.dispatches[3] += 1),
        ("check_small", drop_a_pair),
        ("check_large", drop_a_pair),
        ("check_all", drop_a_pair),
        ("check_small", |s| s.totals.redundant[0] ^= 1),
        ("index_pairs", |s| s.out[4] ^= 1),
    ];
    for (i, (kernel, plant)) in faults.iter().enumerate() {
        let before = State::before(kernel, &pile());
        let wanted = after_twin(twin(kernel), &before);
        let mut found = wanted.clone();
        assert_eq!(twin(kernel).compare(&before, &found, &wanted), None, "{kernel}");
        plant(&mut found);
        assert!(twin(kernel).compare(&before, &found, &wanted).is_some(), "fault {i}, {kernel}");
    }
}

/// Returns a cell with residents.
fn full(s: &mut State) -> &mut Cell {
    s.cells.iter_mut().find(|cell| cell.residents > 0).expect("a cell with residents")
}

/// Removes a pair from the list, but not from the counts.
fn drop_a_pair(s: &mut State) {
    s.out.truncate(s.out.len() - 2);
    s.totals.words = halves(s.out.len() as u64);
}

/// A fault in the device's input must be noticed, too: without this bit no entry owns a pair.
#[test]
fn entries_that_lost_a_bit_cost_pairs() {
    needs_gpu!();
    let mut before = State::before("check_small", &pile());
    let wanted = after_twin(twin("check_small"), &before);
    before.entries.iter_mut().for_each(|entry| *entry &= !(1 << AXIS_BITS));
    let before = with_capacity_for(&before, &wanted);
    let found = on_device(gpu(), twin("check_small"), &GpuOptions::DEFAULT, &before);
    let fault = compare_checks(&before, &found, &wanted).expect("pairs are missing");
    assert!(fault.starts_with("missing"), "{fault}");
}

//! The sort of plain pairs: counted by first box, grouped, ordered by counting or through a bitmap.

use super::*;

/// Returns the pairs of a case in a shuffled order, as a check leaves them, before a kernel of the sort. Some are marked.
pub(super) fn pairs_to_sort(kernel: &str, case: &Case) -> State {
    let pairs: Vec<_> = oracle::pairs(&case.boxes);
    unsorted(kernel, case.boxes.len() as u32, &pairs)
}

/// Returns the state before a kernel of the sort of these pairs.
fn unsorted(kernel: &str, boxes: u32, pairs: &[Pair]) -> State {
    let shuffled = (0..pairs.len()).map(|i| pairs[(i * 7919 + 13) % pairs.len()]);
    let mark = |i: usize| if i.is_multiple_of(3) { ENDED } else { 0 };
    let out: Vec<u32> = shuffled.enumerate().flat_map(|(i, pair)| [pair.a, pair.b | mark(i)]).collect();
    let count = pairs.len() as u32;
    let mut state = State {
        params: Params { boxes, pair_capacity: count, ..Params::default() },
        chunk: Chunk { word_capacity: 2 * count, ..Chunk::default() },
        sums: vec![0; boxes.div_ceil(COUNTS_PER_BLOCK) as usize],
        rows: vec![0; boxes as usize],
        grouped: vec![[0; 2]; pairs.len()],
        long_rows: vec![[0; 2]; pairs.len() / SHORT_ROW as usize + 1],
        out,
        ..State::default()
    };
    state.totals.words = halves(2 * u64::from(count));
    for name in ["arrange_rows", "count_pairs", "place_pairs", "rank_pairs"] {
        if name == kernel {
            return state;
        }
        (twin(name).run)(&mut state);
        if name == "count_pairs" {
            scan_rows(&mut state);
        }
    }
    state
}

/// Turns the counts of rows into ends within blocks, and the sums of the blocks before.
fn scan_rows(s: &mut State) {
    let mut all = 0;
    for (block, sum) in s.rows.chunks_mut(COUNTS_PER_BLOCK as usize).zip(&mut s.sums) {
        *sum = all;
        let mut within = 0;
        for count in block {
            within += *count;
            *count = within;
        }
        all += within;
    }
}

pub(super) fn by_found_pair(s: &State) -> u32 {
    found_pairs(s).div_ceil(LANES)
}

/// Returns a workgroup for each window: all of them do the first long row, then the next.
pub(super) fn by_window(s: &State) -> u32 {
    s.params.boxes.div_ceil(WINDOW)
}

fn found_pairs(s: &State) -> u32 {
    (wide(s.totals.words) / 2) as u32
}

fn pair_of_words(s: &State, i: usize) -> [u32; 2] {
    [s.out[2 * i], s.out[2 * i + 1]]
}

fn second(pair: &[u32; 2]) -> u32 {
    pair[1] & !ENDED
}

pub(super) fn arrange_rows(s: &mut State) {
    let pairs = found_pairs(s);
    let has_all =
        s.counters.small_items <= s.chunk.small_items && s.counters.large_items <= s.chunk.large_items;
    let fits = wide(s.totals.words) <= s.chunk.word_capacity.into() && pairs <= s.params.pair_capacity;
    let groups = if has_all && fits { pairs.div_ceil(LANES) } else { 0 };
    s.totals.sorted = u32::from(has_all && fits);
    s.dispatches[6..].copy_from_slice(&[groups.min(32_768), groups.div_ceil(32_768), 1]);
    s.long_dispatch = [s.params.boxes.div_ceil(WINDOW), 0, 1];
}

pub(super) fn count_pairs(s: &mut State) {
    for i in 0..found_pairs(s) as usize {
        s.rows[s.out[2 * i] as usize] += 1;
    }
}

/// Leaves the start of each row within its block.
pub(super) fn place_pairs(s: &mut State) {
    for i in 0..found_pairs(s) as usize {
        let pair = pair_of_words(s, i);
        let row = &mut s.rows[pair[0] as usize];
        *row -= 1;
        s.grouped[(*row + s.sums[(pair[0] / COUNTS_PER_BLOCK) as usize]) as usize] = pair;
    }
}

/// Orders short rows in `out`, and lists the long ones.
pub(super) fn rank_pairs(s: &mut State) {
    let mut start = 0;
    for row in s.grouped.clone().chunk_by(|a, b| a[0] == b[0]) {
        let end = start + row.len();
        if row.len() > SHORT_ROW as usize {
            s.long_rows[s.counters.long_rows as usize] = [start as u32, end as u32];
            s.counters.long_rows += 1;
            s.long_dispatch[1] = s.counters.long_rows;
        } else {
            write_row(&mut s.out[2 * start..2 * end], row);
        }
        start = end;
    }
}

pub(super) fn rank_long_rows(s: &mut State) {
    for [start, end] in s.long_rows[..s.counters.long_rows as usize].iter().map(|row| row.map(|x| x as usize))
    {
        write_row(&mut s.out[2 * start..2 * end], &s.grouped[start..end]);
    }
}

fn write_row(out: &mut [u32], row: &[[u32; 2]]) {
    let mut row = row.to_vec();
    row.sort_unstable_by_key(second);
    out.copy_from_slice(row.as_flattened());
}

pub(super) fn compare_row_dispatches(_: &State, found: &State, wanted: &State) -> Option<String> {
    same("dispatches", &found.dispatches[6..], &wanted.dispatches[6..])
        .or_else(|| same("long dispatch", &found.long_dispatch, &wanted.long_dispatch))
        .or_else(|| same("totals", &[found.totals], &[wanted.totals]))
}

pub(super) fn compare_rows(_: &State, found: &State, wanted: &State) -> Option<String> {
    same("rows", &found.rows, &wanted.rows)
}

/// Compares the pairs of each row, which may be in any order.
pub(super) fn compare_grouped(before: &State, found: &State, wanted: &State) -> Option<String> {
    let sorted_rows = |s: &State| {
        let mut rows = s.grouped.clone();
        rows.chunk_by_mut(|a, b| a[0] == b[0]).for_each(|row| row.sort_unstable());
        rows
    };
    compare_rows(before, found, wanted)
        .or_else(|| same("grouped pairs", &sorted_rows(found), &sorted_rows(wanted)))
}

pub(super) fn compare_ranked(before: &State, found: &State, wanted: &State) -> Option<String> {
    let long = |s: &State| sorted(&s.long_rows);
    compare_out(before, found, wanted)
        .or_else(|| same("long rows", &long(found), &long(wanted)))
        .or_else(|| same("long dispatch", &found.long_dispatch, &wanted.long_dispatch))
}

const KERNELS: [&str; 5] = ["arrange_rows", "count_pairs", "place_pairs", "rank_pairs", "rank_long_rows"];

#[test]
fn the_sort_agrees_with_its_twins() {
    for kernel in KERNELS {
        for case in cases() {
            let before = State::before(kernel, &case);
            assert_eq!(fault(twin(kernel), &GpuOptions::DEFAULT, &before), None, "{}", case.name);
        }
    }
}

/// Rows over several windows, as one box under a world has, and rows about as long as a short one may be.
#[test]
fn the_sort_agrees_with_its_twins_on_long_rows() {
    let boxes = 3 * WINDOW + 77;
    let ground = (1..boxes).map(|b| Pair::new(0, b));
    let second = (70_000..boxes).step_by(3).map(|b| Pair::new(5, b));
    let limit = (0..2).flat_map(|i| (0..SHORT_ROW + i).map(move |k| Pair::new(10 + i, 20 + k)));
    let pairs: Vec<_> = ground.chain(second).chain(limit).chain([Pair::new(boxes - 2, boxes - 1)]).collect();
    for kernel in KERNELS {
        let before = unsorted(kernel, boxes, &pairs);
        assert_eq!(fault(twin(kernel), &GpuOptions::DEFAULT, &before), None, "{kernel}");
    }
    let mut after = unsorted("rank_long_rows", boxes, &pairs);
    assert_eq!(after.counters.long_rows, 3);
    rank_long_rows(&mut after);
    let sorted_pairs: Vec<_> = after.out.chunks(2).map(|two| Pair::new(two[0], two[1] & !ENDED)).collect();
    assert_eq!(sorted_pairs, sorted(&pairs));
}

#[test]
fn arrange_rows_leaves_the_sort_to_the_host_without_room() {
    let pairs: Vec<_> = (1..900).map(|b| Pair::new(0, b)).collect();
    let lacks: [fn(&mut State); 4] = [
        |s| s.chunk.word_capacity -= 1,
        |s| s.params.pair_capacity -= 1,
        |s| s.counters.small_items = s.chunk.small_items + 1,
        |s| s.totals.words[1] = 1,
    ];
    for (i, lack) in lacks.into_iter().enumerate() {
        let mut before = unsorted("arrange_rows", 900, &pairs);
        assert_eq!(after_twin(twin("arrange_rows"), &before).totals.sorted, 1);
        lack(&mut before);
        assert_eq!(after_twin(twin("arrange_rows"), &before).totals.sorted, 0, "lack {i}");
        assert_eq!(fault(twin("arrange_rows"), &GpuOptions::DEFAULT, &before), None, "lack {i}");
    }
}

#[test]
fn faults_planted_in_the_sort_are_noticed() {
    let faults: [(&str, Plant); 6] = [
        ("arrange_rows", |s| s.totals.sorted ^= 1),
        ("count_pairs", |s| s.rows[3] += 1),
        ("place_pairs", |s| s.grouped[9][1] ^= ENDED),
        ("rank_pairs", |s| s.out.swap(1, 3)),
        ("rank_pairs", |s| s.long_rows[0][1] += 1),
        ("rank_long_rows", |s| s.out[0] ^= 1),
    ];
    for (i, (kernel, plant)) in faults.into_iter().enumerate() {
        let before = State::before(kernel, &pile());
        let wanted = after_twin(twin(kernel), &before);
        let mut found = wanted.clone();
        assert_eq!((twin(kernel).compare)(&before, &found, &wanted), None, "{kernel}");
        plant(&mut found);
        assert!((twin(kernel).compare)(&before, &found, &wanted).is_some(), "fault {i}, {kernel}");
    }
}

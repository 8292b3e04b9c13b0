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
        long_rows: vec![0; (FIRST_PIECE + 3 * (count / SHORT_ROW + 1)) as usize],
        windows: vec![0; ((count / SHORT_ROW + 1) * boxes.div_ceil(WINDOW)) as usize],
        out,
        ..State::default()
    };
    state.totals.words = halves(2 * u64::from(count));
    for name in SORT {
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

pub(super) fn by_piece(s: &State) -> u32 {
    s.long_rows[PIECES as usize]
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
    s.long_rows[..FIRST_PIECE as usize].copy_from_slice(&[0, 0, 1, 0]);
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

/// Orders short rows in `out`. Counts the pairs of long rows by window, and lists the pieces of these rows.
pub(super) fn rank_pairs(s: &mut State) {
    let mut start = 0;
    for row in s.grouped.clone().chunk_by(|a, b| a[0] == b[0]) {
        let end = start + row.len();
        if row.len() > SHORT_ROW as usize {
            for pair in row {
                *counter(s, start, second(pair)) += 1;
            }
            (0..row.len().div_ceil(PIECE as usize)).for_each(|piece| add_piece(s, [start, end, piece]));
        } else {
            write_row(&mut s.out[2 * start..2 * end], row);
        }
        start = end;
    }
}

fn add_piece(s: &mut State, piece: [usize; 3]) {
    let index = s.long_rows[PIECES as usize];
    let at = (FIRST_PIECE + 3 * index) as usize;
    s.long_rows[at..at + 3].copy_from_slice(&piece.map(|x| x as u32));
    s.long_rows[..FIRST_PIECE as usize].copy_from_slice(&[
        (index + 1).min(32_768),
        index / 32_768 + 1,
        1,
        index + 1,
    ]);
}

/// Returns the counter of a second box in a long row.
fn counter(s: &mut State, start: usize, second: u32) -> &mut u32 {
    let row = start as u32 / SHORT_ROW * s.params.boxes.div_ceil(WINDOW);
    &mut s.windows[(row + second / WINDOW) as usize]
}

/// Returns the start and the end of each long row.
fn long_rows(s: &State) -> Vec<[usize; 2]> {
    let pieces = pieces(s).into_iter().filter(|piece| piece[2] == 0);
    pieces.map(|[start, end, _]| [start as usize, end as usize]).collect()
}

/// Returns the pieces of long rows, sorted: start and end of the row, and index of the piece.
fn pieces(s: &State) -> Vec<[u32; 3]> {
    let listed = s.long_rows[FIRST_PIECE as usize..].as_chunks::<3>().0;
    sorted(&listed[..s.long_rows[PIECES as usize] as usize])
}

/// Orders long rows by window. Writes only the second boxes.
pub(super) fn place_windows(s: &mut State) {
    for [start, end] in long_rows(s) {
        let mut row = s.grouped[start..end].to_vec();
        row.sort_by_key(|pair| second(pair) / WINDOW);
        for (i, pair) in (start..).zip(&row) {
            s.out[2 * i + 1] = pair[1];
            *counter(s, start, second(pair)) += 1 << 16;
        }
    }
}

pub(super) fn rank_windows(s: &mut State) {
    for [start, end] in long_rows(s) {
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
        .or_else(|| same("long rows", &found.long_rows, &wanted.long_rows))
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
    let head = FIRST_PIECE as usize;
    compare_out(before, found, wanted)
        .or_else(|| same("dispatch", &found.long_rows[..head], &wanted.long_rows[..head]))
        .or_else(|| same("pieces", &pieces(found), &pieces(wanted)))
        .or_else(|| same("windows", &found.windows, &wanted.windows))
}

/// Compares the pairs of each window, which may be in any order.
pub(super) fn compare_windows(_: &State, found: &State, wanted: &State) -> Option<String> {
    let by_window = |s: &State| {
        let mut out = s.out.as_chunks::<2>().0.to_vec();
        for [start, end] in long_rows(s) {
            let windows = out[start..end].chunk_by_mut(|a, b| second(a) / WINDOW == second(b) / WINDOW);
            windows.for_each(|window| window.sort_unstable_by_key(|pair| pair[1]));
        }
        // The first boxes are not written: sorted by the second ones they lie elsewhere.
        out.iter().map(|pair| pair[1]).collect::<Vec<_>>()
    };
    same("second boxes", &by_window(found), &by_window(wanted))
        .or_else(|| same("windows", &found.windows, &wanted.windows))
}

/// The kernels of the sort, in the order in which they run.
pub(super) const SORT: [&str; 6] =
    ["arrange_rows", "count_pairs", "place_pairs", "rank_pairs", "place_windows", "rank_windows"];

#[test]
fn the_sort_agrees_with_its_twins() {
    for kernel in SORT {
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
    for kernel in SORT {
        let before = unsorted(kernel, boxes, &pairs);
        assert_eq!(fault(twin(kernel), &GpuOptions::DEFAULT, &before), None, "{kernel}");
    }
    let mut after = unsorted("rank_windows", boxes, &pairs);
    assert_eq!(long_rows(&after).len(), 3);
    rank_windows(&mut after);
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
    let faults: [(&str, Plant); 9] = [
        ("arrange_rows", |s| s.totals.sorted ^= 1),
        ("count_pairs", |s| s.rows[3] += 1),
        ("place_pairs", |s| s.grouped[9][1] ^= ENDED),
        ("rank_pairs", |s| s.out.swap(1, 3)),
        ("rank_pairs", |s| s.long_rows[PIECES as usize] += 1),
        ("rank_pairs", |s| s.windows[0] += 1),
        ("place_windows", |s| s.windows[0] += 1),
        ("place_windows", |s| s.out[1] ^= ENDED),
        ("rank_windows", |s| s.out[0] ^= 1),
    ];
    are_noticed(&faults, &pile());
}

/// Returns the pairs of `grounds` large boxes, which every `step`-th other one touches, before a kernel of the sort.
fn grounds(kernel: &str, boxes: u32, grounds: u32, step: usize) -> State {
    let on = |b: u32| (0..grounds).map(move |ground| Pair::new(ground, b));
    let pairs: Vec<_> = (grounds..boxes).step_by(step).flat_map(on).collect();
    unsorted(kernel, boxes, &pairs)
}

/// The texts count operations instead of pairs.
#[test]
fn a_ground_costs_its_counter_one_operation_a_workgroup() {
    needs_gpu!();
    let (amount, rows) = ("atomicLoad(&followers[lane])", |s: &State| s.rows.iter().sum::<u32>());
    for count in [1, 3] {
        let before = grounds("count_pairs", 20_000, count, 1);
        let most = count * by_found_pair(&before);
        let operations = rows(&counting("count_pairs", &[[amount, "1u"]], &before));
        assert!(operations > 0 && operations <= most, "count: {operations} of {most}");
        let alone = ["select(lane, claimed, keys[claimed] == key)", "lane"];
        let operations = rows(&counting("count_pairs", &[[amount, "1u"], alone], &before));
        assert_eq!(operations, found_pairs(&before), "without leaders");
        // The rows are in ends within their blocks: only those of the grounds go down.
        let before = grounds("place_pairs", 20_000, count, 1);
        let operations = rows(&before) - rows(&counting("place_pairs", &[[amount, "1u"]], &before));
        assert!(operations > 0 && operations <= most, "place: {operations} of {most}");
    }
}

/// One ground under ten million boxes has 306 windows.
#[test]
fn a_pair_of_a_long_row_is_read_a_few_times() {
    needs_gpu!();
    let note = "atomicAdd(&windows[arrayLength(&windows) - 1u], 1u);";
    for (kernel, read, most) in [
        ("place_windows", "return grouped[2u * i + 1u];", 4),
        ("rank_windows", "let word = out[2u * i + 1u];", 1),
    ] {
        let mut before = grounds(kernel, 10_000_000, 1, 50);
        before.windows.push(0);
        let after = counting(kernel, &[[read, &format!("{note} {read}")]], &before);
        let (reads, pairs) = (after.windows.last().expect("one was pushed"), found_pairs(&before));
        assert!((pairs..=most * pairs).contains(reads), "{kernel}: {reads} reads of {pairs} pairs");
    }
}

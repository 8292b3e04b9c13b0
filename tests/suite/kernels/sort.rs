//! The sort of plain pairs: counted by first box, grouped, ordered by counting or through a bitmap. Its kernels have no twins:
//! together they must leave the pairs in order.

use super::*;

/// A kernel with its number of workgroups.
type Run = (&'static Kernel, fn(&State) -> u32);

/// The kernels of the sort in the order in which they run.
pub(super) static SORT: [Run; 5] = [
    (&shaders::COUNT_PAIRS, by_found_pair),
    (&shaders::PLACE_PAIRS, by_found_pair),
    (&shaders::RANK_PAIRS, by_found_pair),
    (&shaders::PLACE_WINDOWS, by_piece),
    (&shaders::RANK_WINDOWS, by_piece),
];

fn by_found_pair(s: &State) -> u32 {
    found_pairs(s).div_ceil(LANES)
}

fn by_piece(s: &State) -> u32 {
    s.long_rows[PIECES as usize]
}

fn found_pairs(s: &State) -> u32 {
    (wide(s.totals.words) / 2) as u32
}

/// Returns the state after a check that has found these pairs: in a shuffled order.
fn unsorted(boxes: u32, pairs: &[Pair]) -> State {
    let shuffled = (0..pairs.len()).map(|i| pairs[(i * 7919 + 13) % pairs.len()]);
    let out: Vec<u32> = shuffled.flat_map(|pair| [pair.a, pair.b]).collect();
    let count = pairs.len() as u32;
    let mut state = State {
        params: Params { boxes, ..Params::default() },
        sums: vec![0; boxes.div_ceil(COUNTS_PER_BLOCK) as usize],
        rows: vec![0; boxes as usize],
        grouped: vec![[0; 2]; pairs.len()],
        long_rows: [vec![0, 0, 1], vec![0; (FIRST_PIECE - 3 + 3 * (count / SHORT_ROW + 1)) as usize]]
            .concat(),
        windows: vec![0; ((count / SHORT_ROW + 1) * boxes.div_ceil(WINDOW)) as usize],
        out,
        ..State::default()
    };
    state.totals.words = halves(2 * u64::from(count));
    state
}

/// Runs the kernels of the sort on the device, up to the one of this name.
fn run_before(name: &str, state: State) -> State {
    run_edited(name, state, &[])
}

/// Does the same as [`run_before`], with edits of the texts of some kernels.
fn run_edited(name: &str, mut state: State, edits: &[(&str, [&str; 2])]) -> State {
    for (kernel, groups) in SORT.iter().take_while(|(kernel, _)| kernel.name != name) {
        let own = edits.iter().filter(|(of, _)| *of == kernel.name).map(|(_, edit)| *edit);
        let text = edited(kernel, &own.collect::<Vec<_>>());
        state = run_text(gpu(), kernel, *groups, &text, &GpuOptions::DEFAULT, &state);
        if kernel.name == "count_pairs" {
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

/// Sorts these pairs on the device, with edits of kernels. Returns the first fault, and the number of pieces of long rows.
fn sort(boxes: u32, pairs: &[Pair], edits: &[(&str, [&str; 2])]) -> (Option<String>, u32) {
    let before = unsorted(boxes, pairs);
    let mut wanted = before.out.as_chunks::<2>().0.to_vec();
    wanted.sort_unstable();
    let after = run_edited("none", before, edits);
    let pieces = by_piece(&after);
    let groups = [pieces.min(GROUPS_PER_ROW), pieces.div_ceil(GROUPS_PER_ROW), 1];
    let fault = same("pairs", after.out.as_chunks::<2>().0, &wanted)
        .or_else(|| same("workgroups", &after.long_rows[..3], &groups));
    (fault, pieces)
}

/// Asserts that the device sorts these pairs, and returns the number of pieces of long rows.
fn assert_sorts(what: &str, boxes: u32, pairs: &[Pair]) -> u32 {
    let (fault, pieces) = sort(boxes, pairs, &[]);
    assert_eq!(fault, None, "{what}");
    pieces
}

#[test]
fn the_sort_orders_the_pairs_of_every_set() {
    needs_gpu!();
    for case in cases() {
        assert_sorts(case.name, case.boxes.len() as u32, &oracle::pairs(&case.boxes));
    }
}

/// Rows over several windows, as one box under a world has, and rows about as long as a short one may be.
#[test]
fn the_sort_orders_long_rows() {
    needs_gpu!();
    let boxes = 3 * WINDOW + 77;
    let ground = (1..boxes).map(|b| Pair::new(0, b));
    let second = (70_000..boxes).step_by(3).map(|b| Pair::new(5, b));
    let limit = (0..2).flat_map(|i| (0..SHORT_ROW + i).map(move |k| Pair::new(10 + i, 20 + k)));
    let pairs: Vec<_> = ground.chain(second).chain(limit).chain([Pair::new(boxes - 2, boxes - 1)]).collect();
    let pieces = [boxes - 1, (boxes - 70_000).div_ceil(3), SHORT_ROW + 1].map(|row| row.div_ceil(PIECE));
    assert_eq!(assert_sorts("long rows", boxes, &pairs), pieces.iter().sum::<u32>());
}

/// A comparison that never finds a fault would pass the tests above.
#[test]
fn faults_planted_in_the_sort_are_noticed() {
    needs_gpu!();
    // A long row, and a short one.
    let pairs: Vec<_> = (1..900).map(|b| Pair::new(0, b)).chain((2..90).map(|b| Pair::new(1, b))).collect();
    let swapped = ["out[2u * at", "out[2u * (at ^ 1u)"];
    for (kernel, edit, words) in [
        ("rank_pairs", swapped, "pairs: "),
        ("rank_windows", swapped, "pairs: "),
        ("rank_pairs", ["min(piece + 1u", "min(piece + 2u"], "workgroups: "),
    ] {
        let (fault, _) = sort(900, &pairs, &[(kernel, edit)]);
        assert!(
            fault.as_ref().is_some_and(|fault| fault.starts_with(words)),
            "{kernel}, {edit:?}: {fault:?}"
        );
    }
}

/// Returns the pairs of `grounds` large boxes, which every `step`-th other one touches, before a kernel of the sort.
fn grounds(kernel: &str, boxes: u32, grounds: u32, step: usize) -> State {
    let on = |b: u32| (0..grounds).map(move |ground| Pair::new(ground, b));
    let pairs: Vec<_> = (grounds..boxes).step_by(step).flat_map(on).collect();
    run_before(kernel, unsorted(boxes, &pairs))
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
        ("rank_windows", "let bit = out[2u * i + 1u]", 1),
    ] {
        let mut before = grounds(kernel, 10_000_000, 1, 50);
        before.windows.push(0);
        let after = counting(kernel, &[[read, &format!("{note} {read}")]], &before);
        let (reads, pairs) = (after.windows.last().expect("one was pushed"), found_pairs(&before));
        assert!((pairs..=most * pairs).contains(reads), "{kernel}: {reads} reads of {pairs} pairs");
    }
}

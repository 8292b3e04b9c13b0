//! Comparisons of two states. Each returns the first difference in words.

use super::*;

pub(super) fn same<T: PartialEq + Debug>(what: &str, found: &[T], wanted: &[T]) -> Option<String> {
    if found.len() != wanted.len() {
        return Some(format!("{} {what}, not {}", found.len(), wanted.len()));
    }
    let at = (0..found.len()).find(|&i| found[i] != wanted[i])?;
    Some(format!("{what}: {:?} instead of {:?} at {at}", found[at], wanted[at]))
}

pub(super) fn sorted<T: Ord + Clone>(list: &[T]) -> Vec<T> {
    let mut list = list.to_vec();
    list.sort_unstable();
    list
}

pub(super) fn compare_schedules(_: &State, found: &State, wanted: &State) -> Option<String> {
    same("counters", &[found.counters], &[wanted.counters])
        .or_else(|| same("slots", &sorted(&found.slots), &sorted(&wanted.slots)))
        .or_else(|| same("small items", &resolved(found), &resolved(wanted)))
        .or_else(|| same("large items", &sorted(&found.large_items), &sorted(&wanted.large_items)))
}

/// Returns the small items with the slots that they reach into, because the device chooses the places of slots.
pub(super) fn resolved(s: &State) -> Vec<(Vec<Slot>, u32, u32)> {
    let slots = |item: &SmallItem| taken(&s.slots, item.slot, item.slots).to_vec();
    let items = s.small_items.iter().map(|item| (slots(item), item.first_pair, item.pairs));
    sorted(&items.collect::<Vec<_>>())
}

/// Compares summaries. A device may take denormal extents for 0, as SwiftShader does: extents decide only the cells.
pub(super) fn compare_summaries(_: &State, found: &State, wanted: &State) -> Option<String> {
    let is_extent = |i: usize| !i.is_multiple_of(4) && i < CLASS_WORDS as usize;
    let flush = |(i, &word): (usize, &u32)| {
        if is_extent(i) && word < f32::MIN_POSITIVE.to_bits() { 0 } else { word }
    };
    let flushed = |s: &State| -> Vec<u32> { s.summary.iter().enumerate().map(flush).collect() };
    same("summary", &flushed(found), &flushed(wanted))
}

/// Compares the entries of each cell: first its residents, then its visitors, each in any order.
pub(super) fn compare_entries(before: &State, found: &State, wanted: &State) -> Option<String> {
    let cell_fault = |cell: usize| {
        let (start, middle, end) =
            (before.start_of(cell), before.end_at(2 * cell), before.end_at(2 * cell + 1));
        let part = |s: &State, from: u32, to: u32| sorted(&s.entries[from as usize..to as usize]);
        let parts = [("residents", start, middle), ("visitors", middle, end)];
        let fault = |(what, from, to)| same(what, &part(found, from, to), &part(wanted, from, to));
        parts.into_iter().find_map(fault)
    };
    same("cells", &found.cells, &wanted.cells).or_else(|| (0..before.cells.len()).find_map(cell_fault))
}

/// Returns the pairs in `out`, sorted.
pub(super) fn pairs_of(s: &State) -> Result<Vec<Pair>, String> {
    let words = s.out.get(..wide(s.totals.words) as usize).ok_or("words beyond the end")?;
    let pair = |words: &[u32; 2]| (words[0] < words[1]).then(|| Pair::new(words[0], words[1]));
    let pairs: Option<Vec<Pair>> = words.as_chunks().0.iter().map(pair).collect();
    pairs.map(|pairs| sorted(&pairs)).ok_or("a pair that is not a < b".to_owned())
}

pub(super) fn compare_checks(_: &State, found: &State, wanted: &State) -> Option<String> {
    let pairs = match pairs_of(found) {
        Ok(pairs) => pairs,
        Err(error) => return Some(error),
    };
    difference(&pairs, &pairs_of(wanted).expect("a twin writes pairs"))
        .or_else(|| same("counts", &counts(found), &counts(wanted)))
}

/// Returns the numbers of words, tests, redundant tests and overlaps.
pub(super) fn counts(s: &State) -> [u64; 4] {
    [s.totals.words, s.totals.made, s.totals.redundant, s.totals.overlaps].map(wide)
}

pub(super) fn compare_indices(_: &State, found: &State, wanted: &State) -> Option<String> {
    let pairs = |s: &State| -> Vec<[u32; 2]> { s.out.chunks_exact(3).map(|c| [c[1], c[2]]).collect() };
    same("pairs", &pairs(found), &pairs(wanted))
}

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

/// Returns pairs as words, in the simplest way that the format allows.
pub(super) fn encoded(s: &State, pairs: &[Pair]) -> Vec<u32> {
    let n = u64::from(s.params.boxes);
    if s.has(BITS) {
        let mut words = vec![0; pair_count(n).div_ceil(32).next_multiple_of(8) as usize];
        for pair in pairs {
            let k = index_of(pair.a.into(), pair.b.into(), n) as usize;
            words[k / 32] |= 1 << (k % 32);
        }
        return words;
    }
    let mark = (s.has(PACKED) && !pairs.is_empty()).then_some(PLAIN | pairs.len() as u32);
    mark.into_iter().chain(pairs.iter().flat_map(|pair| [pair.a, pair.b])).collect()
}

/// Returns the pairs in `out`, sorted.
pub(super) fn decoded(s: &State) -> Result<Vec<Pair>, String> {
    let n = s.params.boxes;
    let counted = if s.has(BITS) { pair_count(n.into()).div_ceil(32) } else { wide(s.totals.words) };
    let words = s.out.get(..counted as usize).ok_or(format!("{counted} words in {}", s.out.len()))?;
    let (mut pairs, ids) = (PairList::default(), BoxIds::First(n));
    let result = if s.has(BITS) {
        decode::bits(words, ids, &mut pairs)
    } else if s.has(PACKED) {
        decode::records(words, &s.entries, ids, &mut pairs)
    } else {
        decode::plain(words, ids, false, &mut pairs)
    };
    result.map(|()| sorted(&pairs)).map_err(|error| error.to_string())
}

pub(super) fn compare_checks(_: &State, found: &State, wanted: &State) -> Option<String> {
    let pairs = match decoded(found) {
        Ok(pairs) => pairs,
        Err(error) => return Some(error),
    };
    difference(&pairs, &decoded(wanted).expect("a twin writes what can be read"))
        .or_else(|| same("counts", &counts(found), &counts(wanted)))
        .or_else(|| words_fault(found, wanted))
}

/// Returns the numbers of pairs, tests, redundant tests and overlaps.
pub(super) fn counts(s: &State) -> [u64; 4] {
    [s.totals.pairs, s.totals.made, s.totals.redundant, s.totals.overlaps].map(wide)
}

/// Compares the numbers of words. Records take at most as many as marked plain pairs of one workgroup each.
pub(super) fn words_fault(found: &State, wanted: &State) -> Option<String> {
    let (words, plain) = (wide(found.totals.words), wide(wanted.totals.words));
    let right = if found.has(PACKED) { words <= 3 * hits(wanted) } else { words == plain };
    (!right).then(|| format!("{words} words, {plain} if plain"))
}

/// Returns the number of pairs that a check has found.
pub(super) fn hits(s: &State) -> u64 {
    if s.has(PACKED | BITS) {
        wide(s.totals.pairs).saturating_sub(wide(NEARLY))
    } else {
        wide(s.totals.words) / 2
    }
}

pub(super) fn compare_indices(_: &State, found: &State, wanted: &State) -> Option<String> {
    let pairs = |s: &State| -> Vec<[u32; 2]> { s.out.chunks_exact(3).map(|c| [c[1], c[2]]).collect() };
    same("pairs", &pairs(found), &pairs(wanted))
}

//! Avril's table 2: from the index of a pair to the pair, with a root and by the lazy way (3.2.2).

use super::printed::AVRIL_2;
use super::sides::Setup;
use crate::index::{as_it_is, lazy_ids, lazy_pair, row_by, row_in_f64, rules};
use pbig_core::Aabb;
use pbig_harness::pair_index::pair_count;
use pbig_harness::prelude::*;
use std::ops::Range;
use std::time::Duration;

/// Ids looked at in one measurement; where there are more, stretches of them, spread evenly.
const MOST_IDS: u64 = 100_000_000;

/// Returns stretches of `0..ids` of at most `most` in all, and how many times as many ids there are.
fn stretches(ids: u64, most: u64) -> (Vec<Range<u64>>, f64) {
    const STRETCHES: u64 = 1000;
    if ids <= most {
        return (std::iter::once(0..ids).collect(), 1.0);
    }
    let length = most / STRETCHES;
    let begin = |i: u64| i * (ids - length) / (STRETCHES - 1);
    let all = (0..STRETCHES).map(|i| begin(i)..begin(i) + length).collect();
    (all, ids as f64 / (STRETCHES * length) as f64)
}

/// Ids whose pairs are made before they are tested.
const BLOCK: u64 = 1024;

/// Counts overlapping pairs among the ids. Inlined, so that `pair` is not a function call.
#[inline(always)]
fn overlaps(boxes: &[Aabb], ids: &[Range<u64>], pair: impl Fn(i64, i64) -> Option<(i64, i64)>) -> u64 {
    let (n, mut block, mut found) = (boxes.len() as i64, Vec::new(), 0);
    for ids in ids {
        for first in ids.clone().step_by(BLOCK as usize) {
            let ids = first..ids.end.min(first + BLOCK);
            block.clear();
            block.extend(ids.filter_map(|id| pair(id as i64, n)));
            found += hits(boxes, &block);
        }
    }
    found
}

/// One code for all ways. In their loops it would be another in each, and differ by more than the ways do.
#[inline(never)]
fn hits(boxes: &[Aabb], pairs: &[(i64, i64)]) -> u64 {
    let hit = |(a, b): &&(i64, i64)| boxes[*a as usize].overlaps(&boxes[*b as usize]);
    pairs.iter().filter(hit).count() as u64
}

type CountOverlaps = fn(&[Aabb], &[Range<u64>]) -> u64;

/// Ways with a root that give every pair of table 2's objects, and the lazy way, which looks at all of n^2 - n identifiers.
const WAYS: [(&str, CountOverlaps); 3] = [
    ("f32 root, the paper's rules", |boxes, ids| {
        overlaps(boxes, ids, |k, n| Some(rules(row_by(f32::sqrt)(k, n), k, n)))
    }),
    ("f64 root, as it is", |boxes, ids| overlaps(boxes, ids, |k, n| Some(as_it_is(row_in_f64(k, n), k, n)))),
    ("lazy", |boxes, ids| overlaps(boxes, ids, lazy_pair)),
];

/// The place of the lazy way.
const LAZY: usize = 2;

/// Calls of each way. Each way runs once at each place of a round.
const EFFORT: Effort = Effort { warm_up: 0, rounds: WAYS.len(), budget: Duration::MAX };

/// The pairs of each way, its milliseconds for all ids, and for roots and for the lazy way all ids over those looked at.
type WaysFound = ([u64; WAYS.len()], Vec<f64>, [f64; 2]);

fn unit_cubes(n: usize) -> Vec<Aabb> {
    BoxSet::named("unit").expect("a set of the harness").boxes(n, 1)
}

/// Measures all ways. Fails if ways that looked at the same pairs have not found the same.
fn all_ways(n: u64, most: u64) -> Result<WaysFound, Failure> {
    let boxes = unit_cubes(n as usize);
    let ids = [pair_count(n), lazy_ids(n as i64) as u64].map(|ids| stretches(ids, most));
    let mut pairs = [0; WAYS.len()];
    let ms = medians(&mut pairs, WAYS.len(), EFFORT, unprepared, |pairs, way| {
        let (ids, times) = &ids[usize::from(way == LAZY)];
        let (found, ms) = timed(|| WAYS[way].1(&boxes, ids));
        pairs[way] = found;
        Ok(ms * times)
    })?;
    let times = ids.map(|(_, times)| times);
    // The lazy way has ids of its own, so it can be held against roots only where it looks at all.
    let comparable = if times[1] == 1.0 { &pairs[..] } else { &pairs[..LAZY] };
    let is_equal = comparable.iter().all(|found| *found == pairs[0]);
    check(is_equal, || format!("{n} objects: ways found {pairs:?} pairs")).map(|()| (pairs, ms, times))
}

/// Table 2 on one thread: cubes with a pair each.
pub(super) fn tables(setup: &Setup) -> Result<Vec<Table>, Failure> {
    let names = |before: &str, ways: &[(&str, CountOverlaps)]| -> String {
        ways.iter().map(|(name, _)| format!("{before}{name} | ")).collect()
    };
    let columns = format!(
        "objects | ms printed, root | ms printed, lazy | lazy / root printed | {}{}\
         pairs | ids looked at, roots, % | ids looked at, lazy, %",
        names("ms, ", &WAYS),
        names("lazy / ", &WAYS[..LAZY])
    );
    let mut table = Table::new("Avril table 2: the lazy way, CPU", &columns);
    let most = if setup.quick { MOST_IDS / 10 } else { MOST_IDS };
    for (n, root, lazy) in AVRIL_2 {
        let (pairs, ms, times) = all_ways(n, most)?;
        let ratios = ms[..LAZY].iter().map(|root| ms[LAZY] / root);
        let pairs = (times[1] == 1.0).then_some(pairs[LAZY]);
        let looked_at = times.map(|times| 100.0 / times);
        table.row(cells![n, root, lazy, lazy / root, ..ms.clone(), ..ratios, pairs, ..looked_at]);
    }
    Ok(vec![table, rows_on_device(setup)?])
}

/// Indices that a device maps at a time, 12 bytes each.
const INDICES: u32 = 1 << 22;

/// Equation 1 on a device, for every index: the paper's rules mend a row that is off by one, pbig's integers any row.
fn rows_on_device(setup: &Setup) -> Result<Table, Failure> {
    let columns = "objects | indices | rows off by one | rows off by more";
    let mut table = Table::new("Avril equation 1: every index, GPU", columns);
    let sizes: &[u32] = if setup.quick { &[100, 2000] } else { &[100, 1000, 5000, 10_000, 32_768] };
    for &n in sizes {
        let Some(gpu) = setup.for_boxes(n as usize) else { continue };
        let (indices, mut off) = (pair_count(n.into()) as u32, [0u64; 3]);
        let mut wanted = (0..n).flat_map(|a| (a + 1..n).map(move |b| [a, b]));
        for first in (0..indices).step_by(INDICES as usize) {
            let found = gpu.index_pairs(n, first, INDICES.min(indices - first));
            for [estimate, a, b] in found.map_err(|error| error.to_string())? {
                let pair = wanted.next().expect("as many pairs as indices");
                match estimate.abs_diff(pair[0]) {
                    0 => {}
                    1 => off[0] += 1,
                    _ => off[1] += 1,
                }
                off[2] += u64::from([a, b] != pair);
            }
        }
        check(off[2] == 0, || format!("{} of {indices} indices lead to wrong pairs of {n}", off[2]))?;
        table.row(cells![n, indices, off[0], off[1]]);
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn all_ways_find_the_pairs_of_brute_force() {
        let pairs = oracle::pairs(&unit_cubes(300)).len() as u64;
        let (found, _, times) = all_ways(300, MOST_IDS).expect("all agree");
        assert_eq!((found, times), ([pairs; WAYS.len()], [1.0; 2]));
        // In stretches, which end within a block.
        assert!(all_ways(300, 30_000).is_ok_and(|(pairs, _, times)| pairs[0] > 0 && times[0] > 1.0));
        let (some, times) = stretches(1_000_000, 10_000);
        assert_eq!((some[0].clone(), some[999].clone(), times), (0..10, 999_990..1_000_000, 100.0));
    }
}

//! Avril's table 2 and the times of table 4: from the index of a pair to the pair, with a root and by the lazy way (3.2.2).

use super::device::{Device, kernels, on_gpu, same_pairs};
use super::printed::AVRIL_2;
use super::{Scale, UNSORTED, once};
use crate::index::{AsItIs, Correction, Double, Root, Rules, Single, lazy_ids, lazy_pair};
use crate::study::{PbigSettings, SETTINGS, with_gpu_grid};
use pbig_core::{Aabb, GpuOptions};
use pbig_harness::bench::timed;
use pbig_harness::boxes::cubes;
use pbig_harness::cells;
use pbig_harness::output::Failure;
use pbig_harness::pair_index::{pair_count, pair_of};
use pbig_harness::table::Table;
use std::ops::Range;

pub(super) fn tables(scale: &Scale, device: &Device) -> Result<Vec<Table>, Failure> {
    Ok(vec![on_cpu(scale)?, on_device(device)?, in_cells(device)?])
}

/// Ids looked at in one measurement; where there are more, stretches of them, spread evenly.
const MOST_IDS: u64 = 100_000_000;

/// Returns stretches of `0..ids` of at most `most` in all, and how many times as many there are.
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

/// Counts overlapping pairs among the ids. In the caller, so that the way to a pair is no call.
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

/// A root as in the study of accuracy, where all are held against each other.
#[inline(always)]
fn by_root<R: Root, C: Correction>(k: i64, n: i64) -> Option<(i64, i64)> {
    let m = 2 * n - 1;
    Some(C::pair(R::row(m, m * m - 8 * k), k, n))
}

/// Pbig's own, for up to 2^32 boxes: it multiplies in 128 bits.
#[inline(always)]
fn by_pair_of(k: i64, n: i64) -> Option<(i64, i64)> {
    let (a, b) = pair_of(k as u64, n as u64);
    Some((a as i64, b as i64))
}

type Search = fn(&[Aabb], &[Range<u64>]) -> u64;

/// Ways with a root that give every pair of table 2's objects, and the lazy way, which looks at all of n^2 - n identifiers.
const WAYS: [(&str, Search); 4] = [
    ("f32 root, the paper's rules", |boxes, ids| overlaps(boxes, ids, by_root::<Single, Rules>)),
    ("f64 root, as it is", |boxes, ids| overlaps(boxes, ids, by_root::<Double, AsItIs>)),
    ("`pair_of`", |boxes, ids| overlaps(boxes, ids, by_pair_of)),
    ("lazy", |boxes, ids| overlaps(boxes, ids, lazy_pair)),
];

/// Calls of each way, in turn. Two ways that take as long have all calls of one before all of the other in 3% of cases.
const CALLS: usize = 4;

/// Pairs that a way found, the shortest and the longest of its calls for all ids, and all ids over those looked at.
type Took = (u64, [f64; 2], f64);

/// Measures all ways. A failed check, if ways that looked at the same pairs have not found the same.
fn all_ways(n: u64, most: u64) -> Result<[Took; 4], Failure> {
    let boxes = cubes(n as usize, 1.0, 1.0, 1);
    let mut all = [(0, [f64::MAX, 0.0], 1.0); 4];
    for (way, _) in (0..CALLS * WAYS.len()).map(|i| (i % WAYS.len(), i)) {
        let ids = if way == 3 { lazy_ids(n as i64) as u64 } else { pair_count(n) };
        let (ids, times) = stretches(ids, most);
        let (found, ms) = timed(|| WAYS[way].1(&boxes, &ids));
        let [least, longest] = all[way].1;
        all[way] = (found, [least.min(ms * times), longest.max(ms * times)], times);
    }
    // The lazy way has ids of its own, so it can be held against roots only where it looks at all.
    let is_other = |(way, took): (usize, &Took)| took.0 != all[0].0 && (way < 3 || took.2 == 1.0);
    match all.iter().enumerate().find(|&one| is_other(one)) {
        Some((way, took)) => {
            let what = format!("{n} objects: {} pairs with {}, not {}", took.0, WAYS[way].0, all[0].0);
            Err(Failure::Check(what))
        }
        None => Ok(all),
    }
}

/// Table 2 on one thread: cubes with a pair each. Times are those of the shortest call.
fn on_cpu(scale: &Scale) -> Result<Table, Failure> {
    let head = ["objects", "ms printed, root", "ms printed, lazy", "lazy / root printed"].map(str::to_owned);
    let times = WAYS.iter().map(|(name, _)| format!("ms, {name}"));
    let longest = WAYS.iter().map(|(name, _)| format!("longest call, ms, {name}"));
    let ratios = WAYS[..3].iter().map(|(name, _)| format!("lazy / {name}"));
    let looked_at = ["pairs", "ids looked at, roots, %", "ids looked at, lazy, %"].map(str::to_owned);
    let columns = head.into_iter().chain(times).chain(longest).chain(ratios).chain(looked_at);
    let mut table = Table::new("Avril table 2: the lazy way, CPU", columns);
    let most = if scale.quick { MOST_IDS / 10 } else { MOST_IDS };
    for (n, root, lazy) in AVRIL_2 {
        let all = all_ways(n, most)?;
        let mut row = cells![n, root, lazy, lazy / root];
        row.extend(all.iter().map(|took| took.1[0].into()));
        row.extend(all.iter().map(|took| took.1[1].into()));
        row.extend(all[..3].iter().map(|took| (all[3].1[0] / took.1[0]).into()));
        let pairs = (all[3].2 == 1.0).then_some(all[3].0);
        table.row([row, cells![pairs, 100.0 / all[0].2, 100.0 / all[3].2]].concat());
    }
    Ok(table)
}

/// The values of `GpuOptions::root`, in words.
const ROOTS: [(u32, &str); 8] = [
    (0, "the device's square root"),
    (2, "Carmack, 2 steps"),
    (3, "Carmack, 3 steps"),
    (4, "Carmack, 4 steps"),
    (6, "Lomont, 2 steps"),
    (7, "Lomont, 3 steps"),
    (8, "Lomont, 4 steps"),
    (9, "no root: bisection"),
];

/// Every pair of 1000 objects tested by `check_all`; integers correct each root, so all are exact.
fn on_device(device: &Device) -> Result<Table, Failure> {
    let columns = ["root", "ms of the kernel `check_all`", "times as long as the first", "pairs"];
    let mut table = Table::new("Avril tables 2 and 4: roots, GPU", columns);
    let configs = ROOTS.map(|(root, _)| on_gpu(GpuOptions { root, ..GpuOptions::DEFAULT }));
    let boxes = cubes(1000, 1.0, 1.0, 1);
    let runs = device.run(&configs, &boxes, 0.1)?;
    same_pairs(&runs, once(UNSORTED, &boxes)?.pairs)?;
    let ms = |i: usize| kernels(&runs[i].1, |name| name == "check_all");
    for (i, (_, report)) in runs.iter().enumerate() {
        let ratio = ms(0).zip(ms(i)).map(|(first, ms)| ms / first);
        table.row(cells![ROOTS[i].1, ms(i), ratio, report.pairs]);
    }
    Ok(table)
}

/// Table 2 beyond brute force: in the cells of a grid, as table 2's times seem to be.
fn in_cells(device: &Device) -> Result<Table, Failure> {
    let columns = ["objects", "root", "ms of the kernel `check_small`", "checks", "pairs"];
    let mut table = Table::new("Avril table 2: roots in the cells of a grid, GPU", columns);
    for n in [10_000, 100_000].into_iter().filter(|&n| device.for_boxes(n).is_some()) {
        let boxes = cubes(n, 1.0, 1.0, 1);
        let pairs = once(UNSORTED, &boxes)?.pairs;
        for (root, name) in ROOTS {
            let gpu = on_gpu(GpuOptions { root, ..GpuOptions::DEFAULT });
            let config = with_gpu_grid(gpu, &PbigSettings { small_cell: 256, ..SETTINGS }, 0);
            if let Some((_, report)) = device.run_for(config, &boxes, 0.1, pairs)? {
                let kernel = kernels(&report, |name| name == "check_small");
                table.row(cells![n, name, kernel, report.checks.made, report.pairs]);
            }
        }
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn all_ways_find_the_pairs_of_brute_force() {
        let pairs = oracle::pairs(&cubes(300, 1.0, 1.0, 1)).len() as u64;
        let all = all_ways(300, MOST_IDS).expect("all agree");
        assert!(all.iter().all(|took| took.0 == pairs && took.2 == 1.0 && took.1[0] <= took.1[1]));
        // In stretches, which end within a block.
        assert!(all_ways(300, 30_000).is_ok_and(|all| all[0].0 > 0 && all[0].2 > 1.0));
        let (some, times) = stretches(1_000_000, 10_000);
        assert_eq!((some[0].clone(), some[999].clone(), times), (0..10, 999_990..1_000_000, 100.0));
    }
}

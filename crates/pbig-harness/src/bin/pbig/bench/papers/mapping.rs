//! Avril's table 2 and the times of table 4: from the index of a pair to the pair, with a root and without.

use super::device::{Device, kernels, on_gpu, same_pairs};
use super::printed::{AVRIL_2, AVRIL_4, AVRIL_LAZY_ON_CPU};
use super::sheet::{Sheet, short};
use super::{Scale, UNSORTED, once};
use crate::bench::measure::timed;
use crate::output::Failure;
use pbig_core::pair_index::{pair_count, pair_of};
use pbig_core::{Aabb, Config, GpuOptions, Strategy};
use pbig_harness::boxes::cubes;
use serde_json::json;
use std::ops::Range;

/// Ids looked at in one measurement; where there are more, stretches of them, spread evenly.
const MOST_IDS: u64 = 100_000_000;

/// Stretches of `0..ids` of at most [`MOST_IDS`] in all, and how many times as many there are.
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

/// Ids of the lazy way: the pairs `(a, b)` are `(k / n, k % n)` where that is above the diagonal (Avril
/// 3.2.2), so `n^2 - n` of them.
fn lazy_ids(n: u64) -> u64 {
    n * n - n
}

fn lazy_pair(k: u64, n: u64) -> Option<(u64, u64)> {
    let (a, b) = (k / n, k % n);
    (a < b).then_some((a, b))
}

/// Overlapping pairs among the ids.
fn overlaps(boxes: &[Aabb], ids: &[Range<u64>], pair: impl Fn(u64) -> Option<(u64, u64)>) -> u64 {
    let hit = |(a, b): (u64, u64)| boxes[a as usize].overlaps(&boxes[b as usize]);
    ids.iter().flat_map(Range::clone).filter_map(pair).filter(|&pair| hit(pair)).count() as u64
}

/// Table 2 on one thread of the CPU.
pub(super) fn lazy(scale: &Scale) -> Result<Sheet, Failure> {
    let columns = [
        "objects",
        "ms printed, root",
        "ms printed, lazy",
        "lazy / root printed",
        "ms, root",
        "ms, lazy",
        "lazy / root",
        "pairs",
        "ids looked at",
    ];
    let (seconds, times) = AVRIL_LAZY_ON_CPU;
    let mut sheet = Sheet::new("Avril table 2: the lazy way, CPU", &columns)
        .about(format!(
            "One thread, each pair tested. Printed: the GPU; on their CPU the lazy way is {times} times as fast, \
             {seconds} s for 10,000 objects. Here the root is in f64 with the exact correction, the lazy way two \
             divisions. The more ids there are than {}, the larger the part that is extrapolated from stretches \
             spread over all.",
            short(MOST_IDS as f64)
        ))
        .about("No more is known of the objects; here they are cubes with a pair each.");
    let most = if scale.quick { MOST_IDS / 10 } else { MOST_IDS };
    for (n, root, lazy) in AVRIL_2 {
        let boxes = cubes(n as usize, 1.0, 1.0, 1);
        let (by_root, times) = stretches(pair_count(n), most);
        let (found, root_ms) = timed(|| overlaps(&boxes, &by_root, |k| Some(pair_of(k, n))));
        let (by_lazy, lazy_times) = stretches(lazy_ids(n), most);
        let (also, lazy_ms) = timed(|| overlaps(&boxes, &by_lazy, |k| lazy_pair(k, n)));
        let whole = times == 1.0 && lazy_times == 1.0;
        if whole && found != also {
            return Err(Failure::Check(format!(
                "{n} objects: {found} pairs by root, {also} by the lazy way"
            )));
        }
        let (root_ms, lazy_ms) = (root_ms * times, lazy_ms * lazy_times);
        let ids = if whole {
            "all".into()
        } else {
            format!("{} %, {} %", short(100.0 / times), short(100.0 / lazy_times))
        };
        let pairs = whole.then_some(found);
        sheet.row(json!([n, root, lazy, lazy / root, root_ms, lazy_ms, lazy_ms / root_ms, pairs, ids]));
    }
    Ok(sheet)
}

/// What `GpuOptions::root` can be, in words.
const ROOTS: [(u32, &str); 6] = [
    (0, "the device's square root"),
    (2, "Carmack, 2 steps"),
    (3, "Carmack, 3 steps"),
    (6, "Lomont, 2 steps"),
    (7, "Lomont, 3 steps"),
    (9, "no root: bisection"),
];

/// The same on a device, with the roots of table 4.
pub(super) fn roots(device: &Device) -> Result<Sheet, Failure> {
    const OBJECTS: usize = 1000;
    let columns = ["root", "ms of the kernel `check_all`", "times as long as the first", "pairs"];
    let mut sheet = Sheet::new("Avril tables 2 and 4: roots, GPU", &columns)
        .about(format!(
            "{OBJECTS} objects, every pair tested by `check_all`. Printed for 1000: {} ms with the root and {} \
             without; table 4 has {} of CUDA's roots in {} ms, and by its times {} less with Carmack's or Lomont's. \
             Here integers correct each, so all are exact. {}",
            AVRIL_2[0].1,
            AVRIL_2[0].2,
            short(AVRIL_4[3].roots as f64),
            AVRIL_4[3].cuda,
            less(),
            device.about()
        ))
        .about("How exact each is without the integers: `pbig accuracy`.");
    let configs = ROOTS.map(|(root, _)| on_gpu(GpuOptions { root, ..GpuOptions::DEFAULT }));
    let boxes = cubes(OBJECTS, 1.0, 1.0, 1);
    let runs = device.run(&configs, &boxes, 0.1)?;
    same_pairs(&runs, once(UNSORTED, &boxes)?.pairs)?;
    let times: Vec<Option<f64>> =
        runs.iter().map(|(_, report)| kernels(report, |name| name == "check_all")).collect();
    for ((_, name), (ms, (_, report))) in ROOTS.iter().zip(times.iter().zip(&runs)) {
        let ratio = times[0].zip(*ms).map(|(first, ms)| ms / first);
        sheet.row(json!([name, ms, ratio, report.pairs]));
    }
    let spread = longest_over_shortest(times.iter().copied().flatten());
    let says = |spread| {
        format!(
            "The kernel, which tests boxes too, takes at most {} times as long with one as with another.",
            short(spread)
        )
    };
    Ok(match spread {
        Some(spread) => sheet.about(says(spread)),
        None => sheet,
    })
}

/// By how much table 4's times with approximations are below those without.
fn less() -> String {
    let less = AVRIL_4.iter().map(|row| row.reduction(0.0));
    let (least, most) = less.fold((f64::MAX, 0.0f64), |(least, most), x| (least.min(x), most.max(x)));
    format!("{least:.1} to {most:.1} %")
}

/// Objects of table 2 that a device searches in the cells of a grid only.
const IN_CELLS: [usize; 2] = [10_000, 100_000];

/// Table 2 beyond brute force: with a root and without in the cells of a grid, as table 2's times seem to be.
pub(super) fn in_cells(device: &Device) -> Result<Sheet, Failure> {
    let columns = ["objects", "root", "ms of the kernel `check_small`", "checks", "pairs"];
    let mut sheet = Sheet::new("Avril table 2: roots in the cells of a grid, GPU", &columns).about(format!(
        "More than 1024 boxes a device does not search by brute force, but in cells, where `check_small` maps the \
         indices of a cell's pairs; all cells of up to 256 boxes. Cubes with a pair each, as many pairs as on the CPU. {}",
        device.about()
    ));
    for n in IN_CELLS {
        if device.for_boxes(n).is_none() {
            continue;
        }
        let boxes = cubes(n, 1.0, 1.0, 1);
        let pairs = once(UNSORTED, &boxes)?.pairs;
        for (root, name) in ROOTS {
            let gpu = on_gpu(GpuOptions { root, ..GpuOptions::DEFAULT });
            let config = Config { strategy: Strategy::Pbig, small_cell: 256, ..gpu };
            if let Some((_, report)) = device.run_for(config, &boxes, 0.1, pairs)? {
                let kernel = kernels(&report, |name| name == "check_small");
                sheet.row(json!([n, name, kernel, report.checks.made, report.pairs]));
            }
        }
    }
    Ok(sheet)
}

fn longest_over_shortest(times: impl Iterator<Item = f64>) -> Option<f64> {
    let (least, most) = times.fold((f64::MAX, 0.0f64), |(least, most), ms| (least.min(ms), most.max(ms)));
    (least > 0.0 && most > 0.0).then(|| most / least)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    #[test]
    fn times_spread_by_the_longest_over_the_shortest() {
        assert_eq!(longest_over_shortest([2.0, 3.0, 1.5].into_iter()), Some(2.0));
        assert_eq!(longest_over_shortest([].into_iter()), None);
    }

    #[test]
    fn what_roots_save_is_by_the_printed_times() {
        assert_eq!(less(), "12.5 to 14.6 %");
    }

    #[test]
    fn both_ways_find_the_pairs_of_brute_force() {
        let n = 300;
        let boxes = cubes(n as usize, 1.0, 3.0, 1);
        let pairs = oracle::pairs(&boxes).len() as u64;
        let (by_root, by_lazy) = (0..pair_count(n), 0..lazy_ids(n));
        assert_eq!(overlaps(&boxes, &[by_root], |k| Some(pair_of(k, n))), pairs);
        assert_eq!(overlaps(&boxes, &[by_lazy], |k| lazy_pair(k, n)), pairs);
    }

    #[test]
    fn stretches_are_spread_over_all_and_know_their_share() {
        let all = 0..10;
        assert_eq!(stretches(10, 100), (vec![all], 1.0));
        let (some, times) = stretches(1_000_000, 10_000);
        assert_eq!((some[0].clone(), some[999].clone(), times), (0..10, 999_990..1_000_000, 100.0));
    }
}

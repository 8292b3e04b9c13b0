//! The same roots as kernels: the row that a device estimates, and the exact pair.

use super::super::study::{Cell, Table};
use super::times::label;
use crate::bench::measure::timed;
use crate::output::Failure;
use pbig_core::GpuOptions;
use pbig_core::gpu::study::Bench;
use pbig_core::layout::{LANES, Params};
use pbig_core::pair_index::{pair_count, pair_of};
use pbig_harness::index::{Correction, Rules, WAYS};

/// Runs over all pairs, evenly spread, and the most indices of each.
const RUNS: u64 = 8;
const MOST: u32 = 1 << 17;

/// The kernel's numbers for roots (`GpuOptions::root`), with our names for them.
fn roots() -> Vec<(u32, String)> {
    let numbered = |way: &pbig_harness::index::Way| match (way.name, way.steps) {
        ("f32 sqrt", _) => Some(0),
        ("Carmack", steps) => steps,
        ("Lomont", steps) => steps.map(|steps| steps + 4),
        _ => None,
    };
    let ways = WAYS.iter().filter_map(|way| numbered(way).map(|root| (root, label(way))));
    ways.chain([(9, "bisection over rows".to_owned())]).collect()
}

#[derive(Default)]
struct Found {
    indices: u64,
    wrong: u64,
    wrong_by_rules: u64,
    worst_row: u64,
}

/// Estimates and exact pairs on the best adapter; times where it is no software.
pub(super) fn table(bench: &Bench, software: bool, quick: bool) -> Result<Table, Failure> {
    let title = "As kernels: estimated rows, and pairs made exact by integers";
    let columns = [
        "boxes",
        "root",
        "indices",
        "wrong_percent",
        "worst_row",
        "wrong_by_the_rules_percent",
        "ns_per_pair",
    ];
    let mut table = Table::new("kernels", title, &columns);
    let sizes: &[u32] = if quick { &[300] } else { &[300, 1000, 2000, 5000, 16_384, 32_768] };
    for &n in sizes {
        for (root, name) in roots() {
            let (found, ms) = study(bench, n, root)?;
            let percent = |wrong: u64| wrong as f64 / found.indices as f64 * 100.0;
            table.row([
                u64::from(n).into(),
                name.into(),
                found.indices.into(),
                percent(found.wrong).into(),
                found.worst_row.into(),
                percent(found.wrong_by_rules).into(),
                Cell::from((!software && ms > 0.0).then(|| ms * 1e6 / found.indices as f64)),
            ]);
        }
    }
    Ok(table)
}

/// Some indices of each part of all pairs; and the time for them, less that of calls which compute none.
fn study(bench: &Bench, n: u32, root: u32) -> Result<(Found, f64), Failure> {
    let (mut found, mut ms) = (Found::default(), 0.0);
    let pairs = pair_count(n.into());
    for part in 0..RUNS {
        let (first, end) = (pairs * part / RUNS, pairs * (part + 1) / RUNS);
        let indices = Indices { n, first: first as u32, count: ((end - first) as u32).min(MOST) };
        ms += timed_run(bench, root, &indices, &mut found)?;
    }
    Ok((found, ms))
}

struct Indices {
    n: u32,
    first: u32,
    count: u32,
}

/// The best of three, and what comes out.
fn timed_run(bench: &Bench, root: u32, indices: &Indices, found: &mut Found) -> Result<f64, Failure> {
    let mut best = [f64::MAX; 2];
    let mut out = Vec::new();
    for _ in 0..3 {
        let (none, idle) = timed(|| run(bench, root, indices, 0));
        let (words, busy) = timed(|| run(bench, root, indices, indices.count));
        (_, out) = (none?, words?);
        best = [best[0].min(idle), best[1].min(busy)];
    }
    judge(indices.n, indices.first, &out, found)?;
    Ok(best[1] - best[0])
}

/// With room for all indices, of which `cells` are computed.
fn run(bench: &Bench, root: u32, indices: &Indices, cells: u32) -> Result<Vec<u32>, Failure> {
    let &Indices { n, first, count } = indices;
    let params = Params { boxes: n, split: first, cells, ..Params::default() };
    let options = GpuOptions { root, ..GpuOptions::DEFAULT };
    let bindings = [bytemuck::bytes_of(&params).to_vec(), vec![0; 12 * count as usize]];
    let kernel = &pbig_shaders::INDEX_PAIRS;
    let found = bench.run(kernel, &options, false, &bindings, count.div_ceil(LANES));
    let found = found.map_err(|error| Failure::Input(format!("{}: {error}", kernel.name)))?;
    Ok(bytemuck::pod_collect_to_vec(&found[1]))
}

/// An exact pair that is wrong is a failed check.
fn judge(n: u32, first: u32, out: &[u32], found: &mut Found) -> Result<(), Failure> {
    for (k, words) in (u64::from(first)..).zip(out.chunks_exact(3)) {
        let (a, b) = pair_of(k, n.into());
        if (a, b) != (words[1].into(), words[2].into()) {
            return Err(Failure::Check(format!(
                "index {k} of {n} boxes: the kernel gives {:?}",
                &words[1..]
            )));
        }
        let (estimate, a) = (i64::from(words[0]), a as i64);
        let by_rules = Rules::pair(estimate, k as i64, n.into());
        found.indices += 1;
        found.wrong += u64::from(estimate != a);
        found.wrong_by_rules += u64::from(by_rules != (a, b as i64));
        found.worst_row = found.worst_row.max(estimate.abs_diff(a));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_row_is_counted_and_a_wrong_pair_is_a_failure() {
        let mut found = Found::default();
        let right = [0u32, 0, 1, 0, 0, 2];
        assert!(judge(4, 0, &right, &mut found).is_ok() && found.wrong == 0);
        let off_by_two = [2u32, 0, 2, 0, 0, 3];
        judge(4, 1, &off_by_two, &mut found).expect("the pairs are right");
        assert_eq!((found.indices, found.wrong, found.wrong_by_rules, found.worst_row), (4, 1, 1, 2));
        assert!(judge(4, 0, &[0, 0, 2], &mut found).is_err());
    }
}

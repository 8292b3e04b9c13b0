//! Time for a pair, on one thread, for every way and correction.

use crate::index::{Block, EXACT, WAYS, Way};
use crate::index::{lazy_ids, pass_bisection, pass_integer_root, pass_lazy};
use pbig_harness::bench::{Contest, Effort, medians, timed};
use pbig_harness::cells;
use pbig_harness::output::Failure;
use pbig_harness::runner::Spread;
use pbig_harness::table::Table;
use std::hint::black_box;
use std::time::Duration;

/// Blocks of indices that are looked at, evenly spread, and the length of each.
const BLOCKS: i64 = 16;
const BLOCK: i64 = 2048;

/// Nanoseconds for a pair at one number of boxes.
pub(super) struct Times {
    pub(super) n: i64,
    /// By way, as it is, by the rules, by integers.
    pub(super) ways: [[f64; 3]; WAYS.len()],
    /// In the order of [`EXACT`].
    pub(super) exact: [f64; EXACT.len()],
}

impl Times {
    pub(super) fn measure(n: i64, quick: bool) -> Result<Self, Failure> {
        let (pairs, ids) = (blocks(n * (n - 1) / 2, 1), blocks(lazy_ids(n), 2));
        let mut sides = Sides { n, pairs, ids, times: vec![vec![]; SIDES] };
        let rounds = if quick { 15 } else { 2 * SIDES };
        medians(&mut sides, Effort { warm_up: 0, rounds, budget: Duration::from_secs(20) })?;
        // Over all places in a round: there are too many for a median of each, and nothing is in memory that a side
        // could warm for the next.
        let medians: Vec<f64> =
            sides.times.iter().map(|times| Spread::of(times.iter().copied()).median).collect();
        let (ways, exact) = medians.split_at(3 * WAYS.len());
        Ok(Self {
            n,
            ways: std::array::from_fn(|way| std::array::from_fn(|fix| ways[3 * way + fix])),
            exact: std::array::from_fn(|k| exact[k]),
        })
    }
}

/// Blocks spread over what there is; all of it, as often as makes as many indices, if there are fewer.
fn blocks(all: i64, times: i64) -> Vec<Block> {
    let count = BLOCK * times;
    let evenly = |k: i64| ((all - count) * k / (BLOCKS - 1), count);
    if all < BLOCKS * count {
        return vec![(0, all); ((BLOCKS * count + all - 1) / all) as usize];
    }
    (0..BLOCKS).map(evenly).collect()
}

struct Sides {
    n: i64,
    pairs: Vec<Block>,
    ids: Vec<Block>,
    /// Nanoseconds for a pair, by side.
    times: Vec<Vec<f64>>,
}

/// Ways with their corrections, and the others.
const SIDES: usize = 3 * WAYS.len() + EXACT.len();

impl Contest for Sides {
    fn sides(&self) -> usize {
        SIDES
    }

    fn prepare(&mut self, _: usize) {}

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let Self { n, pairs, ids, .. } = self;
        let count: i64 = pairs.iter().map(|block| block.1).sum();
        let pass = |pass: fn(i64, &[Block]) -> i64| (count, timed(|| black_box(pass(*n, pairs))).1);
        let (pairs, ms) = match side.checked_sub(3 * WAYS.len()) {
            None => pass(WAYS[side / 3].passes[side % 3]),
            Some(0) => pass(pass_bisection),
            Some(1) => pass(pass_integer_root),
            Some(_) => {
                let ((pairs, sum), ms) = timed(|| pass_lazy(*n, ids));
                black_box(sum);
                (pairs, ms)
            }
        };
        self.times[side].push(ms * 1e6 / pairs.max(1) as f64);
        Ok(ms)
    }
}

/// A way's name with its steps.
pub(super) fn label(way: &Way) -> String {
    way.steps.map_or(way.name.to_owned(), |steps| format!("{} {steps}", way.name))
}

pub(super) fn table(times: &[Times]) -> Table {
    let columns =
        ["boxes", "root", "as_it_is_ns_per_pair", "by_the_rules_ns_per_pair", "by_integers_ns_per_pair"];
    let mut table = Table::new("times", columns);
    for times in times {
        for (way, ns) in WAYS.iter().zip(times.ways) {
            table.row(cells![times.n as u64, label(way), ns[0], ns[1], ns[2]]);
        }
        for (way, ns) in EXACT.iter().zip(times.exact) {
            table.row(cells![times.n as u64, way.name, ns, None::<f64>, None::<f64>]);
        }
    }
    table
}

//! Ways from the index of a pair to the pair (Avril et al. 2012, 3.2 and 3.3), right or nearly: each root by
//! which the row can be estimated, each correction of what it gets wrong, and counts of what is left.
//!
//! All of them are for study. The way that pbig takes is [`pbig_harness::pair_index`]; rows, columns and indices
//! are 0-based here as there, and every estimate is equation 1 in that form.

mod correct;
mod exact;
mod root;
mod rounded;
mod search;
mod tally;

pub use correct::{AsItIs, Correction, Integers, Rules, lazy_ids, lazy_pair};
pub use exact::{EXACT, Exact};
pub use root::{AllSingle, CARMACK, Double, LOMONT, Newton, Printed, Root, Single, SingleRoot, WideNewton};
pub use rounded::{Form, Rounded, Step};
pub use search::{Counterexample, counterexample, root_differences, root_errors};
pub use tally::{MOST_EXHAUSTIVE, Sample, Tally};

use pbig_harness::pair_index::pair_count;

/// A way of estimating the row, with what can be asked of it.
#[derive(Clone, Copy)]
pub struct Way {
    /// Name of the root, without its steps.
    pub name: &'static str,
    /// Newton's steps, where there are any.
    pub steps: Option<u32>,
    /// The estimated row, from `2n - 1` and `(2n - 1)^2 - 8k`.
    pub row: fn(i64, i64) -> i64,
    /// Over all pairs of `n <= MOST_EXHAUSTIVE` boxes: as it is, by the rules, by integers.
    pub tally: fn(i64) -> [Tally; 3],
    /// Over the ends of all rows and some indices between, in the same order.
    pub sample: fn(i64, &[i64]) -> [Sample; 3],
    /// The largest relative error of the root.
    pub worst_relative: fn() -> f64,
    /// The smallest `n` up to one of at most 2^20 for which the paper's rules leave a wrong pair at an end of a row.
    pub counterexample: fn(i64) -> Option<Counterexample>,
    /// Computes the pairs of blocks of indices, in the same order; the sum is for the optimiser.
    pub passes: [fn(i64, &[Block]) -> i64; 3],
}

/// Consecutive indices: the first, and how many.
pub type Block = (i64, i64);

const fn way<R: Root>(name: &'static str, steps: Option<u32>) -> Way {
    let passes = [pass::<R, AsItIs>, pass::<R, Rules>, pass::<R, Integers>];
    let (tally, sample, counterexample) = (tally::all::<R>, tally::some::<R>, counterexample::<R>);
    Way { name, steps, row: R::row, tally, sample, worst_relative: R::worst_relative, counterexample, passes }
}

/// Every root.
pub const WAYS: [Way; 12] = [
    way::<Single>("f32 sqrt", None),
    way::<Double>("f64 sqrt", None),
    way::<Newton<CARMACK, 1>>("Carmack", Some(1)),
    way::<Newton<CARMACK, 2>>("Carmack", Some(2)),
    way::<Newton<CARMACK, 3>>("Carmack", Some(3)),
    way::<Newton<CARMACK, 4>>("Carmack", Some(4)),
    way::<Newton<LOMONT, 1>>("Lomont", Some(1)),
    way::<Newton<LOMONT, 2>>("Lomont", Some(2)),
    way::<Newton<LOMONT, 3>>("Lomont", Some(3)),
    way::<Newton<LOMONT, 4>>("Lomont", Some(4)),
    way::<AllSingle>("all in f32", None),
    way::<Printed>("as printed, in f32", None),
];

/// The corrections of an estimate, in the order of the arrays of a [`Way`].
pub const CORRECTIONS: [&str; 3] = ["as it is", "the paper's rules", "integers"];

/// Index of the first pair of row `a`, also of rows that there are not.
#[inline(always)]
const fn row_start(a: i64, n: i64) -> i64 {
    a * (2 * n - a - 1) / 2
}

/// Returns the number under the root of equation 1.
#[inline(always)]
const fn discriminant(k: i64, n: i64) -> i64 {
    let m = 2 * n - 1;
    m * m - 8 * k
}

fn pairs_of(n: i64) -> i64 {
    pair_count(n as u64) as i64
}

/// Computes the pairs of some blocks.
pub fn pass<R: Root, C: Correction>(n: i64, blocks: &[Block]) -> i64 {
    let pair = |k| C::pair(R::row(2 * n - 1, discriminant(k, n)), k, n);
    sum(blocks, pair)
}

/// Makes a pass without a root: by bisection over the starts of rows, as the kernel does it.
pub fn pass_bisection(n: i64, blocks: &[Block]) -> i64 {
    sum(blocks, |k| {
        let row = correct::searched_row(k, n);
        (row, row + 1 + k - row_start(row, n))
    })
}

/// Makes a pass by the root of an integer, rounded up.
pub fn pass_integer_root(n: i64, blocks: &[Block]) -> i64 {
    sum(blocks, |k| {
        let row = root::integer_row(2 * n - 1, discriminant(k, n));
        (row, row + 1 + k - row_start(row, n))
    })
}

/// The lazy way over blocks of identifiers, of which about half are pairs: those, and their sum.
pub fn pass_lazy(n: i64, blocks: &[Block]) -> (i64, i64) {
    let mut pairs = 0;
    let sum = sum(blocks, |id| {
        let pair = lazy_pair(id, n);
        pairs += i64::from(pair.is_some());
        pair.unwrap_or((0, 0))
    });
    (pairs, sum)
}

#[inline(always)]
fn sum(blocks: &[Block], mut pair: impl FnMut(i64) -> (i64, i64)) -> i64 {
    let mut sum = 0i64;
    for &(first, count) in blocks {
        for k in first..first + count {
            let (a, b) = pair(k);
            sum = sum.wrapping_add(a ^ (b << 20));
        }
    }
    sum
}

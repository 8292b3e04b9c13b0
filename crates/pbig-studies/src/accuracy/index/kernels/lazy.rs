//! The lazy way as a kernel: of n^2 - n identifiers, half are pairs (Avril 3.2.2).

use super::{Estimates, Indices, parts, run_kernel, timed_run};
use crate::index::{Tally, lazy_ids, lazy_pair, tally_of};
use pbig_harness::kernels::Bench;
use pbig_harness::output::Failure;

/// The most boxes for which identifiers have 32 bits.
pub(super) const MOST_BOXES: u32 = 1 << 16;

/// Tests all or some identifiers, as indices. A wrong one is a failed check.
pub(super) fn estimates(bench: &Bench, n: u32, software: bool) -> Result<Estimates, Failure> {
    let (mut pairs, mut ms) = (Vec::new(), 0.0);
    for identifiers in parts(n, lazy_ids(n.into()) as u64) {
        let run = |cells| {
            run_kernel(bench, (&crate::study::LAZY_PAIRS, 0), identifiers.params(cells), identifiers.count, 2)
        };
        let (words, took) = timed_run(software, run, identifiers.count)?;
        pairs.extend(given(&identifiers, &words)?);
        ms += took;
    }
    let tally = Tally { pairs: pairs.len() as u64, ..Tally::default() };
    let mut estimates = Estimates {
        n,
        name: "lazy way".to_owned(),
        tally,
        by_rules: None,
        ms: (!software && ms > 0.0).then_some(ms),
    };
    if estimates.is_whole() {
        estimates.tally = tally_of(n.into(), pairs.into_iter());
    }
    Ok(estimates)
}

/// The pairs that identifiers give, in their order.
fn given(&Indices { n, first, .. }: &Indices, words: &[u32]) -> Result<Vec<(i64, i64)>, Failure> {
    let pair = |(id, words): (u32, &[u32])| {
        let pair = (words != [u32::MAX; 2]).then(|| (words[0].into(), words[1].into()));
        if pair != lazy_pair(id.into(), n.into()) {
            return Err(Failure::Check(format!("identifier {id} of {n} boxes: the kernel gives {words:?}")));
        }
        Ok(pair)
    };
    (first..).zip(words.chunks_exact(2)).filter_map(|one| pair(one).transpose()).collect()
}

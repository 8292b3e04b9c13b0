//! The lazy way as a kernel: of n^2 - n identifiers, half are pairs (Avril 3.2.2).

use super::{Estimates, Indices, parts, run_kernel, timed_run};
use crate::output::Failure;
use pbig_harness::index::{LAZY, Tally, lazy_ids, lazy_pair, tally_of};
use pbig_harness::kernels::Bench;

/// The most boxes for which identifiers have 32 bits.
pub(super) const MOST_BOXES: u32 = 1 << 16;

/// Tests all or some identifiers, as indices. A wrong one is a failed check.
pub(super) fn estimates(bench: &Bench, n: u32, software: bool) -> Result<Estimates, Failure> {
    let (mut pairs, mut ms) = (Vec::new(), 0.0);
    for identifiers in parts(n, lazy_ids(n.into()) as u64) {
        let run = |cells| {
            run_kernel(
                bench,
                (&pbig_harness::study::LAZY_PAIRS, 0),
                identifiers.params(cells),
                identifiers.count,
                2,
            )
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

pub(super) fn note() -> String {
    format!(
        "The lazy way as a kernel. {LAZY} Up to as many boxes as have all indices looked at, all its identifiers are looked \
         at; beyond, as many as the other kernels look at indices. The column of indices has the pairs among them. It \
         estimates nothing, so the paper's rules have nothing to mend. It ends at {MOST_BOXES} boxes, beyond which n^2 - n \
         is 2^32 or more. A run fails if an identifier gives anything but its pair."
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_identifier_is_a_failure_and_those_that_are_no_pairs_give_none() {
        let identifiers = Indices { n: 3, first: 0, count: 4 };
        let mut words = [u32::MAX, u32::MAX, 0, 1, 0, 2, u32::MAX, u32::MAX];
        assert_eq!(given(&identifiers, &words).expect("right pairs"), [(0, 1), (0, 2)]);
        words[6..].copy_from_slice(&[1, 0]);
        let failure = given(&identifiers, &words).expect_err("below the diagonal").to_string();
        assert!(failure.contains("identifier 3 of 3 boxes"), "{failure}");
    }

    #[test]
    fn with_one_box_more_identifiers_would_not_have_32_bits() {
        let most = i64::from(MOST_BOXES);
        assert!(lazy_ids(most) < 1 << 32 && lazy_ids(most + 1) >= 1 << 32);
    }

    #[test]
    fn all_pairs_of_some_boxes_are_met_once() {
        let Ok(bench) = Bench::new() else { return };
        let found = estimates(&bench, 300, true).expect("right pairs");
        assert_eq!(found.tally, Tally { pairs: 300 * 299 / 2, ..Tally::default() });
        let some = estimates(&bench, MOST_BOXES, true).expect("right pairs").tally;
        assert!((400_000..600_000).contains(&some.pairs), "about half of 8 parts: {}", some.pairs);
    }
}

//! Emit: found pairs into one list, in order.

use crate::{Order, Pair};

/// Brings the pairs of all chunks into `out`. Ids are below `ids`.
pub(crate) fn collect(
    chunks: &[Vec<Pair>],
    ids: usize,
    order: Order,
    scratch: &mut Vec<u32>,
    out: &mut Vec<Pair>,
) {
    let len = chunks.iter().map(Vec::len).sum::<usize>();
    out.clear();
    if order == Order::Unspecified || are_few(len, ids) {
        chunks.iter().for_each(|chunk| out.extend_from_slice(chunk));
        if order == Order::Sorted {
            sort_by_comparing(out);
        }
    } else {
        sort_by_counting(chunks, ids, len, scratch, out);
    }
}

/// Buffers of [`sort`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Scratch {
    ends: Vec<u32>,
    pairs: Vec<Pair>,
}

/// Brings one list into order. Ids are below `ids`.
pub(crate) fn sort(pairs: &mut Vec<Pair>, ids: usize, scratch: &mut Scratch) {
    if pairs.len() < 2 {
        return;
    }
    if are_few(pairs.len(), ids) {
        return sort_by_comparing(pairs);
    }
    let Scratch { ends, pairs: sorted } = scratch;
    sort_by_counting(std::slice::from_ref(pairs), ids, pairs.len(), ends, sorted);
    std::mem::swap(pairs, sorted);
}

/// A counting sort touches a counter for every id: not worth it for few pairs.
fn are_few(pairs: usize, ids: usize) -> bool {
    pairs < ids / 4 || pairs > u32::MAX as usize
}

/// By one comparison of 64 bits.
fn sort_by_comparing(pairs: &mut [Pair]) {
    pairs.sort_unstable_by_key(|pair| u64::from(pair.a) << 32 | u64::from(pair.b));
}

/// By `a` through a counting sort, then each row, which is short, by comparisons: at one pair a box
/// a third of the time of comparing whole pairs.
fn sort_by_counting(chunks: &[Vec<Pair>], ids: usize, len: usize, ends: &mut Vec<u32>, out: &mut Vec<Pair>) {
    ends.clear();
    ends.resize(ids, 0);
    chunks.iter().flatten().for_each(|pair| ends[pair.a as usize] += 1);
    let mut sum = 0;
    for end in ends.iter_mut() {
        sum += *end;
        *end = sum;
    }
    out.resize(len, Pair::default());
    for pair in chunks.iter().flatten() {
        // Ends become starts as the rows fill from the back.
        let place = &mut ends[pair.a as usize];
        *place -= 1;
        out[*place as usize] = *pair;
    }
    for a in 0..ids {
        let end = ends.get(a + 1).map_or(len, |&next| next as usize);
        out[ends[a] as usize..end].sort_unstable();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_ways_of_sorting_give_the_same_bytes() {
        let pairs: Vec<_> = (0..500u32).map(|i| Pair::new(i * 37 % 101, 101 + i * 53 % 997)).collect();
        let chunks: Vec<_> = pairs.chunks(77).map(<[Pair]>::to_vec).collect();
        let mut wanted = pairs;
        wanted.sort_unstable();
        for ids in [1100, 100_000] {
            let mut out = vec![Pair::default(); 3];
            collect(&chunks, ids, Order::Sorted, &mut Vec::new(), &mut out);
            assert_eq!(out, wanted, "{ids} ids");
            let mut list: Vec<Pair> = chunks.concat();
            sort(&mut list, ids, &mut Scratch::default());
            assert_eq!(list, wanted, "one list, {ids} ids");
        }
    }
}

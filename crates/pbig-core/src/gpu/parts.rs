//! Parts of a set that does not fit the device at once. Together they have all pairs (contract 2).
//!
//! The boxes are sorted along an axis and cut into blocks of half the size that fits. Each block is searched alone, and
//! together with every later block that its boxes reach. This assumes nothing about the boxes: in the worst case each
//! block is searched with all others.

use crate::Aabb;
use crate::layout::ordered;
use crate::pbig::Summary;

/// Ids of boxes to search: for all pairs of `first`, or for pairs between `first` and `second`.
#[derive(Debug, PartialEq)]
pub(super) struct Part<'a> {
    pub(super) first: &'a [u32],
    pub(super) second: &'a [u32],
}

/// Returns the ids of the valid boxes, sorted along the axis on which they are spread most, and that axis.
pub(super) fn sorted(boxes: &[Aabb], summary: &Summary) -> (Vec<u32>, usize) {
    let width = |k: usize| {
        let ends = summary.sample.iter().map(|b| b.min[k]);
        ends.clone().fold(f32::MIN, f32::max) - ends.fold(f32::MAX, f32::min)
    };
    let axis = (0..3).max_by(|&j, &k| width(j).total_cmp(&width(k))).unwrap_or(0);
    let mut ids: Vec<u32> = (0..boxes.len() as u32).filter(|&id| boxes[id as usize].is_valid()).collect();
    ids.sort_unstable_by_key(|&id| (ordered(boxes[id as usize].min[axis]), id));
    (ids, axis)
}

/// Returns the parts for blocks of `size` sorted ids.
pub(super) fn parts<'a>(boxes: &[Aabb], ids: &'a [u32], axis: usize, size: usize) -> Vec<Part<'a>> {
    let blocks: Vec<&[u32]> = ids.chunks(size.max(1)).collect();
    let mut parts = Vec::new();
    for (i, first) in blocks.iter().enumerate() {
        parts.push(Part { first, second: &[] });
        let end = first.iter().map(|&id| ordered(boxes[id as usize].max[axis])).max();
        // Blocks are sorted: after the first block that begins beyond the end, all do.
        let begins = |block: &&&[u32]| Some(ordered(boxes[block[0] as usize].min[axis])) <= end;
        parts.extend(blocks[i + 1..].iter().take_while(begins).map(|second| Part { first, second }));
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::oracle;
    use std::collections::BTreeSet;

    #[test]
    fn every_overlapping_pair_is_in_exactly_one_part() {
        let mut boxes: Vec<_> = (0..300u32)
            .map(|i| Aabb::from_center([(i * 37 % 101) as f32, (i * 53 % 7) as f32, 0.0], [1.0; 3]))
            .collect();
        boxes.push(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
        boxes.push(Aabb::NOWHERE);
        for size in [1, 7, 50, 1000] {
            let (ids, axis) = sorted(&boxes, &Summary::of(&boxes));
            assert_eq!((ids.len(), axis), (301, 0));
            let mut found = Vec::new();
            for part in parts(&boxes, &ids, axis, size) {
                let pairs = |one: &[u32], other: &[u32]| -> Vec<(u32, u32)> {
                    one.iter().flat_map(|&a| other.iter().map(move |&b| (a.min(b), a.max(b)))).collect()
                };
                let own = pairs(part.first, part.first).into_iter().filter(|(a, b)| a < b);
                let own: BTreeSet<_> = if part.second.is_empty() { own.collect() } else { BTreeSet::new() };
                found.extend(own);
                found.extend(pairs(part.first, part.second));
            }
            let overlap = |&(a, b): &(u32, u32)| boxes[a as usize].overlaps(&boxes[b as usize]);
            let mut overlapping: Vec<_> = found.into_iter().filter(overlap).collect();
            overlapping.sort_unstable();
            let wanted: Vec<_> = oracle::pairs(&boxes).iter().map(|p| (p.a, p.b)).collect();
            assert_eq!(overlapping, wanted, "blocks of {size}");
        }
    }
}

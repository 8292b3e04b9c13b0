//! Brute force: every pair is tested.

use super::hits::{Hits, Rule};
use crate::parallel::run_with;
use crate::simd::{BLOCK, EightBoxes, Simd, dispatch, next};
use crate::{Aabb, Pair};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of boxes of the larger set in a piece of work.
const PIECE: usize = 4096;

/// Tests every pair of valid boxes, eight at a time; returns how many are valid. The pairs are sorted.
pub(crate) fn brute_force(boxes: &[Aabb], rule: &Rule<'_>, hits: &mut Hits) -> usize {
    let mut blocks = std::mem::take(&mut hits.blocks);
    let mut ids = std::mem::take(&mut hits.ids);
    fill_blocks((boxes, 0), &mut blocks, &mut ids);
    dispatch!(test_all, boxes, &blocks, &ids, rule, hits);
    let valid = ids.len();
    (hits.blocks, hits.ids) = (blocks, ids);
    valid
}

/// Eight boxes. Aligned, as every second load would cross a cache line.
#[repr(align(32))]
#[derive(Clone, Copy, Debug)]
pub(super) struct Block(EightBoxes);

impl Block {
    /// Boxes that overlap nothing.
    const EMPTY: Self = Self([[f32::NAN; BLOCK]; 6]);

    fn set(&mut self, lane: usize, aabb: &Aabb) {
        let values = aabb.min.into_iter().chain(aabb.max);
        self.0.iter_mut().zip(values).for_each(|(row, value)| row[lane] = value);
    }
}

#[inline(always)]
fn test_all(
    simd: impl Simd,
    boxes: &[Aabb],
    blocks: &[Block],
    ids: &[u32],
    rule: &Rule<'_>,
    hits: &mut Hits,
) {
    for (i, &id) in ids.iter().enumerate() {
        let (aabb, from) = (&boxes[id as usize], hits.found.pairs.len());
        // The first block also has the box itself and those before it.
        let mut wanted = 255 & !((2 << (i % BLOCK)) - 1);
        for (block, Block(eight)) in blocks.iter().enumerate().skip(i / BLOCK) {
            let mut met = simd.overlaps_eight(eight, aabb) & wanted;
            wanted = 255;
            while let Some(lane) = next(&mut met) {
                hits.found.pairs.push(Pair { a: id, b: ids[block * BLOCK + lane] });
            }
        }
        hits.tests += (ids.len() - 1 - i) as u64;
        hits.keep(from, rule);
        if hits.is_full {
            break;
        }
    }
}

/// Tests every valid box of a set against every one of another set, whose ids are behind those of the first; returns how many are
/// valid. The larger set is read once, where it lies.
pub(crate) fn brute_force_across(
    first: &[Aabb],
    second: &[Aabb],
    rule: &Rule<'_>,
    hits: &mut [Hits],
) -> usize {
    let sides = [(first, 0), (second, first.len() as u32)];
    let [few, (many, first_id)] = if first.len() <= second.len() { sides } else { [sides[1], sides[0]] };
    let (mut blocks, mut ids) = (Vec::new(), Vec::new());
    fill_blocks(few, &mut blocks, &mut ids);
    let valid = AtomicUsize::new(ids.len());
    run_with(hits, many.len().div_ceil(PIECE), |hits, piece| {
        let start = piece * PIECE;
        let many = (&many[start..many.len().min(start + PIECE)], first_id + start as u32);
        let seen = dispatch!(test_piece, (&blocks, &ids), many, rule, hits);
        valid.fetch_add(seen, Ordering::Relaxed);
    });
    valid.into_inner()
}

/// Tests a few boxes against those of a list, given with the id of its first one. Returns how many of these are valid.
#[inline(always)]
fn test_piece(
    simd: impl Simd,
    (blocks, ids): (&[Block], &[u32]),
    (many, first_id): (&[Aabb], u32),
    rule: &Rule<'_>,
    hits: &mut Hits,
) -> usize {
    let (mut from, mut valid) = (hits.found.pairs.len(), 0);
    for (aabb, id) in many.iter().zip(first_id..).filter(|(aabb, _)| aabb.is_valid()) {
        valid += 1;
        for (block, Block(eight)) in blocks.iter().enumerate() {
            let mut met = simd.overlaps_eight(eight, aabb);
            while let Some(lane) = next(&mut met) {
                hits.found.pairs.push(Pair::new(ids[block * BLOCK + lane], id));
            }
        }
        from = hits.keep_many(from, rule);
        if hits.is_full {
            break;
        }
    }
    hits.tests += (valid * ids.len()) as u64;
    hits.keep(from, rule);
    valid
}

/// Brings the valid ones of some boxes, given with the id of the first one, into blocks.
fn fill_blocks((boxes, first_id): (&[Aabb], u32), blocks: &mut Vec<Block>, ids: &mut Vec<u32>) {
    blocks.clear();
    ids.clear();
    for (aabb, id) in boxes.iter().zip(first_id..).filter(|(aabb, _)| aabb.is_valid()) {
        let lane = ids.len() % BLOCK;
        if lane == 0 {
            blocks.push(Block::EMPTY);
        }
        ids.push(id);
        blocks.iter_mut().next_back().into_iter().for_each(|block| block.set(lane, aabb));
    }
}

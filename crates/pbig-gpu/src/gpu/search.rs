//! A call: searches all boxes at once if they fit, else in parts, which have all pairs together (contract 2).
//!
//! For parts the boxes are sorted along an axis and cut into blocks of half the size that fits. Each block is searched
//! alone, and together with every later block that its boxes reach. This assumes nothing about the boxes: in the worst case
//! each block is searched with all others.

use super::GpuError;
use super::error::Failure;
use super::job::Job;
use super::session::{Session, Sizes};
use super::sink::Sink;
use crate::layout::{BOX_BITS, DeviceBox, ordered};
use crate::pbig::sampled;
use pbig_core::{Aabb, DeviceFound, Pair};

/// Maximum number of boxes of one cell: their work items, 2^17 rows by 2^17 / 8 groups of 8 columns, fit 32 bits.
const MAX_BOXES_PER_CELL: u64 = 1 << 25;
const _: () = assert!(MAX_BOXES_PER_CELL <= 1 << BOX_BITS, "an entry names each box");

/// Fewest boxes of a part that is split further because a list was too large.
const MIN_SPLIT_BOXES: usize = 256;

/// Returns the most boxes that fit every buffer.
fn max_boxes(session: &Session) -> usize {
    let by_bytes = session.storage.max_buffer_bytes / size_of::<DeviceBox>() as u64;
    by_bytes.min(MAX_BOXES_PER_CELL) as usize
}

/// Searches in as few parts as fit. The result uses the memory of `pairs`.
pub(super) async fn search(
    session: &mut Session,
    job: &Job<'_>,
    mut pairs: Vec<Pair>,
) -> Result<DeviceFound, Failure> {
    let len = job.boxes.len();
    // The lists of a set say nothing about a set of another size.
    session.split = session.split.filter(|&(split, _)| split / 2 <= len && len / 2 <= split);
    let mut most = max_boxes(session).min(session.split.map_or(usize::MAX, |(_, most)| most));
    loop {
        session.sink = Sink::new(std::mem::take(&mut pairs), job.max_pairs);
        let result = if len <= most {
            search_whole(session, job).await
        } else {
            search_parts(session, job, most).await
        };
        match result {
            // Only the device knew the length of the list that was too large. Fewer boxes make it shorter.
            Err(Failure::Device(GpuError::TooLarge { .. })) if most > MIN_SPLIT_BOXES => {
                most = (most.min(len) / 2).max(MIN_SPLIT_BOXES);
                session.split = Some((len, most));
                // A set that was too large says nothing about its parts.
                (session.sizes, session.plan) = (Sizes::default(), None);
            }
            Err(failure) => return Err(failure),
            Ok(()) => return Ok(std::mem::take(&mut session.sink).end()),
        }
    }
}

async fn search_whole(session: &mut Session, job: &Job<'_>) -> Result<(), Failure> {
    if job.boxes.len() < 2 {
        session.sink.found.valid = job.valid();
        return Ok(());
    }
    session.run(job).await
}

async fn search_parts(session: &mut Session, job: &Job<'_>, most: usize) -> Result<(), Failure> {
    let (sorted, axis) = sorted(job.boxes);
    let parts = parts(job.boxes, &sorted, axis, most / 2);
    for part in &parts {
        let ids: Vec<u32> = [part.first, part.second].concat();
        let split = if part.second.is_empty() { 0 } else { part.first.len() as u32 };
        let (boxes, filters) = (of_ids(job.boxes, &ids), job.filters.map(|all| of_ids(all, &ids)));
        let filters = filters.as_deref();
        let found = session.sink.found.pairs.len();
        let part = Job { boxes: &boxes, filters, split: Some(split), is_sorted: false, ..*job };
        // Each part lies elsewhere.
        session.plan = None;
        session.run(&part).await?;
        name_pairs(&mut session.sink.found.pairs[found..], &ids);
    }
    session.plan = None;
    session.sink.found.valid = sorted.len() as u32;
    session.sink.found.report.parts = parts.len() as u32;
    Ok(())
}

pub(super) fn of_ids<T: Copy>(all: &[T], ids: &[u32]) -> Vec<T> {
    ids.iter().map(|&id| all[id as usize]).collect()
}

/// Replaces indices into a part by the ids of its boxes.
pub(super) fn name_pairs(pairs: &mut [Pair], ids: &[u32]) {
    for pair in pairs {
        *pair = Pair::new(ids[pair.a as usize], ids[pair.b as usize]);
    }
}

/// Ids of boxes to search: for all pairs of `first`, or for pairs between `first` and `second`.
#[derive(Debug, PartialEq)]
struct Part<'a> {
    first: &'a [u32],
    second: &'a [u32],
}

/// Returns the axis on which boxes are spread most, as the sample tells.
pub(super) fn widest_axis(sample: &[Aabb]) -> usize {
    let width = |k: usize| {
        let ends = sample.iter().map(|b| b.min[k]);
        ends.clone().fold(f32::MIN, f32::max) - ends.fold(f32::MAX, f32::min)
    };
    (0..3).max_by(|&j, &k| width(j).total_cmp(&width(k))).unwrap_or(0)
}

/// Returns the ids of the valid boxes, sorted along the axis on which they are spread most, and that axis.
fn sorted(boxes: &[Aabb]) -> (Vec<u32>, usize) {
    let axis = widest_axis(&sampled(boxes));
    let mut ids: Vec<u32> = (0..boxes.len() as u32).filter(|&id| boxes[id as usize].is_valid()).collect();
    ids.sort_unstable_by_key(|&id| (ordered(boxes[id as usize].min[axis]), id));
    (ids, axis)
}

/// Returns the parts for blocks of `size` sorted ids.
fn parts<'a>(boxes: &[Aabb], ids: &'a [u32], axis: usize, size: usize) -> Vec<Part<'a>> {
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
    use pbig_core::oracle;

    #[test]
    fn every_overlapping_pair_is_in_exactly_one_part() {
        let mut boxes: Vec<_> = (0..300u32)
            .map(|i| Aabb::from_center([(i * 37 % 101) as f32, (i * 53 % 7) as f32, 0.0], [1.0; 3]))
            .collect();
        boxes.push(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
        boxes.push(Aabb::NOWHERE);
        let overlap = |pair: &Pair| boxes[pair.a as usize].overlaps(&boxes[pair.b as usize]);
        for size in [1, 7, 50, 1000] {
            let (ids, axis) = sorted(&boxes);
            assert_eq!((ids.len(), axis), (301, 0));
            let mut found = Vec::new();
            for Part { first, second } in parts(&boxes, &ids, axis, size) {
                for (i, &a) in first.iter().enumerate() {
                    let others = if second.is_empty() { &first[i + 1..] } else { second };
                    found.extend(others.iter().map(|&b| Pair::new(a, b)).filter(overlap));
                }
            }
            found.sort_unstable();
            assert_eq!(found, oracle::pairs(&boxes), "blocks of {size}");
        }
    }
}

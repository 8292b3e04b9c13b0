//! A call: searches all boxes at once if they fit, else in parts, which have all pairs together (contract 2).
//!
//! For parts the boxes are sorted along an axis and cut into blocks of half the size that fits. Each block is searched
//! alone, and together with every later block that its boxes reach. This assumes nothing about the boxes: in the worst case
//! each block is searched with all others.

use super::GpuError;
use super::changes::Changes;
use super::declined::Declined;
use super::error::Failure;
use super::job::{Input, Job};
use super::session::{Session, Sizes};
use super::sink::Sink;
use crate::layout::{BOX_BITS, DeviceBox, Motion, ordered};
use crate::pbig::sampled;
use pbig_core::{Aabb, ChangeRequest, DeviceFound, Pair, ProxyFilter, SearchRequest};

/// Maximum number of boxes of one cell: their work items, 2^17 rows by 2^17 / 8 groups of 8 columns, fit 32 bits.
const MAX_BOXES_PER_CELL: u64 = 1 << 25;

/// Fewest boxes of a part that is split further because a list was too large.
const MIN_SPLIT_BOXES: usize = 256;

/// A search for all pairs or for changes.
#[derive(Clone, Copy)]
pub(super) struct Search<'a> {
    /// The boxes now.
    boxes: &'a [Aabb],
    filters: Option<&'a [ProxyFilter]>,
    /// The changes; none in a search for all pairs.
    changes: Option<Changes<'a>>,
    is_sorted: bool,
    max_pairs: u64,
}

impl<'a> Search<'a> {
    pub(super) fn all(request: &SearchRequest<'a>) -> Self {
        let &SearchRequest { boxes, filters, is_sorted, max_pairs } = request;
        Self { boxes, filters, changes: None, is_sorted, max_pairs }
    }

    pub(super) fn changes(request: &ChangeRequest<'a>) -> Self {
        let &ChangeRequest { boxes, filters, max_pairs, .. } = request;
        let (filters, changes) = (Some(filters), Some(Changes::of(request)));
        Self { boxes, filters, changes, is_sorted: true, max_pairs }
    }

    /// Returns the number of pairs at the last update.
    pub(super) fn kept(&self) -> u64 {
        self.changes.map_or(0, |changes| changes.kept)
    }

    /// Returns the job of all boxes at once.
    fn whole(&self, all_pairs_up_to: u32) -> Job<'a> {
        Job {
            boxes: self.boxes,
            input: self.changes.map_or(Input::Boxes, Input::Changes),
            filters: self.filters,
            split: 0,
            needs_grid: self.boxes.len() > all_pairs_up_to as usize,
            is_sorted: self.is_sorted,
        }
    }

    /// Returns the most boxes that fit every buffer, and an entry's bits.
    fn max_boxes(&self, session: &Session) -> usize {
        let largest = if self.changes.is_some() { size_of::<Motion>() } else { size_of::<DeviceBox>() };
        let by_bytes = session.storage.max_buffer_bytes / largest as u64;
        by_bytes.min(1 << BOX_BITS).min(MAX_BOXES_PER_CELL) as usize
    }
}

/// Searches in as few parts as fit. The result uses the memory of `pairs`.
pub(super) async fn search(
    session: &mut Session,
    request: &Search<'_>,
    mut pairs: Vec<Pair>,
) -> Result<DeviceFound, Failure> {
    if let Some(why) = session.declined.unseen(request.boxes.len()) {
        return Err(Failure::Declined(why));
    }
    // First, while the boxes are in the cache.
    let restarted = request.changes.map_or_else(Vec::new, |changes| changes.restarted());
    let len = request.boxes.len();
    // The lists of a set say nothing about a set of another size.
    session.split = session.split.filter(|&(split, _)| split / 2 <= len && len / 2 <= split);
    let mut most = request.max_boxes(session).min(session.split.map_or(usize::MAX, |(_, most)| most));
    loop {
        let mut sink = Sink::new(std::mem::take(&mut pairs), request.max_pairs, request.kept());
        let result = if len <= most {
            search_whole(session, request, &mut sink).await
        } else {
            search_parts(session, request, most, &mut sink).await
        };
        match result {
            // Only the device knew the length of the list that was too large. Fewer boxes make it shorter.
            Err(Failure::Device(GpuError::TooLarge { .. })) if most > MIN_SPLIT_BOXES => {
                most = (most.min(len) / 2).max(MIN_SPLIT_BOXES);
                session.split = Some((len, most));
                // A set that was too large says nothing about its parts.
                (session.sizes, session.plan) = (Sizes::default(), None);
                // The device may have gone on to the new boxes.
                session.uploaded.forget_motions();
            }
            Err(Failure::Declined(why)) => {
                session.declined.note(len, &why);
                return Err(Failure::Declined(why));
            }
            Err(failure) => return Err(failure),
            Ok(()) => {
                session.declined = Declined::default();
                sink.found.restarted = restarted;
                return Ok(sink.end());
            }
        }
    }
}

async fn search_whole(session: &mut Session, request: &Search<'_>, sink: &mut Sink) -> Result<(), Failure> {
    if request.boxes.len() < 2 {
        sink.found.valid = request.boxes.iter().filter(|one| one.is_valid()).count() as u32;
        return Ok(());
    }
    session.run(&request.whole(session.options.all_pairs_up_to), sink).await
}

async fn search_parts(
    session: &mut Session,
    request: &Search<'_>,
    most: usize,
    sink: &mut Sink,
) -> Result<(), Failure> {
    let bounds = request.changes.map(|changes| changes.bounds());
    let bounds = bounds.as_deref().unwrap_or(request.boxes);
    let (sorted, axis) = sorted(bounds);
    let parts = parts(bounds, &sorted, axis, most / 2);
    // The device gets one part after the other.
    session.uploaded.forget_motions();
    let motions = request.changes.map(|changes| changes.motions(0..request.boxes.len()));
    for part in &parts {
        let ids: Vec<u32> = [part.first, part.second].concat();
        let split = if part.second.is_empty() { 0 } else { part.first.len() as u32 };
        let motions = motions.as_deref().map(|all| of_ids(all, &ids));
        if motions.as_ref().is_some_and(|motions| motions.iter().all(|motion| motion.now == motion.before)) {
            continue;
        }
        let (boxes, filters) = (of_ids(request.boxes, &ids), request.filters.map(|all| of_ids(all, &ids)));
        let input = motions.as_deref().map_or(Input::Boxes, Input::Motions);
        let filters = filters.as_deref();
        let (found, ended) = (sink.found.pairs.len(), sink.found.ended.len());
        let job = Job { boxes: &boxes, input, filters, split, needs_grid: true, is_sorted: false };
        // Each part lies elsewhere.
        session.plan = None;
        session.run(&job, sink).await?;
        name_pairs(&mut sink.found.pairs[found..], &ids);
        name_pairs(&mut sink.found.ended[ended..], &ids);
    }
    session.plan = None;
    sink.found.valid = sorted.len() as u32;
    sink.found.report.parts = parts.len() as u32;
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

/// Returns the ids of the valid boxes, sorted along the axis on which they are spread most, and that axis.
pub(super) fn sorted(boxes: &[Aabb]) -> (Vec<u32>, usize) {
    let sample = sampled(boxes);
    let width = |k: usize| {
        let ends = sample.iter().map(|b| b.min[k]);
        ends.clone().fold(f32::MIN, f32::max) - ends.fold(f32::MAX, f32::min)
    };
    let axis = (0..3).max_by(|&j, &k| width(j).total_cmp(&width(k))).unwrap_or(0);
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
    use std::collections::BTreeSet;

    #[test]
    fn every_overlapping_pair_is_in_exactly_one_part() {
        let mut boxes: Vec<_> = (0..300u32)
            .map(|i| Aabb::from_center([(i * 37 % 101) as f32, (i * 53 % 7) as f32, 0.0], [1.0; 3]))
            .collect();
        boxes.push(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
        boxes.push(Aabb::NOWHERE);
        for size in [1, 7, 50, 1000] {
            let (ids, axis) = sorted(&boxes);
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

//! A call: searches all boxes at once if they fit, else in parts, which have all pairs together (contract 2).
//!
//! For parts the boxes are sorted along an axis and cut into blocks of half the size that fits. Each block is searched alone, and
//! against the earlier boxes that reach it. This assumes nothing about the boxes: in the worst case each block is searched against all
//! others. Several devices share the parts of a call.

use super::GpuError;
use super::error::Failure;
use super::job::Job;
use super::session::{Session, Sizes};
use super::sink::Sink;
use crate::layout::ordered;
use crate::pbig::sampled;
use pbig_core::{Aabb, DeviceFound, PairList, ProxyFilter};

/// Fewest boxes of a part that is split further because a list was too large.
const MIN_SPLIT_BOXES: usize = 256;

/// Searches in as few parts as fit. The result uses the memory of `pairs`.
pub(super) async fn search(
    session: &mut Session,
    job: &Job<'_>,
    mut pairs: PairList,
) -> Result<DeviceFound, Failure> {
    let len = job.boxes.len();
    // The lists of a set say nothing about a set of another size.
    session.split = session.split.filter(|&(split, _)| split / 2 <= len && len / 2 <= split);
    let mut most =
        (session.storage.max_boxes() as usize).min(session.split.map_or(usize::MAX, |(_, most)| most));
    loop {
        session.part_ids = None;
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
    let parts = parts(job, most / 2);
    for part in &parts {
        let (boxes, filters) = part.boxes_of(job);
        let filters = filters.as_deref();
        // Each part lies elsewhere.
        (session.plan, session.part_ids) = (None, Some(part.ids.clone()));
        session
            .run(&Job { boxes: &boxes, filters, split: Some(part.split), is_sorted: false, ..*job })
            .await?;
    }
    session.plan = None;
    session.sink.found.valid = job.valid();
    session.sink.found.report.parts = parts.len() as u32;
    Ok(())
}

/// Boxes to search: for all pairs, or if `split` is not 0, for pairs between those before it and the others.
#[derive(Debug)]
pub(super) struct Part {
    pub(super) ids: Vec<u32>,
    pub(super) split: u32,
}

impl Part {
    /// Copies the part's boxes and filters.
    pub(super) fn boxes_of(&self, job: &Job<'_>) -> (Vec<Aabb>, Option<Vec<ProxyFilter>>) {
        (of_ids(job.boxes, &self.ids), job.filters.map(|all| of_ids(all, &self.ids)))
    }
}

fn of_ids<T: Copy>(all: &[T], ids: &[u32]) -> Vec<T> {
    ids.iter().map(|&id| all[id as usize]).collect()
}

/// Returns the axis on which boxes are spread most, as the sample tells.
fn widest_axis(sample: &[Aabb]) -> usize {
    let width = |k: usize| {
        let ends = sample.iter().map(|b| b.min[k]);
        ends.clone().fold(f32::MIN, f32::max) - ends.fold(f32::MAX, f32::min)
    };
    (0..3).max_by(|&j, &k| width(j).total_cmp(&width(k))).unwrap_or(0)
}

/// Returns the parts of a job for blocks of `size` boxes. A job that is itself split has no pairs within a block.
pub(super) fn parts(job: &Job<'_>, size: usize) -> Vec<Part> {
    let axis = widest_axis(&sampled(job.boxes));
    let low = |id: &u32| ordered(job.boxes[*id as usize].min[axis]);
    let high = |id: &u32| ordered(job.boxes[*id as usize].max[axis]);
    let (size, split) = (size.max(1), job.split.unwrap_or(0));
    let is_valid = |id: &u32| job.boxes[*id as usize].is_valid();
    let mut ids: Vec<u32> = (split..job.boxes.len() as u32).filter(is_valid).collect();
    ids.sort_unstable_by_key(|id| (low(id), *id));
    let others: Vec<u32> = (0..split).filter(is_valid).collect();
    let mut parts = Vec::new();
    for (i, block) in ids.chunks(size).enumerate() {
        if split == 0 {
            parts.push(Part { ids: block.to_vec(), split: 0 });
        }
        let others = if split == 0 { &ids[..i * size] } else { &others };
        let reaching: Vec<u32> = others.iter().copied().filter(|id| high(id) >= low(&block[0])).collect();
        for some in reaching.chunks(size) {
            let end = some.iter().map(high).max();
            let met = block.iter().copied().take_while(|id| Some(low(id)) <= end);
            parts.push(Part { ids: some.iter().copied().chain(met).collect(), split: some.len() as u32 });
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::{Pair, SearchRequest, oracle};

    #[test]
    fn every_overlapping_pair_is_in_exactly_one_part() {
        let mut boxes: Vec<_> = (0..300u32)
            .map(|i| Aabb::from_center([(i * 37 % 101) as f32, (i * 53 % 7) as f32, 0.0], [1.0; 3]))
            .collect();
        boxes.push(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
        boxes.push(Aabb::NOWHERE);
        let overlap = |pair: &Pair| boxes[pair.a as usize].overlaps(&boxes[pair.b as usize]);
        let request = SearchRequest { boxes: &boxes, filters: None, is_sorted: false, max_pairs: u64::MAX };
        for (size, split) in
            [1, 7, 50, 1000].into_iter().flat_map(|size| [0, 1, 150].map(|split| (size, split)))
        {
            let job = Job { split: Some(split), ..Job::all(&request) };
            let mut found = Vec::new();
            for Part { ids, split } in parts(&job, size) {
                assert!(ids.len() <= 2 * size);
                for (i, &a) in ids.iter().enumerate() {
                    let others = &ids[(i + 1).max(split as usize)..];
                    let is_wanted = split == 0 || i < split as usize;
                    found.extend(
                        others.iter().filter(|_| is_wanted).map(|&b| Pair::new(a, b)).filter(overlap),
                    );
                }
            }
            found.sort_unstable();
            let is_wanted = |pair: &Pair| split == 0 || (pair.a < split) != (pair.b < split);
            let wanted: Vec<Pair> = oracle::pairs(&boxes).into_iter().filter(is_wanted).collect();
            assert_eq!(found, wanted, "blocks of {size}, split at {split}");
        }
    }
}

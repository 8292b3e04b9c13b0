//! A call: searches all boxes at once if they fit, else in parts.

use super::error::Failure;
use super::session::{Input, Job, Session};
use super::sink::Sink;
use super::{ChangeRequest, GpuError, GpuFound, GpuPlan, SearchRequest, parts};
use crate::layout::{BOX_BITS, Located, Motion};
use crate::pbig::Summary;
use crate::report::{Checks, GpuReport};
use crate::{Aabb, GpuOptions, Pair, ProxyFilter};
use rayon::prelude::*;

/// Most boxes of one cell: their work items, 2^17 rows by 2^17 / 8 groups of 8 columns, fit 32 bits.
const MAX_BOXES_PER_CELL: u64 = 1 << 25;

/// Fewest boxes of a part that is split further because a list was too large.
const MIN_SPLIT_BOXES: usize = 256;

/// Most cells of a plan.
const MAX_CELLS: u64 = 1 << 28;

/// A search for all pairs or for changes.
pub(super) struct Task<'a> {
    /// The boxes; in a search for changes the bounds of each box now and at the last update.
    pub(super) boxes: &'a [Aabb],
    pub(super) filters: Option<&'a [ProxyFilter]>,
    /// The changes; none in a search for all pairs.
    pub(super) changes: Option<&'a ChangeRequest<'a>>,
    /// Most pairs.
    pub(super) limit: u64,
    pub(super) options: &'a GpuOptions,
}

impl<'a> Task<'a> {
    /// Returns the task to find all pairs of a request.
    pub(super) fn all_pairs(request: &SearchRequest<'a>) -> Self {
        let &SearchRequest { boxes, filters, config } = request;
        Self { boxes, filters, changes: None, limit: config.limits.pairs(), options: &config.gpu }
    }
}

/// Searches in as few parts as fit.
pub(super) fn search(session: &mut Session, task: &Task<'_>, cell_factor: f32) -> Result<GpuFound, Failure> {
    let summary = Summary::of(task.boxes);
    let len = task.boxes.len();
    let mut most = boxes_at_once(session, task);
    loop {
        let mut sink = new_sink(session, task.limit);
        let result = if len <= most {
            search_whole(session, task, &summary, cell_factor, &mut sink)
        } else {
            search_parts(session, task, &summary, cell_factor, most, &mut sink)
        };
        match result {
            // Only the device knew the length of the list that was too large. Fewer boxes make it shorter.
            Err(Failure::Device(GpuError::TooLarge { .. })) if most > MIN_SPLIT_BOXES => {
                most = (most.min(len) / 2).max(MIN_SPLIT_BOXES);
                session.split = Some((len, most));
                session.reset_capacities();
            }
            Err(failure) => return Err(failure),
            Ok(plan) => return Ok(found(sink, plan, summary.valid)),
        }
    }
}

fn new_sink(session: &Session, limit: u64) -> Sink {
    let device = &session.device;
    let (adapter, subgroups) = (device.name.clone(), device.has_subgroups);
    let report = GpuReport { adapter, subgroups, parts: 1, ..GpuReport::default() };
    Sink { pairs: Vec::new(), pair_count: 0, words: 0, limit, checks: Checks::default(), report }
}

fn found(sink: Sink, plan: Option<GpuPlan>, valid: u32) -> GpuFound {
    let Sink { pairs, pair_count, words, checks, mut report, .. } = sink;
    report.compression = if pair_count > 0 { words as f64 / (2 * pair_count) as f64 } else { 0.0 };
    GpuFound { pairs, restarted: Vec::new(), valid, plan, checks, report }
}

/// Returns the most boxes to search at once, by the limits and by earlier calls.
fn boxes_at_once(session: &mut Session, task: &Task<'_>) -> usize {
    let len = task.boxes.len();
    // The lists of a set say nothing about a set of another size.
    session.split = session.split.filter(|&(split, _)| split / 2 <= len && len / 2 <= split);
    max_boxes(session, task).min(session.split.map_or(usize::MAX, |(_, most)| most))
}

/// Returns the most boxes that fit every buffer, and an entry's bits.
fn max_boxes(session: &Session, task: &Task<'_>) -> usize {
    let largest = if task.changes.is_some() { size_of::<Motion>() } else { size_of::<Located>() };
    let by_bytes = session.storage.max_buffer_bytes() / largest as u64;
    by_bytes.min(1 << BOX_BITS).min(MAX_BOXES_PER_CELL) as usize
}

/// Returns an error if there may be more entries than 32 bits count: 4 x 4 x 4 for a box in each level but the last.
fn check_entries(plan: &GpuPlan, boxes: usize) -> Result<(), GpuError> {
    let entries = boxes as u64 * (64 * (plan.levels.len() as u64 - 1) + 1);
    let limit = u64::from(u32::MAX);
    if entries <= limit { Ok(()) } else { Err(GpuError::TooLarge { what: "entries", bytes: entries, limit }) }
}

fn search_whole(
    session: &mut Session,
    task: &Task<'_>,
    summary: &Summary,
    cell_factor: f32,
    sink: &mut Sink,
) -> Result<Option<GpuPlan>, Failure> {
    if summary.valid < 2 {
        return Ok(None);
    }
    let needs_grid = task.boxes.len() > task.options.all_pairs_up_to as usize;
    let plan = if needs_grid { Some(plan(session, summary, task, cell_factor)?) } else { None };
    let input = task.changes.map_or(Input::Boxes(task.boxes), Input::Changes);
    session.run(&Job { input, filters: task.filters, split: 0, plan: plan.as_ref() }, sink)?;
    Ok(plan)
}

fn plan(
    session: &Session,
    summary: &Summary,
    task: &Task<'_>,
    cell_factor: f32,
) -> Result<GpuPlan, GpuError> {
    let max_cells = (session.storage.max_buffer_bytes() / 8).min(MAX_CELLS) as u32;
    let plan = GpuPlan::new(summary, task.options, cell_factor, max_cells);
    check_entries(&plan, summary.valid as usize).map(|()| plan)
}

fn search_parts(
    session: &mut Session,
    task: &Task<'_>,
    summary: &Summary,
    cell_factor: f32,
    most: usize,
    sink: &mut Sink,
) -> Result<Option<GpuPlan>, Failure> {
    let (sorted, axis) = parts::sorted(task.boxes, summary);
    let parts = parts::parts(task.boxes, &sorted, axis, most / 2);
    // The device gets one part after the other.
    session.uploaded.forget_motions();
    let motions = task.changes.map(|changes| changes.motions(0..task.boxes.len()));
    let mut last = None;
    for part in &parts {
        let ids: Vec<u32> = [part.first, part.second].concat();
        let split = if part.second.is_empty() { 0 } else { part.first.len() as u32 };
        let motions = motions.as_deref().map(|all| of_ids(all, &ids));
        if motions.as_ref().is_some_and(|motions| motions.iter().all(|motion| motion.now == motion.before)) {
            continue;
        }
        let boxes = of_ids(task.boxes, &ids);
        let filters = task.filters.map(|all| of_ids(all, &ids));
        let plan = plan(session, &Summary::of(&boxes), task, cell_factor)?;
        let input = motions.as_deref().map_or(Input::Boxes(&boxes), Input::Motions);
        let before = sink.pairs.len();
        session.run(&Job { input, filters: filters.as_deref(), split, plan: Some(&plan) }, sink)?;
        name_pairs(&mut sink.pairs[before..], &ids);
        last = Some(plan);
    }
    sink.report.parts = parts.len() as u32;
    Ok(last)
}

fn of_ids<T: Copy>(all: &[T], ids: &[u32]) -> Vec<T> {
    ids.iter().map(|&id| all[id as usize]).collect()
}

/// Replaces indices into a part by the ids of its boxes.
fn name_pairs(pairs: &mut [Vec<Pair>], ids: &[u32]) {
    let name = |pair: &mut Pair| *pair = Pair::new(ids[pair.a as usize], ids[pair.b as usize]);
    pairs.par_iter_mut().for_each(|piece| piece.iter_mut().for_each(name));
}

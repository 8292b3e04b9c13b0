//! What a call searches: everything at once where it fits, or in parts.

use super::error::Failure;
use super::session::{Input, Job, Session};
use super::sink::Sink;
use super::{ChangeRequest, GpuError, Request, parts};
use crate::cpu::found::Found;
use crate::layout::{BOX_BITS, Located, Motion};
use crate::plan::{Chosen, GpuPlan, Plan, Summary};
use crate::report::{Checks, GpuReport};
use crate::{Aabb, Config, ProxyFilter, Strategy};

/// Boxes up to which every pair is tested, without a grid. Avril's table 7 puts the crossover at 1000.
const SMALL_SCENE: usize = 1024;

/// Boxes of one cell whose work items, 2^17 rows against 2^17 / 8 times 8 columns, 32 bits can count.
const MOST_IN_A_CELL: u64 = 1 << 25;

/// Fewest boxes that are split further for want of room.
const SMALLEST_PART: usize = 256;

/// What a search is for.
pub(super) struct Task<'a> {
    /// The boxes; in a search for changes what each reaches, now or before.
    pub(super) boxes: &'a [Aabb],
    pub(super) filters: Option<&'a [ProxyFilter]>,
    /// None: for all pairs that overlap.
    pub(super) changes: Option<&'a ChangeRequest<'a>>,
    pub(super) accept: Option<&'a (dyn Fn(u32, u32) -> bool + Sync)>,
    /// Most pairs.
    pub(super) limit: u64,
    pub(super) summary: &'a Summary,
    pub(super) config: &'a Config,
}

impl<'a> Task<'a> {
    /// All pairs that overlap.
    pub(super) fn new(request: &Request<'a>) -> Self {
        let &Request { boxes, filters, accept, summary, config } = request;
        Self { boxes, filters, changes: None, accept, limit: config.limits.max_pairs, summary, config }
    }
}

/// What a search came to.
pub(super) struct Searched {
    pub(super) checks: Checks,
    pub(super) plan: Plan,
    pub(super) gpu: GpuReport,
    pub(super) pairs: u64,
}

/// Searches in as few parts as fit.
pub(super) fn search(
    session: &mut Session,
    task: &Task<'_>,
    crowding: f32,
    found: &mut Found,
) -> Result<Searched, Failure> {
    let len = task.boxes.len();
    let mut most = boxes_at_once(session, task);
    loop {
        found.clear();
        let mut sink = Sink {
            found,
            used: 0,
            pairs: 0,
            written: 0,
            limit: task.limit,
            ids: None,
            accept: task.accept,
            checks: Checks::default(),
            report: new_report(session),
        };
        let result = if task.boxes.len() <= most {
            search_whole(session, task, crowding, &mut sink)
        } else {
            search_parts(session, task, crowding, most, &mut sink)
        };
        match result {
            // A list that only the device knows the length of was too long: fewer boxes make it shorter.
            Err(Failure::Device(GpuError::TooLarge { .. })) if most > SMALLEST_PART => {
                most = (most.min(len) / 2).max(SMALLEST_PART);
                session.parted = Some((len, most));
                session.forget_needs();
            }
            Err(failure) => return Err(failure),
            Ok(plan) => {
                let words = sink.report.compression;
                let pairs = sink.written;
                sink.report.compression = if pairs > 0 { words / (2 * pairs) as f64 } else { 0.0 };
                return Ok(Searched { checks: sink.checks, plan, gpu: sink.report, pairs });
            }
        }
    }
}

fn new_report(session: &Session) -> GpuReport {
    let engine = &session.engine;
    GpuReport { adapter: engine.name.clone(), subgroups: engine.subgroups, parts: 1, ..GpuReport::default() }
}

/// How many boxes are searched at once, as far as is known.
fn boxes_at_once(session: &mut Session, task: &Task<'_>) -> usize {
    let len = task.boxes.len();
    // What one set needed says nothing about one of another size.
    session.parted = session.parted.filter(|&(parted, _)| parted / 2 <= len && len / 2 <= parted);
    most_boxes(session, task).min(session.parted.map_or(usize::MAX, |(_, most)| most))
}

/// How many boxes fit: each has a place in every buffer, and a number in an entry.
fn most_boxes(session: &Session, task: &Task<'_>) -> usize {
    let largest = if task.changes.is_some() { size_of::<Motion>() } else { size_of::<Located>() };
    let by_bytes = session.storage.most_bytes() / largest as u64;
    by_bytes.min(1 << BOX_BITS).min(MOST_IN_A_CELL) as usize
}

/// Entries are counted in 32 bits: at most 4 x 4 x 4 for a box in each level but the last.
fn check_entries(plan: &GpuPlan, boxes: usize) -> Result<(), GpuError> {
    let entries = boxes as u64 * (64 * (plan.levels.len() as u64 - 1) + 1);
    let limit = u64::from(u32::MAX);
    if entries <= limit { Ok(()) } else { Err(GpuError::TooLarge { what: "entries", bytes: entries, limit }) }
}

fn search_whole(
    session: &mut Session,
    task: &Task<'_>,
    crowding: f32,
    sink: &mut Sink<'_>,
) -> Result<Plan, Failure> {
    let valid = task.summary.valid;
    if valid < 2 {
        return Ok(Plan { boxes: valid, ..Plan::default() });
    }
    let brute = task.config.strategy == Strategy::Auto && task.boxes.len() <= SMALL_SCENE;
    let plan = (!brute).then(|| plan(session, task.summary, task.config, crowding));
    plan.as_ref().map_or(Ok(()), |plan| check_entries(plan, task.boxes.len()))?;
    session.run(&whole(task, plan.as_ref()), sink)?;
    let (chosen, swept) = if plan.is_none() { (Chosen::Brute, valid) } else { (Chosen::Pbig, 0) };
    Ok(Plan { chosen, swept, boxes: valid, gpu: plan, ..Plan::default() })
}

/// All boxes of a task as one job.
fn whole<'a>(task: &Task<'a>, plan: Option<&'a GpuPlan>) -> Job<'a> {
    let input = task.changes.map_or(Input::Boxes(task.boxes), Input::Changes);
    Job { input, filters: task.filters, split: 0, plan, config: task.config }
}

fn plan(session: &Session, summary: &Summary, config: &Config, crowding: f32) -> GpuPlan {
    let most_cells = (session.storage.most_bytes() / 8).min(1 << 28) as u32;
    GpuPlan::new(summary, config, crowding, most_cells)
}

fn search_parts(
    session: &mut Session,
    task: &Task<'_>,
    crowding: f32,
    most: usize,
    sink: &mut Sink<'_>,
) -> Result<Plan, Failure> {
    let (sorted, axis) = parts::sorted(task.boxes, task.summary);
    let parts = parts::parts(task.boxes, &sorted, axis, most / 2);
    // The device gets to know a part at a time.
    session.mirror.forget_motions();
    let all = task.changes.map(|changes| changes.motions(0..task.boxes.len()));
    let mut last = None;
    for part in &parts {
        let ids: Vec<u32> = [part.first, part.second].concat();
        let motions: Option<Vec<Motion>> =
            all.as_ref().map(|all| ids.iter().map(|&id| all[id as usize]).collect());
        if motions.as_ref().is_some_and(|motions| motions.iter().all(|motion| motion.now == motion.before)) {
            continue;
        }
        let boxes: Vec<Aabb> = ids.iter().map(|&id| task.boxes[id as usize]).collect();
        let filters: Option<Vec<ProxyFilter>> =
            task.filters.map(|all| ids.iter().map(|&id| all[id as usize]).collect());
        let split = if part.second.is_empty() { 0 } else { part.first.len() as u32 };
        let plan = plan(session, &Summary::of(&boxes, None), task.config, crowding);
        check_entries(&plan, boxes.len())?;
        let config = task.config;
        let input = motions.as_deref().map_or(Input::Boxes(&boxes), Input::Motions);
        let job = Job { input, filters: filters.as_deref(), split, plan: Some(&plan), config };
        let mut own = Sink { ids: Some(&ids), found: &mut *sink.found, report: sink.report.clone(), ..*sink };
        session.run(&job, &mut own)?;
        (sink.used, sink.pairs, sink.written) = (own.used, own.pairs, own.written);
        (sink.checks, sink.report) = (own.checks, own.report);
        last = Some(plan);
    }
    sink.report.parts = parts.len() as u32;
    let valid = task.summary.valid;
    Ok(Plan { chosen: Chosen::Pbig, boxes: valid, gpu: last, ..Plan::default() })
}

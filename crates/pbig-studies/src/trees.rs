//! The sides of a race: pbig kept on all threads and on one, parry's tree kept or rebuilt, and obvhs.

use glam::Vec3A;
use obvhs::bvh2::Bvh2;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use parry_peer::bounding_volume::Aabb as ParryAabb;
use parry_peer::math::Vector;
use parry_peer::partitioning::{Bvh, BvhBuildStrategy, BvhLeafUpdateStatus, BvhWorkspace};
use pbig_core::{Aabb, BroadPhase, Config, ProxyFilter};
use pbig_harness::bench::timed;
use pbig_harness::output::Failure;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Pbig, kept from frame to frame on all threads and again on one.
pub(crate) struct Kept {
    all: BroadPhase,
    lone: BroadPhase,
    pool: ThreadPool,
}

impl Kept {
    pub(crate) fn new(config: Config) -> Result<Self, Failure> {
        let pool = ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.map_err(|error| Failure::Input(error.to_string()))?;
        Ok(Self { all: BroadPhase::new(config)?, lone: BroadPhase::new(config)?, pool })
    }

    /// Updates one of both with changed boxes, of which invalid ones are removed; returns the milliseconds. The clock runs inside
    /// the pool, as waking its thread takes longer than a small update.
    pub(crate) fn update(
        &mut self,
        is_lone: bool,
        boxes: &[Aabb],
        changed: &Changed,
    ) -> Result<f64, Failure> {
        let Self { all, lone, pool } = self;
        let work = |broad_phase: &mut BroadPhase| {
            for &id in &changed.absent {
                broad_phase.remove(id);
            }
            broad_phase.set_many(&changed.present, |id| Some((boxes[id as usize], ProxyFilter::ALL)))?;
            broad_phase.update().map(|_| ())
        };
        let (done, ms) = if is_lone { pool.install(|| timed(|| work(lone))) } else { timed(|| work(all)) };
        Ok(done.map(|()| ms)?)
    }

    /// Returns the number of pairs of each.
    pub(crate) fn pairs(&self) -> [usize; 2] {
        [self.all.pair_count(), self.lone.pair_count()]
    }
}

/// The ids of changed boxes that are valid, and of those that are not.
#[derive(Default)]
pub(crate) struct Changed {
    present: Vec<u32>,
    absent: Vec<u32>,
}

impl Changed {
    pub(crate) fn new(changed: &[u32], boxes: &[Aabb]) -> Self {
        let (present, absent) = changed.iter().partition(|id| boxes[**id as usize].is_valid());
        Self { present, absent }
    }
}

pub(crate) fn for_parry(boxes: &[Aabb]) -> Vec<ParryAabb> {
    let vector = |v: [f32; 3]| Vector::new(v[0], v[1], v[2]);
    boxes.iter().map(|b| ParryAabb::new(vector(b.min), vector(b.max))).collect()
}

/// The way to bring a kept tree up to date.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Refit {
    /// All of it, on one thread, after improving a part.
    Whole,
    /// As above, on all threads.
    Parallel,
    /// Only what is above the changed leaves; improves nothing.
    Part,
}

/// Parry 0.31's tree, kept from frame to frame as rapier keeps it.
pub(crate) struct Parry {
    refit: Refit,
    /// True if only pairs with a moved box are wanted.
    partial: bool,
    /// 0 leaves no leaf marked as changed; the smallest number marks them and makes no box larger.
    margin: f32,
    tree: Bvh,
    workspace: BvhWorkspace,
    updates: Vec<(ParryAabb, u32, f32)>,
    removed: Vec<u32>,
    changed: Vec<u32>,
    changed_before: Vec<u32>,
    statuses: Vec<BvhLeafUpdateStatus>,
    found: Vec<(u32, u32)>,
}

impl Parry {
    /// Builds the tree of all valid boxes.
    pub(crate) fn new(boxes: &[Aabb], refit: Refit, partial: bool) -> Self {
        let mut workspace = BvhWorkspace::default();
        let valid = for_parry(boxes).into_iter().enumerate().filter(|(i, _)| boxes[*i].is_valid());
        let mut tree = Bvh::from_iter(BvhBuildStrategy::Binned, valid);
        // A new tree's leaves all count as changed, until the next refit.
        tree.refit(&mut workspace);
        Self {
            refit,
            partial,
            margin: if partial { f32::MIN_POSITIVE } else { 0.0 },
            tree,
            workspace,
            updates: vec![],
            removed: vec![],
            changed: vec![],
            changed_before: vec![],
            statuses: vec![],
            found: vec![],
        }
    }

    pub(crate) fn name(&self) -> &'static str {
        match (self.refit, self.partial) {
            (Refit::Whole, false) => "parry 0.31, one thread",
            (Refit::Whole, true) => "parry 0.31, changed pairs",
            (Refit::Parallel, _) => "parry 0.31, all threads",
            (Refit::Part, _) => "parry 0.31, refit_partial",
        }
    }

    /// Takes in the changed boxes, of which invalid ones are removed; not measured.
    pub(crate) fn prepare(&mut self, boxes: &[Aabb], moved: &[u32]) {
        self.updates.clear();
        self.removed.clear();
        for &id in moved {
            let i = id as usize;
            if boxes[i].is_valid() {
                self.updates.push((for_parry(&boxes[i..=i])[0], id, self.margin));
            } else {
                self.removed.push(id);
            }
        }
        self.changed_before = std::mem::replace(&mut self.changed, moved.to_vec());
    }

    /// One frame: boxes in, pairs out.
    pub(crate) fn frame(&mut self) {
        let Self { tree, workspace, updates, removed, statuses, found, .. } = self;
        found.clear();
        removed.iter().for_each(|&id| tree.remove(id));
        if self.refit == Refit::Parallel {
            tree.insert_or_update_batch_partially_parallel(updates, statuses);
            tree.optimize_incremental(workspace);
            tree.refit_parallel(workspace);
            *found = tree.traverse_bvtt_single_tree_parallel::<false>();
            return;
        }
        for &(aabb, id, margin) in updates.iter() {
            tree.insert_or_update_partially(aabb, id, margin);
        }
        if self.refit == Refit::Whole {
            tree.optimize_incremental(workspace);
            tree.refit(workspace);
        } else {
            tree.refit_partial(&self.changed_before, &self.changed);
        }
        if self.partial {
            tree.traverse_bvtt_single_tree::<true>(workspace, &mut |a, b| found.push((a, b)));
        } else {
            tree.traverse_bvtt_single_tree::<false>(workspace, &mut |a, b| found.push((a, b)));
        }
    }

    /// The number of pairs of the last frame.
    pub(crate) fn pairs(&self) -> usize {
        self.found.len()
    }

    /// All pairs of the tree as it is, to compare; a frame that gives a part of them must give exactly those
    /// of moved boxes.
    pub(crate) fn all_pairs(&mut self) -> usize {
        let mut all = Vec::new();
        self.tree.traverse_bvtt_single_tree::<false>(&mut self.workspace, &mut |a, b| all.push((a, b)));
        let moved = |id: &u32| self.changed.binary_search(id).is_ok();
        let wanted = all.iter().filter(|(a, b)| moved(a) || moved(b)).count();
        if wanted == self.found.len() { all.len() } else { usize::MAX }
    }
}

/// Parry from nothing: the tree, then its pairs. The list of pairs keeps its memory.
pub(crate) fn parry_rebuilt(boxes: &[ParryAabb], found: &mut Vec<(u32, u32)>) -> usize {
    found.clear();
    let tree = Bvh::from_iter(BvhBuildStrategy::Binned, boxes.iter().copied().enumerate());
    let mut workspace = BvhWorkspace::default();
    tree.traverse_bvtt_single_tree::<false>(&mut workspace, &mut |a, b| found.push((a, b)));
    found.len()
}

/// obvhs from nothing, with its fastest preset; builder and tree keep their memory.
#[derive(Default)]
pub(crate) struct Obvhs {
    boxes: Vec<obvhs::aabb::Aabb>,
    builder: PlocBuilder,
    tree: Bvh2,
    stack: Vec<(u32, u32)>,
}

impl Obvhs {
    pub(crate) fn prepare(&mut self, boxes: &[Aabb]) {
        let aabb = |b: &Aabb| obvhs::aabb::Aabb::new(Vec3A::from_array(b.min), Vec3A::from_array(b.max));
        self.boxes = boxes.iter().map(aabb).collect();
    }

    pub(crate) fn rebuilt(&mut self, found: &mut Vec<(u32, u32)>) -> usize {
        let ids: Vec<u32> = (0..self.boxes.len() as u32).collect();
        self.builder.build_with_bvh(
            &mut self.tree,
            PlocSearchDistance::Minimum,
            &self.boxes,
            ids,
            SortPrecision::U64,
            0,
        );
        found.clear();
        self.traverse(found);
        found.len()
    }

    /// The crate has no traversal of a tree against itself: from the root, each node against itself and
    /// each pair of overlapping nodes once. Its leaves hold one box each.
    fn traverse(&mut self, found: &mut Vec<(u32, u32)>) {
        let Self { tree, stack, .. } = self;
        if tree.nodes.is_empty() {
            return;
        }
        stack.push((0, 0));
        while let Some((a, b)) = stack.pop() {
            let (one, other) = (&tree.nodes[a as usize], &tree.nodes[b as usize]);
            let (left, right) = (one.first_index, other.first_index);
            if a == b && one.is_leaf() {
                continue;
            }
            match (one.is_leaf(), other.is_leaf()) {
                _ if a == b => stack.extend([(left, left), (left + 1, left + 1), (left, left + 1)]),
                _ if !one.aabb.intersect_aabb(&other.aabb) => {}
                (true, true) => {
                    found.push((
                        tree.primitive_indices[left as usize],
                        tree.primitive_indices[right as usize],
                    ));
                }
                (true, false) => stack.extend([(a, right), (a, right + 1)]),
                (false, true) => stack.extend([(left, b), (left + 1, b)]),
                (false, false) => {
                    stack.extend([(left, right), (left, right + 1), (left + 1, right), (left + 1, right + 1)])
                }
            }
        }
    }
}

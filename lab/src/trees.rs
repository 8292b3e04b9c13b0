//! The sides of a race: pbig kept on all threads and on one, parry's tree kept or rebuilt, and obvhs.

use obvhs::bvh2::Bvh2;
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};
use parry_peer::bounding_volume::Aabb as ParryAabb;
use parry_peer::partitioning::{Bvh, BvhBuildStrategy, BvhLeafUpdateStatus, BvhWorkspace};
use pbig_core::{Aabb, BroadPhase, Config, ProxyFilter};
use pbig_harness::bench::timed;
use pbig_harness::output::Failure;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Pbig, kept from frame to frame on all threads and again on one.
pub(crate) struct Kept {
    sides: [BroadPhase; 2],
    pool: ThreadPool,
}

impl Kept {
    pub(crate) fn new(config: Config) -> Result<Self, Failure> {
        let pool = ThreadPoolBuilder::new().num_threads(1).build().map_err(|error| error.to_string())?;
        Ok(Self { sides: [BroadPhase::new(config)?, BroadPhase::new(config)?], pool })
    }

    /// Updates side 0, on all threads, or 1, on one, with changed boxes, of which invalid ones are removed; returns the
    /// milliseconds. The clock runs inside the pool, as waking its thread takes longer than a small update.
    pub(crate) fn update(&mut self, side: usize, boxes: &[Aabb], changed: &Changed) -> Result<f64, Failure> {
        let (present, absent) = changed;
        let broad_phase = &mut self.sides[side];
        let work = || {
            for &id in absent {
                broad_phase.remove(id);
            }
            broad_phase.set_many(present, |id| Some((boxes[id as usize], ProxyFilter::ALL)))?;
            broad_phase.update().map(|_| ())
        };
        let (done, ms) = if side == 1 { self.pool.install(|| timed(work)) } else { timed(work) };
        Ok(done.map(|()| ms)?)
    }

    /// Returns the number of pairs of each.
    pub(crate) fn pairs(&self) -> [usize; 2] {
        self.sides.each_ref().map(BroadPhase::pair_count)
    }
}

/// The ids of changed boxes that are valid, and of the others.
pub(crate) type Changed = (Vec<u32>, Vec<u32>);

pub(crate) fn partition(boxes: &[Aabb], ids: &[u32]) -> Changed {
    ids.iter().partition(|id| boxes[**id as usize].is_valid())
}

pub(crate) fn for_parry(aabb: &Aabb) -> ParryAabb {
    ParryAabb::new(aabb.min.into(), aabb.max.into())
}

/// The way to bring a kept tree up to date.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Refit {
    /// The whole tree, on one thread, after improving a part.
    #[default]
    Whole,
    /// Like `Whole`, for the pairs with a moved box alone.
    Changed,
    /// Like `Whole`, on all threads.
    Parallel,
}

/// Parry 0.31's tree, kept from frame to frame as rapier keeps it.
#[derive(Default)]
pub(crate) struct Parry {
    refit: Refit,
    tree: Bvh,
    workspace: BvhWorkspace,
    updates: Vec<(ParryAabb, u32, f32)>,
    removed: Vec<u32>,
    changed: Vec<u32>,
    statuses: Vec<BvhLeafUpdateStatus>,
    found: Vec<(u32, u32)>,
}

impl Parry {
    /// Builds the tree of all valid boxes.
    pub(crate) fn new(boxes: &[Aabb], refit: Refit) -> Self {
        let mut workspace = BvhWorkspace::default();
        let valid = boxes.iter().map(for_parry).enumerate().filter(|(i, _)| boxes[*i].is_valid());
        let mut tree = Bvh::from_iter(BvhBuildStrategy::Binned, valid);
        // A new tree's leaves all count as changed, until the next refit.
        tree.refit(&mut workspace);
        Self { refit, tree, workspace, ..Self::default() }
    }

    /// Takes in the changed boxes, of which invalid ones are removed; not measured.
    pub(crate) fn prepare(&mut self, boxes: &[Aabb], moved: &[u32]) {
        let (present, removed) = partition(boxes, moved);
        // 0 leaves no leaf marked as changed; the smallest number marks them and makes no box larger.
        let margin = if self.refit == Refit::Changed { f32::MIN_POSITIVE } else { 0.0 };
        self.updates = present.iter().map(|&id| (for_parry(&boxes[id as usize]), id, margin)).collect();
        self.removed = removed;
        self.changed = moved.to_vec();
    }

    /// One frame: boxes in, pairs out.
    pub(crate) fn frame(&mut self) {
        let Self { refit, tree, workspace, updates, removed, statuses, found, .. } = self;
        found.clear();
        removed.iter().for_each(|&id| tree.remove(id));
        if *refit == Refit::Parallel {
            tree.insert_or_update_batch_partially_parallel(updates, statuses);
            tree.optimize_incremental(workspace);
            tree.refit_parallel(workspace);
            *found = tree.traverse_bvtt_single_tree_parallel::<false>();
            return;
        }
        for &(aabb, id, margin) in updates.iter() {
            tree.insert_or_update_partially(aabb, id, margin);
        }
        tree.optimize_incremental(workspace);
        tree.refit(workspace);
        let mut push = |a, b| found.push((a, b));
        match refit {
            Refit::Changed => tree.traverse_bvtt_single_tree::<true>(workspace, &mut push),
            _ => tree.traverse_bvtt_single_tree::<false>(workspace, &mut push),
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
        let aabb = |b: &Aabb| obvhs::aabb::Aabb::new(b.min.into(), b.max.into());
        self.boxes = boxes.iter().map(aabb).collect();
    }

    pub(crate) fn rebuilt(&mut self, found: &mut Vec<(u32, u32)>) -> usize {
        let ids: Vec<u32> = (0..self.boxes.len() as u32).collect();
        let Self { builder, tree, boxes, .. } = self;
        builder.build_with_bvh(tree, PlocSearchDistance::Minimum, boxes, ids, SortPrecision::U64, 0);
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
        let id = |place: u32| tree.primitive_indices[place as usize];
        while let Some((a, b)) = stack.pop() {
            let (one, other) = (&tree.nodes[a as usize], &tree.nodes[b as usize]);
            let (left, right) = (one.first_index, other.first_index);
            match (one.is_leaf(), other.is_leaf()) {
                (true, _) if a == b => {}
                _ if a == b => stack.extend([(left, left), (left + 1, left + 1), (left, left + 1)]),
                _ if !one.aabb.intersect_aabb(&other.aabb) => {}
                (true, true) => found.push((id(left), id(right))),
                (true, false) => stack.extend([(a, right), (a, right + 1)]),
                (false, true) => stack.extend([(left, b), (left + 1, b)]),
                (false, false) => {
                    stack.extend([(left, right), (left, right + 1), (left + 1, right), (left + 1, right + 1)])
                }
            }
        }
    }
}

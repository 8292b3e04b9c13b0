//! Results that are searched for while rapier does something else: begun at the end of one call, used in the next.
//!
//! A search that began with the boxes of one call knows the pairs of the next for every collider that is still inside its
//! stored box. So that most are, boxes are stored up to where bodies are expected. Pairs of the others are searched for at
//! once. Every call is then as complete as one that waits.

use crate::PbigBroadPhase;
use crate::call::Call;
use crate::proxy::{BLOCK, Growth, Proxy};
use crate::stats::{MEASURED_FROM, Watch};
use pbig_core::{Aabb, Events, Pair, ProxyFilter, Report};
use rapier3d::prelude::ColliderHandle;
use rayon::prelude::*;
use std::collections::HashSet;

/// Listed colliders from which where they will be is computed on several threads.
const PARALLEL_FROM: usize = 8192;

/// What a broad phase with [`PbigBroadPhase::overlapped`] keeps between calls.
#[derive(Clone, Debug, Default)]
pub(crate) struct Overlap {
    /// Events of searches, not sent yet.
    pub(crate) unsent: Events,
    /// Ids of colliders that have been taken out since those searches: the narrow phase drops their pairs itself.
    pub(crate) gone: HashSet<u32>,
    /// Listed colliders that are still inside their stored boxes: id, the box to store next, filter.
    pub(crate) staying: Vec<(u32, Aabb, ProxyFilter)>,
    /// For [`PbigBroadPhase::look_ahead`], and of no meaning between calls.
    pub(crate) seen: Vec<Seen>,
    /// The last call had no news and left the search alone.
    pub(crate) quiet: bool,
    pub(crate) left: usize,
    pub(crate) begun: usize,
    /// Of the search that was begun in the call before.
    pub(crate) report: Report,
}

/// What an update of a broad phase with [`PbigBroadPhase::overlapped`] did besides; [`crate::Stats::report`] is about the
/// search at once.
#[derive(Clone, Copy, Debug)]
pub struct Overlapped<'a> {
    /// Listed colliders that were new, had another filter or had left their stored box: their pairs were searched for at
    /// once.
    pub left: usize,
    /// Boxes that have changed in the search that has begun; without any none begins.
    pub begun: usize,
    /// The search that was begun in the call before.
    pub report: &'a Report,
}

/// A listed collider as it is and as it is expected.
pub(crate) type Seen = (Proxy, Aabb);

impl PbigBroadPhase {
    /// Lets a GPU search while rapier does something else: each call uses what was begun in the one before, searches at
    /// once for the pairs of colliders that are new or not where they were expected, and begins the next search. No pair
    /// is missed that is found without this.
    ///
    /// Boxes reach to where the velocities and forces of bodies take them within `dt`, so there are more pairs, and
    /// trajectories differ in the last bits from those without; they are the same on every backend. Where the CPU does the
    /// work nothing is gained: it searches twice. Nor is it on a GPU while in each step some collider goes elsewhere, as the
    /// search for that is waited for: [`crate::Totals::at_once`] says how often.
    ///
    /// ```
    /// use rapier_pbig::{Backend, Config, PbigBroadPhase};
    /// let config = Config { backend: Backend::Gpu, ..PbigBroadPhase::CONFIG };
    /// let broad_phase = PbigBroadPhase::with_config(config).overlapped();
    /// assert!(broad_phase.stats().overlapped.is_some());
    /// ```
    pub fn overlapped(mut self) -> Self {
        self.overlap.get_or_insert_default();
        self.idle = false;
        #[cfg(feature = "shadow")]
        if let Some(checker) = &mut self.shadow {
            checker.expect_any_distance();
        }
        self
    }

    /// Whether this call leaves the search that has begun alone: nothing is listed, so what rapier knows is still complete.
    /// Each step begins with such a call. After a second one the world is at rest, and the search is finished.
    pub(crate) fn leaves_alone(&mut self, has_news: bool) -> bool {
        let begun = self.finder.has_begun() && self.outbox.adopted.is_empty();
        let Some(overlap) = &mut self.overlap else { return false };
        let alone = begun && !has_news && !overlap.quiet;
        overlap.quiet = alone;
        alone
    }

    /// Takes over what was found meanwhile. If that fails the same changes are searched for at once.
    pub(crate) fn finish_begun(&mut self) {
        let Some(overlap) = self.overlap.as_mut().filter(|_| self.finder.has_begun()) else { return };
        match self.finder.finish() {
            Ok(found) => overlap.join(found),
            Err(error) => tracing::error!("pbig: nothing was found ahead: {error}"),
        }
        overlap.report.clone_from(self.finder.report());
    }

    /// Takes a box out of the finder; its pairs end without an event.
    pub(crate) fn take_out(&mut self, id: u32) {
        let was_there = self.finder.remove(id);
        if let Some(overlap) = self.overlap.as_mut().filter(|_| was_there) {
            overlap.gone.insert(id);
        }
    }

    /// Brings the finder up to date about listed colliders that are not inside their stored boxes, and notes the others.
    pub(crate) fn look_ahead(&mut self, call: &Call<'_>, listed: &[ColliderHandle]) {
        let mut watch = Watch::new(listed.len() >= MEASURED_FROM);
        let mut seen =
            self.overlap.as_mut().map(|overlap| std::mem::take(&mut overlap.seen)).unwrap_or_default();
        call.foresee(Growth::new(call.params, self.ulps), listed, &mut seen);
        self.kept.proxies += watch.lap();
        for (&handle, (proxy, reach)) in listed.iter().zip(seen.drain(..)) {
            match proxy {
                Proxy::Gone => self.forget(handle),
                Proxy::Disabled => self.disable(handle),
                Proxy::Enabled(aabb, filter) => self.set_ahead(handle, &aabb, reach, filter),
            }
        }
        self.overlap.iter_mut().for_each(|overlap| overlap.seen = std::mem::take(&mut seen));
        self.kept.set += watch.lap();
    }

    fn set_ahead(&mut self, handle: ColliderHandle, aabb: &Aabb, reach: Aabb, filter: ProxyFilter) {
        let id = handle.into_raw_parts().0;
        let inside = self.finder.fat_aabb(id).is_some_and(|fat| fat.contains(aabb));
        let stays = inside && self.roll.has(handle) && self.finder.filter(id) == Some(&filter);
        match &mut self.overlap {
            Some(overlap) if stays => overlap.staying.push((id, reach, filter)),
            Some(overlap) => {
                overlap.left += 1;
                self.set(handle, &reach, &filter);
            }
            None => self.set(handle, &reach, &filter),
        }
    }

    /// Stores where colliders are expected, and begins the search for that.
    pub(crate) fn begin_next(&mut self) {
        let Some(overlap) = &mut self.overlap else { return };
        self.kept.totals.left += overlap.left as u64;
        self.kept.totals.at_once += u64::from(overlap.left > 0);
        for (id, reach, filter) in overlap.staying.drain(..) {
            if let Err(error) = self.finder.set(id, reach, filter) {
                tracing::error!("pbig: box {id} is ignored: {error}");
            }
        }
        overlap.begun = self.finder.changes().count();
        if overlap.begun > 0 {
            self.note_for_queries();
            self.finder.begin();
        }
    }
}

impl Overlap {
    /// Forgets the numbers of the call before.
    pub(crate) fn start_call(&mut self) {
        (self.left, self.begun) = (0, 0);
        self.report = Report::default();
        self.staying.clear();
    }

    pub(crate) fn forget_sent(&mut self) {
        self.unsent.added.clear();
        self.unsent.removed.clear();
    }

    /// Adds the events of a search to those that wait: what came and went, or went and came, has not changed.
    pub(crate) fn join(&mut self, found: &Events) {
        let Self { gone, unsent: Events { added, removed }, .. } = self;
        let there = |pair: &Pair| !gone.contains(&pair.a) && !gone.contains(&pair.b);
        added.retain(there);
        removed.retain(there);
        gone.clear();
        let waiting = added.len();
        added.extend(without(&found.added, removed));
        removed.extend(without(&found.removed, &added[..waiting]));
        // What has just come is not among what was found to have gone, nor the other way round.
        added.retain(|pair| found.removed.binary_search(pair).is_err());
        removed.retain(|pair| found.added.binary_search(pair).is_err());
        added.sort_unstable();
        removed.sort_unstable();
    }
}

/// The pairs that are not among others, which are sorted.
fn without(pairs: &[Pair], others: &[Pair]) -> impl Iterator<Item = Pair> {
    pairs.iter().filter(|pair| others.binary_search(pair).is_err()).copied()
}

impl Call<'_> {
    /// Listed colliders as they are, and the boxes around that and where they are expected in the next call.
    fn foresee(&self, growth: Growth, listed: &[ColliderHandle], seen: &mut Vec<Seen>) {
        seen.resize(listed.len(), (Proxy::Gone, Aabb::NOWHERE));
        if listed.len() < PARALLEL_FROM {
            self.see(growth, listed, seen);
        } else {
            let pieces = listed.par_chunks(BLOCK).zip(seen.par_chunks_mut(BLOCK));
            let pieces = pieces.with_min_len(PARALLEL_FROM / BLOCK / 8);
            pieces.for_each(|(listed, seen)| self.see(growth, listed, seen));
        }
    }

    fn see(&self, growth: Growth, listed: &[ColliderHandle], seen: &mut [Seen]) {
        let mut proxies = [Proxy::Gone; BLOCK];
        for (listed, seen) in listed.chunks(BLOCK).zip(seen.chunks_mut(BLOCK)) {
            self.proxies(growth, listed, &mut proxies[..listed.len()]);
            for ((handle, proxy), seen) in listed.iter().zip(proxies).zip(seen) {
                let reach = match proxy {
                    Proxy::Enabled(aabb, _) => self.way_of(growth, *handle, aabb),
                    Proxy::Gone | Proxy::Disabled => Aabb::NOWHERE,
                };
                *seen = (proxy, reach);
            }
        }
    }

    /// The box around a collider's box and where it is expected in the next call.
    fn way_of(&self, growth: Growth, handle: ColliderHandle, aabb: Aabb) -> Aabb {
        if !aabb.is_valid() {
            return aabb;
        }
        self.expected(growth, handle, &aabb).map_or(aabb, |then| aabb.union(&then))
    }

    /// Where the velocity and the forces of its body take a collider. With soft CCD, which looks ahead itself, its box moves
    /// along; else where it is then is enough.
    fn expected(&self, growth: Growth, handle: ColliderHandle, aabb: &Aabb) -> Option<Aabb> {
        let collider = self.colliders.get(handle)?;
        let body = self.bodies.get(collider.parent()?)?;
        let pose = body.predict_position_using_velocity_and_forces(self.params.dt);
        let pose = pose * collider.position_wrt_parent()?;
        let then = collider.shape().compute_aabb(&pose);
        let then = growth.of(&Aabb::new(then.mins.coords.into(), then.maxs.coords.into()), collider);
        if body.soft_ccd_prediction() <= 0.0 {
            return Some(then);
        }
        let motion = pose.translation.vector - collider.position().translation.vector;
        Some(aabb.swept(motion.into()).union(&then))
    }
}

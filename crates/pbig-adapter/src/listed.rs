//! Reads the colliders that rapier lists and sets their boxes in the core.

#[cfg(feature = "parallel")]
use crate::policy;
use crate::{BodyKind, Bounds, BoxStore, Colliders, Handle, Proxy, Scene, Tree};
use pbig_core::ProxyFilter;
#[cfg(feature = "parallel")]
use rayon::prelude::*;
#[cfg(feature = "parallel")]
use std::ops::Range;

impl<T: Tree> Colliders<T> {
    /// Sets or removes the boxes of listed colliders, in the order of the list.
    pub(crate) fn read_listed(&mut self, scene: &impl Scene<Aabb = T::Aabb>) {
        let _span = tracing::debug_span!(target: "pbig", "proxies").entered();
        let listed = scene.listed_count();
        #[cfg(feature = "parallel")]
        if listed >= policy::PARALLEL_FROM_COLLIDERS && rayon::current_num_threads() > 1 {
            let starts = (0..listed).step_by(policy::PROXIES_PER_BATCH);
            let batches = starts.map(|start| start..listed.min(start + policy::PROXIES_PER_BATCH));
            return batches.for_each(|batch| self.read_batch(scene, batch));
        }
        scene.for_each_listed(0..listed, |handle, proxy| self.set_proxy(handle, proxy, true));
    }

    /// Computes proxies on several threads, and sets them on this one.
    #[cfg(feature = "parallel")]
    fn read_batch(&mut self, scene: &impl Scene<Aabb = T::Aabb>, batch: Range<usize>) {
        let mut proxies = std::mem::take(&mut self.proxies);
        proxies.resize(batch.len(), (Handle { index: 0, generation: 0 }, Proxy::Gone));
        let pieces = proxies.par_chunks_mut(policy::PROXIES_PER_PIECE).enumerate();
        pieces.for_each(|(piece, proxies)| {
            let start = batch.start + piece * policy::PROXIES_PER_PIECE;
            let end = start + proxies.len();
            let mut slots = proxies.iter_mut();
            scene.for_each_listed(start..end, |handle, proxy| {
                if let Some(slot) = slots.next() {
                    *slot = (handle, proxy);
                }
            });
        });
        for &(handle, proxy) in &proxies {
            self.set_proxy(handle, proxy, true);
        }
        self.proxies = proxies;
    }

    #[inline(always)]
    pub(crate) fn set_proxy(&mut self, handle: Handle, proxy: Proxy<T::Aabb>, is_listed: bool) {
        match proxy {
            Proxy::Enabled { aabb, filter, is_asleep } => {
                let is_still = is_asleep || BodyKind::of(&filter) == BodyKind::Fixed;
                let is_new_and_still = is_listed && is_still && !self.registry.contains(handle);
                let own = self.margins.own(&aabb, is_new_and_still);
                if let Some(margin) = own {
                    self.set_margin(margin);
                }
                self.enable(handle, aabb, filter);
                if own.is_some() {
                    self.set_margin(self.margins.usual);
                }
            }
            Proxy::Disabled => self.disable(handle),
            Proxy::Unplaced(filter) => self.keep_box(handle, filter),
            Proxy::Gone => self.forget(handle),
        }
    }

    #[inline(always)]
    pub(crate) fn enable(&mut self, handle: Handle, aabb: T::Aabb, filter: ProxyFilter) {
        if !self.registry.contains(handle) {
            self.register(handle);
        }
        if let Err(error) = self.boxes.set(&mut self.core, handle.index, aabb, filter) {
            self.note_error(error);
        }
    }

    /// Makes a collider known. An older collider that used its index loses its box: rapier never listed it as removed.
    #[cold]
    fn register(&mut self, handle: Handle) {
        if !self.registry.insert(handle) {
            self.boxes.remove(&mut self.core, handle.index);
        }
    }

    /// Keeps a collider with the box that it has. One that never had a box gets an invalid one.
    fn keep_box(&mut self, handle: Handle, filter: ProxyFilter) {
        if !self.registry.contains(handle) {
            self.register(handle);
        }
        if !self.core.set_filter(handle.index, filter) {
            self.enable(handle, T::Aabb::NOWHERE, filter);
        }
    }

    /// Keeps a collider in the registry, without a box.
    pub(crate) fn disable(&mut self, handle: Handle) {
        self.registry.insert(handle);
        self.boxes.remove(&mut self.core, handle.index);
    }

    /// Removes a collider, if this very one is known. Its pairs end without an event: the narrow phase drops the pairs of
    /// removed and disabled colliders itself.
    pub(crate) fn forget(&mut self, handle: Handle) {
        if self.registry.remove(handle) {
            self.boxes.remove(&mut self.core, handle.index);
        }
    }
}

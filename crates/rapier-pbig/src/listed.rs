//! Reads the colliders that rapier lists and sets their boxes in the core.

use crate::PbigBroadPhase;
use crate::call::Call;
use crate::policy;
use crate::proxy::Proxy;
use pbig_core::{Aabb, ProxyFilter};
use rapier3d::prelude::ColliderHandle;
#[cfg(feature = "parallel")]
use rayon::prelude::*;

impl PbigBroadPhase {
    /// Sets or removes the boxes of listed colliders, in the order of the list.
    pub(crate) fn read_listed(&mut self, call: &Call<'_>, listed: &[ColliderHandle]) {
        let _span = tracing::debug_span!(target: "pbig", "proxies").entered();
        #[cfg(feature = "parallel")]
        if listed.len() >= policy::PARALLEL_FROM_COLLIDERS && rayon::current_num_threads() > 1 {
            return listed.chunks(policy::PROXIES_PER_BATCH).for_each(|batch| self.read_batch(call, batch));
        }
        call.for_each_proxy(listed, |handle, proxy| self.set_proxy(handle, proxy));
    }

    /// Computes proxies on several threads, and sets them on this one.
    #[cfg(feature = "parallel")]
    fn read_batch(&mut self, call: &Call<'_>, batch: &[ColliderHandle]) {
        let mut proxies = std::mem::take(&mut self.proxies);
        proxies.resize(batch.len(), Proxy::Gone);
        let pieces = batch.par_chunks(policy::PROXIES_PER_PIECE);
        pieces.zip(proxies.par_chunks_mut(policy::PROXIES_PER_PIECE)).for_each(|(handles, proxies)| {
            let mut slots = proxies.iter_mut();
            call.for_each_proxy(handles, |_, proxy| {
                if let Some(slot) = slots.next() {
                    *slot = proxy;
                }
            });
        });
        for (&handle, &proxy) in batch.iter().zip(&proxies) {
            self.set_proxy(handle, proxy);
        }
        self.proxies = proxies;
    }

    #[inline(always)]
    fn set_proxy(&mut self, handle: ColliderHandle, proxy: Proxy) {
        match proxy {
            Proxy::Enabled(aabb, filter) => self.enable(handle, aabb, filter),
            Proxy::Disabled => self.disable(handle),
            Proxy::Gone => self.forget(handle),
        }
    }

    #[inline(always)]
    fn enable(&mut self, handle: ColliderHandle, aabb: Aabb, filter: ProxyFilter) {
        if !self.registry.contains(handle) {
            self.register(handle);
        }
        if let Err(error) = self.core.set(handle.into_raw_parts().0, aabb, filter) {
            self.note_error(error);
        }
    }

    /// Makes a collider known. An older collider that used its index loses its box: rapier never listed it as removed.
    #[cold]
    fn register(&mut self, handle: ColliderHandle) {
        if !self.registry.insert(handle) {
            self.core.remove(handle.into_raw_parts().0);
        }
    }

    /// Keeps a collider in the registry, without a box.
    pub(crate) fn disable(&mut self, handle: ColliderHandle) {
        self.registry.insert(handle);
        self.core.remove(handle.into_raw_parts().0);
    }

    /// Removes a collider, if this very one is known. Its pairs end without an event: the narrow phase drops the pairs of
    /// removed and disabled colliders itself.
    pub(crate) fn forget(&mut self, handle: ColliderHandle) {
        if self.registry.remove(handle) {
            self.core.remove(handle.into_raw_parts().0);
        }
    }
}

impl Call<'_> {
    /// Calls `take` with each listed collider and its proxy, in the order of the list.
    fn for_each_proxy(&self, listed: &[ColliderHandle], mut take: impl FnMut(ColliderHandle, Proxy)) {
        for block in listed.chunks(policy::COLLIDERS_PER_BLOCK) {
            let mut fetched = [(None, None); policy::COLLIDERS_PER_BLOCK];
            for (fetched, &handle) in fetched.iter_mut().zip(block) {
                *fetched = self.fetch(handle);
            }
            for (&handle, fetched) in block.iter().zip(fetched) {
                take(handle, self.proxy(fetched));
            }
        }
    }
}

//! Listed colliders are looked at, and what has become of them is set in the finder.

use crate::PbigBroadPhase;
use crate::call::Call;
use crate::news::{News, SecondLook};
use crate::proxy::{BLOCK, FEW, Proxy, are_scattered};
use pbig_core::{Aabb, ProxyFilter};
use rapier3d::prelude::ColliderHandle;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Modified colliders from which their boxes are computed on several threads: below, waking a second one costs more than
/// it saves. And the same of scattered ones, each of which takes several times as long.
const PARALLEL_FROM: usize = 16_384;
const SCATTERED_PARALLEL_FROM: usize = 8192;

impl PbigBroadPhase {
    /// Brings the finder up to date about some colliders.
    pub(crate) fn look_at(&mut self, call: &Call<'_>, listed: &[ColliderHandle]) {
        let first = &listed[..listed.len().min(BLOCK)];
        let parallel_from = if are_scattered(first) { SCATTERED_PARALLEL_FROM } else { PARALLEL_FROM };
        if listed.len() < parallel_from || rayon::current_num_threads() == 1 {
            let _span = tracing::debug_span!(target: "pbig", "proxies").entered();
            listed.chunks(BLOCK).for_each(|block| self.look_at_block(call, block));
            return;
        }
        self.look_at_many(call, listed);
    }

    /// On several threads, but for colliders that are disabled, gone, or heirs of an index.
    fn look_at_many(&mut self, call: &Call<'_>, listed: &[ColliderHandle]) {
        let _span = tracing::debug_span!(target: "pbig", "proxies").entered();
        let looked = catch_unwind(AssertUnwindSafe(|| {
            let second = self.set_many(call, listed);
            second.of(listed).for_each(|handle| self.look_again(call, handle));
        }));
        if let Err(panic) = looked {
            // A shape of the app's: a box without a collider on the roll would stay for ever.
            for &index in &self.indices {
                if self.roll.handle(index).is_none() {
                    self.finder.remove(index);
                }
            }
            resume_unwind(panic);
        }
    }

    /// Sets the boxes of colliders that are on the roll or new. A second look is due at new ones, and where there was
    /// nothing to set.
    fn set_many(&mut self, call: &Call<'_>, listed: &[ColliderHandle]) -> SecondLook {
        let Self { finder, roll, indices, .. } = self;
        let news = News::new(listed.len());
        indices.clear();
        for &handle in listed {
            let index = handle.into_raw_parts().0;
            // Not what has the index of another one that is on the roll: that may not be listed.
            match roll.handle(index) {
                Some(known) if known != handle => news.note(index),
                _ => indices.push(index),
            }
        }
        let fetch = |index| (index, call.fetch_known(index, roll, &news));
        let proxy = |(index, found)| match call.proxy(found) {
            Proxy::Enabled(aabb, filter) => Some((aabb, filter)),
            Proxy::Disabled | Proxy::Gone => {
                news.note(index);
                None
            }
        };
        if let Err(error) = finder.set_many(indices, fetch, proxy) {
            tracing::error!("pbig: colliders are ignored: {error}");
        }
        news.into_second_look()
    }

    /// At a collider of which nothing, or only the box, has been set so far, unless it was known and still is there.
    fn look_again(&mut self, call: &Call<'_>, handle: ColliderHandle) {
        let index = handle.into_raw_parts().0;
        let is_new = self.roll.handle(index).is_none();
        match call.colliders.get(handle) {
            Some(collider) if collider.is_enabled() && self.roll.has(handle) => {}
            Some(collider) if collider.is_enabled() && is_new && self.finder.contains(index) => {
                self.roll.enter(handle);
            }
            // What has been set is that of an heir, whose turn comes.
            None if is_new => _ = self.finder.remove(index),
            _ => self.set_proxy(handle, call.proxy(call.fetch(handle))),
        }
    }

    /// Each collider's proxy is set as soon as it is known: to write it down and read it again took 5 ns.
    fn look_at_block(&mut self, call: &Call<'_>, listed: &[ColliderHandle]) {
        if are_scattered(listed) {
            return self.look_at_scattered(call, listed);
        }
        if listed.len() <= FEW {
            for &handle in listed {
                self.set_proxy(handle, call.proxy(call.fetch(handle)));
            }
            return;
        }
        let mut found = [(None, None); BLOCK];
        call.fetch_all(listed, &mut found);
        for (&handle, found) in listed.iter().zip(found) {
            self.set_proxy(handle, call.proxy(found));
        }
    }

    /// The same of colliders whose memory lies apart: what will be read is asked for. (1000 of 100,000: 165 us instead of
    /// 205; 10,000 of a million: 3.0 ms instead of 4.0. Where they lie beside each other, it took a fifth longer.)
    #[inline(never)]
    fn look_at_scattered(&mut self, call: &Call<'_>, listed: &[ColliderHandle]) {
        for &handle in listed {
            let index = handle.into_raw_parts().0;
            self.finder.ask_for(index);
            self.roll.ask_for(index);
        }
        let mut found = [(None, None); BLOCK];
        call.fetch_scattered(listed, &mut found);
        for (&handle, found) in listed.iter().zip(found) {
            self.set_proxy(handle, call.proxy(found));
        }
    }

    #[inline(always)]
    fn set_proxy(&mut self, handle: ColliderHandle, proxy: Proxy) {
        match proxy {
            Proxy::Enabled(aabb, filter) => self.set(handle, &aabb, &filter),
            Proxy::Disabled => self.disable(handle),
            Proxy::Gone => self.forget(handle),
        }
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, handle: ColliderHandle, aabb: &Aabb, filter: &ProxyFilter) {
        if !self.roll.has(handle) {
            self.enter(handle);
        }
        if let Err(error) = self.finder.set(handle.into_raw_parts().0, *aabb, *filter) {
            ignored(handle, &error);
        }
    }

    #[cold]
    fn enter(&mut self, handle: ColliderHandle) {
        if !self.roll.enter(handle) {
            // A predecessor with this index that was never reported as removed.
            self.finder.remove(handle.into_raw_parts().0);
        }
    }
}

#[cold]
fn ignored(handle: ColliderHandle, error: &pbig_core::Error) {
    tracing::error!("pbig: collider {handle:?} is ignored: {error}");
}

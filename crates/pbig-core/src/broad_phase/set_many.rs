//! Many boxes set at once: computed on several threads, set by the caller.

use super::BroadPhase;
use crate::grid::prefetch;
use crate::parallel::{SharedSlice, available_threads, run};
use crate::policy::PARALLEL_FROM_BOXES;
use crate::{Aabb, Error, ProxyFilter};

/// Boxes that are computed together.
const BLOCK: usize = 1024;

/// Boxes between a prefetch and the box's turn.
const AHEAD: usize = 16;

impl BroadPhase {
    /// Sets many boxes, as [`BroadPhase::set`] does one, in the order of `ids`.
    ///
    /// `of` returns box and filter of an id, or none for a box that is to be left as it is. From 16,384 ids on it is
    /// called on the threads of the present rayon pool. A panic in it goes on to the caller; then some boxes are set.
    ///
    /// ```
    /// use pbig_core::{Aabb, BroadPhase, ProxyFilter};
    /// let ids: Vec<u32> = (0..10_000).collect();
    /// let mut broad_phase = BroadPhase::default();
    /// let cube = |id: u32| Aabb::from_center([0.9 * id as f32, 0.0, 0.0], [0.5; 3]);
    /// broad_phase.set_many(&ids, |id| Some((cube(id), ProxyFilter::ALL)))?;
    /// assert_eq!(broad_phase.update()?.added.len(), 9_999);
    /// # Ok::<(), pbig_core::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::TooManyBoxes`], the first one; the other boxes are set.
    pub fn set_many(
        &mut self,
        ids: &[u32],
        of: impl Fn(u32) -> Option<(Aabb, ProxyFilter)> + Sync,
    ) -> Result<(), Error> {
        let threads = available_threads();
        if ids.len() < PARALLEL_FROM_BOXES || threads == 1 {
            return self.set_each(ids, |_, id| of(id));
        }
        let mut result = Ok(());
        let room = BLOCK * 4 * threads;
        let mut found = vec![None; room.min(ids.len())];
        for ids in ids.chunks(room) {
            let shared = SharedSlice::new(&mut found);
            run(threads, ids.len().div_ceil(BLOCK), |_, block| {
                let range = block * BLOCK..ids.len().min((block + 1) * BLOCK);
                // SAFETY: each block has its own elements.
                let found = unsafe { shared.part(range.clone()) };
                found.iter_mut().zip(&ids[range]).for_each(|(found, &id)| *found = of(id));
            });
            result = result.and(self.set_each(ids, |i, _| found[i]));
        }
        result
    }

    #[inline(always)]
    fn set_each(
        &mut self,
        ids: &[u32],
        of: impl Fn(usize, u32) -> Option<(Aabb, ProxyFilter)>,
    ) -> Result<(), Error> {
        let mut result = Ok(());
        for (i, &id) in ids.iter().enumerate() {
            if let Some(&ahead) = ids.get(i + AHEAD) {
                self.ask_for(ahead);
            }
            if let Some((aabb, filter)) = of(i, id)
                && let Err(error) = self.set(id, aabb, filter)
            {
                result = result.and(Err(error));
            }
        }
        result
    }

    /// Prefetches what [`BroadPhase::set`] reads of an id: worth it for ids that lie apart, a dozen ahead of their turn.
    #[inline(always)]
    pub fn ask_for(&self, id: u32) {
        prefetch(self.world.boxes.as_ptr().wrapping_add(id as usize));
        prefetch(self.world.filters.as_ptr().wrapping_add(id as usize));
    }
}

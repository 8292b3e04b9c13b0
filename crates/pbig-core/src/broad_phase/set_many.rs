//! Many boxes set at once.

use super::BroadPhase;
use crate::grid::prefetch;
use crate::{Aabb, Error, ProxyFilter};

/// Number of boxes between a prefetch and the use of its box.
const AHEAD: usize = 16;

impl BroadPhase {
    /// Sets many boxes, as [`BroadPhase::set`] does one, in the order of `ids`.
    ///
    /// `of` returns box and filter of an id, or none to leave its box alone. A panic in `of` reaches the caller after some boxes are
    /// set. If boxes take long to compute, compute them on several threads first: setting one takes about 5 ns, less than handing
    /// it to another thread.
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
    /// The first error of [`BroadPhase::set`]. The other boxes are set.
    pub fn set_many(
        &mut self,
        ids: &[u32],
        of: impl Fn(u32) -> Option<(Aabb, ProxyFilter)>,
    ) -> Result<(), Error> {
        let mut result = Ok(());
        for (i, &id) in ids.iter().enumerate() {
            if let Some(&ahead) = ids.get(i + AHEAD) {
                self.prefetch(ahead);
            }
            if let Some((aabb, filter)) = of(id)
                && let Err(error) = self.set(id, aabb, filter)
            {
                result = result.and(Err(error));
            }
        }
        result
    }

    /// Prefetches the memory of an id that [`BroadPhase::set`] reads. It pays for ids far apart, a dozen ahead of their use.
    #[inline(always)]
    pub fn prefetch(&self, id: u32) {
        prefetch(self.world.boxes.as_ptr().wrapping_add(id as usize));
        if self.world.is_filtered {
            prefetch(self.world.filters.as_ptr().wrapping_add(id as usize));
        }
    }
}

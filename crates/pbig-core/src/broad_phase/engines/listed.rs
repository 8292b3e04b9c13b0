//! The present boxes as a list of their own: work on it follows the boxes that are left after a peak, not the ids.

use crate::broad_phase::world::World;
use crate::{Aabb, ProxyFilter};

/// The ids of present boxes, in order, and what decides about their pairs.
#[derive(Clone, Debug, Default)]
pub(super) struct Listed {
    pub(super) ids: Vec<u32>,
    pub(super) boxes: Vec<Aabb>,
    /// Empty if no box of the world was ever filtered.
    pub(super) filters: Vec<ProxyFilter>,
}

impl Listed {
    /// Lists the present boxes.
    pub(super) fn take(&mut self, world: &World) {
        let Self { ids, boxes, filters } = self;
        ids.clear();
        ids.extend(world.present.iter());
        boxes.clear();
        boxes.extend(ids.iter().map(|id| world.boxes[*id as usize]));
        filters.clear();
        if world.is_filtered {
            filters.extend(ids.iter().map(|id| world.filters[*id as usize]));
        }
    }
}

//! The boxes of two sets in one list, without those that miss all of the other set.

use crate::{Aabb, Boxes, Keys, NO_KEY, ProxyFilter};

/// The boxes of two sets that may have pairs, in one list: those of the first set, then those of the second.
#[derive(Clone, Debug, Default)]
pub(super) struct Sets {
    pub(super) boxes: Vec<Aabb>,
    /// By place in the list: the id in the set.
    pub(super) ids: Vec<u32>,
    pub(super) filters: Option<Vec<ProxyFilter>>,
    pub(super) keys: Option<Vec<Keys>>,
    /// The number of boxes of the first set.
    pub(super) split: u32,
    /// Valid boxes of both sets, before any was dropped.
    pub(super) valid: u64,
    /// Scratch: the ids of the second set.
    second: Vec<u32>,
}

/// A box that all valid boxes overlap.
const EVERYWHERE: Aabb = Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);

impl Sets {
    /// Takes two sets, without the boxes that miss all of the other one.
    pub(super) fn take(&mut self, a: &Boxes<'_>, b: &Boxes<'_>) {
        self.list_near(a.boxes, b.boxes);
        self.split = self.ids.len() as u32;
        self.ids.append(&mut self.second);
        let (first, second) = self.ids.split_at(self.split as usize);
        self.boxes.clear();
        self.boxes.extend(first.iter().map(|id| a.boxes[*id as usize]));
        self.boxes.extend(second.iter().map(|id| b.boxes[*id as usize]));
        self.filters = gather([(first, a.filters), (second, b.filters)], ProxyFilter::ALL);
        self.keys = gather([(first, a.keys), (second, b.keys)], [NO_KEY; 4]);
    }

    /// Lists the valid boxes of each set that overlap the bounds of the other set. Repeats it while a quarter of the boxes is
    /// dropped, because the bounds of the boxes that are left are smaller.
    fn list_near(&mut self, a: &[Aabb], b: &[Aabb]) {
        let (first, second) = (&mut self.ids, &mut self.second);
        first.clear();
        first.extend(0..a.len() as u32);
        second.clear();
        second.extend(0..b.len() as u32);
        let mut bounds = keep_near(second, b, &EVERYWHERE);
        self.valid = second.len() as u64 + a.iter().filter(|aabb| aabb.is_valid()).count() as u64;
        loop {
            let before = first.len() + second.len();
            let first_bounds = keep_near(first, a, &bounds);
            bounds = keep_near(second, b, &first_bounds);
            if first.is_empty() || second.is_empty() {
                first.clear();
                second.clear();
            }
            if 4 * (first.len() + second.len()) >= 3 * before {
                return;
            }
        }
    }
}

/// Drops boxes that are invalid or miss a box; returns the bounds of the others, invalid if there are none.
fn keep_near(ids: &mut Vec<u32>, boxes: &[Aabb], near: &Aabb) -> Aabb {
    let mut bounds = Aabb::new([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    ids.retain(|id| {
        let aabb = &boxes[*id as usize];
        let is_near = aabb.is_valid() & aabb.overlaps(near);
        if is_near {
            for k in 0..3 {
                bounds.min[k] = bounds.min[k].min(aabb.min[k]);
                bounds.max[k] = bounds.max[k].max(aabb.max[k]);
            }
        }
        is_near
    });
    if ids.is_empty() { Aabb::NOWHERE } else { bounds }
}

/// Copies the values of listed boxes; none if neither set has any.
fn gather<T: Copy>(sets: [(&[u32], Option<&[T]>); 2], default: T) -> Option<Vec<T>> {
    if sets.iter().all(|(_, values)| values.is_none()) {
        return None;
    }
    let value = |values: Option<&[T]>, id: u32| values.map_or(default, |values| values[id as usize]);
    let all = sets.into_iter().flat_map(|(ids, values)| ids.iter().map(move |id| value(values, *id)));
    Some(all.collect())
}

//! Boxes that are tested one after the other: those that fit no level, and those of the paper's grid.

use crate::Aabb;

/// A box as stored: `[min, -max]` and two lanes that always pass, so that whether it overlaps a
/// [`Query`] is one comparison of eight lanes: two instructions with SSE2, one with AVX.
#[repr(C, align(32))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stored([f32; 8]);

/// A box as it is compared with stored ones: `[max, -min]` and the two lanes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Query([f32; 8]);

impl Stored {
    #[inline(always)]
    pub(crate) fn new(b: &Aabb) -> Self {
        let pass = f32::NEG_INFINITY;
        Self([b.min[0], b.min[1], b.min[2], -b.max[0], -b.max[1], -b.max[2], pass, pass])
    }

    /// The stored box as a query.
    #[inline(always)]
    pub(crate) fn query(&self) -> Query {
        let [a, b, c, d, e, f, ..] = self.0;
        Query([-d, -e, -f, -a, -b, -c, 0.0, 0.0])
    }

    /// `min <= query.max` and `-max <= -query.min` on all axes: equation 1.
    #[inline(always)]
    pub(crate) fn overlaps(&self, query: &Query) -> bool {
        let mut all = true;
        for (stored, query) in self.0.iter().zip(&query.0) {
            all &= stored <= query;
        }
        all
    }
}

impl Query {
    #[inline(always)]
    pub(crate) fn new(b: &Aabb) -> Self {
        Stored::new(b).query()
    }
}

/// Stored boxes and their ids, side by side: ids are read for the few that overlap.
#[derive(Clone, Debug, Default)]
pub(crate) struct Entries {
    pub(crate) boxes: Vec<Stored>,
    pub(crate) ids: Vec<u32>,
}

impl Entries {
    pub(crate) fn len(&self) -> usize {
        self.ids.len()
    }

    pub(crate) fn clear(&mut self) {
        self.boxes.clear();
        self.ids.clear();
    }

    /// The boxes with these ids.
    pub(crate) fn fill(&mut self, boxes: &[Aabb], ids: impl Iterator<Item = u32>) {
        self.clear();
        ids.for_each(|id| self.push(&boxes[id as usize], id));
    }

    /// Replaces the `i`-th box.
    pub(crate) fn set(&mut self, i: usize, aabb: &Aabb) {
        self.boxes[i] = Stored::new(aabb);
    }

    /// Removes the `i`-th box, whose place the last one takes.
    pub(crate) fn swap_remove(&mut self, i: usize) {
        self.boxes.swap_remove(i);
        self.ids.swap_remove(i);
    }

    pub(crate) fn push(&mut self, aabb: &Aabb, id: u32) {
        self.boxes.push(Stored::new(aabb));
        self.ids.push(id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_comparison_of_lanes_is_the_definition_of_overlap() {
        let edges = [f32::NEG_INFINITY, -1.0, -0.0, 0.0, 1e-45, 1.0, f32::MAX, f32::INFINITY];
        let boxes: Vec<Aabb> = (0..512)
            .map(|i| [edges[i % 8], edges[i / 8 % 8], edges[i / 64]])
            .flat_map(|v| [Aabb::new([v[0]; 3], [v[1]; 3]), Aabb::new([0.0, v[0], 0.0], [1.0, v[1], v[2]])])
            .filter(Aabb::is_valid)
            .collect();
        for a in &boxes {
            for b in &boxes {
                let lanes = Stored::new(a).overlaps(&Query::new(b));
                assert_eq!(lanes, a.overlaps(b), "{a:?} {b:?}");
            }
        }
    }
}

//! Levels: boxes of similar size, in cells of their size, and which box belongs where.

use super::cells::Cells;
use super::sort::NOWHERE;
use crate::Aabb;
use crate::plan::{LevelPlan, Plan, size_class_of};
use std::ops::Range;

/// One grid.
#[derive(Clone, Debug)]
pub(crate) struct Level {
    pub(crate) cells: Cells,
    /// No box is larger.
    max_extent: [f32; 3],
    /// Its boxes.
    pub(crate) slots: Range<usize>,
    /// Boxes of one camp other than [`crate::plan::OPEN`] never pair with each other.
    pub(crate) camp: u8,
    /// Other boxes in a box's cell, on average over boxes.
    pub(crate) crowd: f32,
}

impl Level {
    pub(super) fn new(plan: &LevelPlan, base: u32) -> Self {
        let (cells, max_extent) = (Cells::new(plan, base), plan.max_extent);
        Self { cells, max_extent, slots: 0..0, camp: plan.camp, crowd: 0.0 }
    }

    /// Whether a key is one of its cells.
    pub(super) fn has(&self, key: u32) -> bool {
        (self.cells.base..=self.cells.base + self.cells.mask).contains(&key)
    }

    /// False for extents of invalid boxes. A box as large as the largest extent may be larger by what was rounded off.
    #[inline(always)]
    fn holds(&self, extents: [f32; 3]) -> bool {
        let mut holds = true;
        for (extent, largest) in extents.into_iter().zip(self.max_extent) {
            holds &= (extent >= 0.0) & (extent < largest);
        }
        holds
    }
}

/// No cell: a box that fits no level.
pub(super) const LISTED: u32 = NOWHERE - 1;

/// The level of a size class that has none.
const NONE: u8 = u8::MAX;

/// Which level a box belongs to, by camp and size class.
#[derive(Clone, Debug, Default)]
pub(super) struct Classes(Vec<[u8; 256]>);

impl Classes {
    pub(super) fn set(&mut self, plan: &Plan, camps: usize) {
        self.0.clear();
        self.0.resize(camps, [NONE; 256]);
        for (i, level) in plan.levels.iter().enumerate() {
            let (first, last) = (usize::from(level.classes.0), usize::from(level.classes.1));
            self.0[usize::from(level.camp)][first..=last].fill(i as u8);
        }
    }

    /// The key of a box's cell; [`LISTED`] for a box that its level would not hold, though planned for others of its
    /// class.
    #[inline(always)]
    pub(super) fn key(&self, one: &Aabb, camp: u8, levels: &[Level]) -> u32 {
        let extents = one.extents();
        if let [level] = levels
            && camp == level.camp
            && level.holds(extents)
        {
            // The only one: whatever fits is in it.
            return level.cells.place(one);
        }
        match levels.get(usize::from(self.0[usize::from(camp)][size_class_of(extents)])) {
            Some(level) if level.holds(extents) => level.cells.place(one),
            _ if !one.is_valid() => NOWHERE,
            _ => LISTED,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A level of boxes up to `largest`, in cells of 1 from -8 on.
    fn level(largest: f32) -> Level {
        let plan = LevelPlan {
            boxes: 1,
            classes: (0, 254),
            max_extent: [largest.next_up(); 3],
            cell: [1.0; 3],
            origin: [-8.0; 3],
            dims: [8; 3],
            cells: 512,
            crowd: 0.0,
            camp: 0,
        };
        Level::new(&plan, 0)
    }

    #[test]
    fn no_box_that_a_level_holds_begins_before_the_window_of_one_it_touches() {
        let level = level(0.875f32.next_down());
        // As large as `max_extent` once rounded, and larger before: from the cell before the window. Cells begin half a
        // step, 1 / 128, below whole numbers.
        let grown = Aabb::new([-1.0 / 128.0 - 2f32.powi(-30); 3], [0.875 - 1.0 / 128.0; 3]);
        let touching = Aabb::new(grown.max, [1.0; 3]);
        assert_eq!(grown.extents(), [0.875; 3]);
        assert!(level.cells.window(&touching).0[0] > level.cells.bounds(&grown).0[0]);
        assert!(!level.holds(grown.extents()));
        let mut held = 0;
        for i in 0..4000u32 {
            let min = (i as f32 - 2000.0) * 1.3e-6 - 1.0 / 128.0;
            let one = Aabb::new([min; 3], [min + 0.875 - (i % 7) as f32 * 1e-8; 3]);
            if level.holds(one.extents()) {
                let touching = Aabb::new(one.max, [2.0; 3]);
                assert!(level.cells.window(&touching).0[0] <= level.cells.bounds(&one).0[0], "{one:?}");
                held += 1;
            }
        }
        assert!(held > 500, "{held}");
    }

    #[test]
    fn invalid_boxes_fit_nowhere() {
        let level = level(0.9);
        assert!(level.holds([0.0; 3]) && level.holds([0.9; 3]));
        assert!(!level.holds(Aabb::NOWHERE.extents()) && !level.holds([0.5, -0.1, 0.5]));
    }
}

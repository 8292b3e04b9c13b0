//! Levels: boxes split by size, so that each size has cells of its own (contract 4).
//!
//! From the smallest boxes on, sizes share a level until a box as large as the next size would lie over too many of the
//! level's boxes. The largest boxes have no level if they are few: they go into the last level's single cell.

use crate::pbig::{OVERSIZE_CLASS, Summary};
use pbig_core::internal::SizeClass;

/// Maximum number of boxes of a level, spread evenly, that may lie in the cube around a box. Of 4, 8, 16, 32 and 64, this
/// one led to the fewest entries and tests on twelve sets of mixed sizes.
const MOST_UNDER_A_BOX: f64 = 16.0;

/// Maximum number of boxes that are tested against all others, instead of having cells of their own.
const MOST_WITHOUT_LEVEL: u32 = 32;

/// Allowance for boxes that turn, or that are rounded differently elsewhere.
const EXTENT_ALLOWANCE: f32 = 1.0 + 1.0 / 128.0;

/// The boxes of neighbouring size classes.
#[derive(Clone, Copy, Debug)]
pub(super) struct SizeRange {
    /// First and last size class ([`Summary::classes`]).
    pub(super) classes: (usize, usize),
    /// All of these boxes. Extents are rounded up.
    pub(super) all: SizeClass,
}

/// Returns the levels, finest first. Boxes larger than those of the last level have none.
pub(super) fn levels(summary: &Summary) -> Vec<SizeRange> {
    let lengths = [0, 1, 2].map(|k| {
        let (low, high) = summary.range(k);
        (f64::from(high) - f64::from(low)).max(f64::MIN_POSITIVE)
    });
    let mut levels: Vec<SizeRange> = Vec::new();
    for range in used_classes(summary) {
        match levels.last_mut() {
            Some(level) if under_a_box(level, &range, lengths) <= MOST_UNDER_A_BOX => {
                level.classes.1 = range.classes.1;
                level.all.add(&range.all);
            }
            _ => levels.push(range),
        }
    }
    let mut left = MOST_WITHOUT_LEVEL;
    while let [_, .., last] = levels[..]
        && last.all.boxes <= left
    {
        left -= last.all.boxes;
        levels.pop();
    }
    levels
}

fn used_classes(summary: &Summary) -> impl Iterator<Item = SizeRange> {
    let used = summary.classes[..OVERSIZE_CLASS].iter().enumerate().filter(|(_, class)| class.boxes > 0);
    used.map(|(i, class)| SizeRange {
        classes: (i, i),
        all: SizeClass {
            extent: class.extent.map(|extent| (extent * EXTENT_ALLOWANCE).next_up().min(f32::MAX)),
            ..*class
        },
    })
}

/// Returns the number of boxes of a level, spread evenly over these lengths, that lie in the cube around a larger box. Cells
/// are cubes: those of the level would grow with the longest axis, however thin the box is.
fn under_a_box(level: &SizeRange, larger: &SizeRange, lengths: [f64; 3]) -> f64 {
    let edge = larger.all.extent.into_iter().fold(0.0, f32::max);
    let share = |length: f64| (f64::from(edge) / length).min(1.0);
    f64::from(level.all.boxes) * lengths.map(share).into_iter().product::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::Aabb;

    /// Returns `n` x `n` x `n` cubes in a space of 10 x 10 x 10.
    fn cubes(n: u32, edge: f32) -> Vec<Aabb> {
        let at = |i: u32, d: u32| (i / d % n) as f32 * (10.0 / n as f32);
        let center = |i: u32| [at(i, 1), at(i, n), at(i, n * n)];
        (0..n * n * n).map(|i| Aabb::from_center(center(i), [edge / 2.0; 3])).collect()
    }

    /// Returns the numbers of boxes of the levels.
    fn counts(sets: &[Vec<Aabb>]) -> Vec<u32> {
        levels(&Summary::of(&sets.concat())).iter().map(|level| level.all.boxes).collect()
    }

    #[test]
    fn sizes_share_a_level_while_a_larger_box_lies_over_few() {
        let small = cubes(10, 0.3);
        assert_eq!(counts(&[small.clone(), cubes(10, 1.5)]), [2000]);
        assert_eq!(counts(&[small.clone(), cubes(10, 6.0)]), [1000, 1000]);
        // In a level of two sizes more boxes lie under a box.
        assert_eq!(counts(&[small, cubes(10, 1.5), cubes(5, 2.6)]), [2000, 125]);
    }

    #[test]
    fn up_to_32_of_the_largest_boxes_have_no_level() {
        let with = |large: usize, larger: usize| {
            counts(&[cubes(10, 0.3), cubes(4, 6.0)[..large].to_vec(), cubes(4, 50.0)[..larger].to_vec()])
        };
        assert_eq!((with(32, 0), with(33, 0)), (vec![1000], vec![1000, 33]));
        assert_eq!((with(20, 12), with(20, 13)), (vec![1000], vec![1000, 20]));
        assert_eq!(counts(&[cubes(3, 1.0)[..1].to_vec()]), [1], "the only level stays");
    }
}

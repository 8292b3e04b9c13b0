//! A world in f64, beside the one in f32: its poses, boxes and pairs are the reference, near the origin and far from it.

use parry3d_f64::bounding_volume::BoundingVolume;
use parry3d_f64::shape::SharedShape as WideShape;
use pbig_core::{Aabb, Pair, oracle};
use pbig_harness::world::World;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rapier3d::na::{Point3, Translation3, UnitQuaternion, Vector3};
use rapier3d::prelude::{Collider, ColliderBuilder, Isometry, Real, Shape, SharedShape, TypedShape};
use std::ops::AddAssign;

/// A pose in f64.
pub type Pose = rapier3d::na::Isometry3<f64>;

/// A closed box in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wide {
    /// Lower corner.
    pub min: [f64; 3],
    /// Upper corner.
    pub max: [f64; 3],
}

impl Wide {
    /// Returns the largest distance between two boxes along an axis; negative where they overlap on all, by at least as much.
    pub fn gap(&self, other: &Self) -> f64 {
        let gaps = (0..3).map(|k| (self.min[k] - other.max[k]).max(other.min[k] - self.max[k]));
        gaps.fold(f64::NEG_INFINITY, f64::max)
    }
}

/// Returns the largest error of a distance between two boxes in f64 whose poses are at most `farthest` from the origin. If
/// boxes are nearer to each other than that, they count neither as touching nor as apart. The error is tens of roundings,
/// each by 2^-53 of `farthest`.
pub fn doubt(farthest: f64) -> f64 {
    (farthest + 1.0) * 64.0 * f64::EPSILON
}

/// Boxes in f64 and their pairs.
pub struct Truth {
    /// The boxes.
    pub boxes: Vec<Wide>,
    /// Their pairs, in order, with gaps.
    pub pairs: Vec<(Pair, f64)>,
    /// Boxes nearer to touching than this count neither as a pair nor as none.
    pub doubt: f64,
}

/// The differences of pairs from the true ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Differences {
    /// True pairs that are not among them.
    pub missed: u64,
    /// Missed pairs whose boxes overlap by more than the given depth.
    pub missed_deep: u64,
    /// Others that are.
    pub added: u64,
}

impl AddAssign for Differences {
    fn add_assign(&mut self, other: Self) {
        self.missed += other.missed;
        self.missed_deep += other.missed_deep;
        self.added += other.added;
    }
}

impl Truth {
    /// Finds the pairs by brute force over the boxes rounded outward to f32.
    pub fn of(boxes: Vec<Wide>, doubt: f64) -> Self {
        let outward: Vec<Aabb> = boxes.iter().map(|one| Aabb::from_f64(one.min, one.max)).collect();
        let gap = |pair: Pair| (pair, boxes[pair.a as usize].gap(&boxes[pair.b as usize]));
        let pairs = oracle::pairs(&outward).into_iter().map(gap).filter(|(_, gap)| *gap <= 0.0).collect();
        Self { boxes, pairs, doubt }
    }

    /// Compares with pairs in order; `deep` is the overlap from which a missed one also counts as [`Differences::missed_deep`].
    pub fn differences(&self, found: &[Pair], deep: f64) -> Differences {
        let is_lost = |&(pair, gap): &(Pair, f64)| gap < -self.doubt && found.binary_search(&pair).is_err();
        let lost: Vec<f64> = self.pairs.iter().copied().filter(is_lost).map(|(_, gap)| gap).collect();
        let missed_deep = lost.iter().filter(|gap| **gap < -deep - self.doubt).count() as u64;
        let gap = |pair: &Pair| self.boxes[pair.a as usize].gap(&self.boxes[pair.b as usize]);
        let added = found.iter().filter(|pair| gap(pair) > self.doubt).count() as u64;
        Differences { missed: lost.len() as u64, missed_deep, added }
    }
}

/// A pose as f64 has it: the same position, and a rotation whose norm is 1 in f64 too.
pub fn to_f64(pose: &Isometry<Real>) -> Pose {
    let rotation = UnitQuaternion::new_normalize(pose.rotation.into_inner().cast());
    Pose::from_parts(pose.translation.cast(), rotation)
}

/// A pose as rapier holds it: every number rounded to the nearest f32.
pub fn to_f32(pose: &Pose) -> Isometry<Real> {
    let rotation = UnitQuaternion::new_unchecked(pose.rotation.into_inner().cast());
    Isometry::from_parts(pose.translation.cast(), rotation)
}

/// Shapes with their poses near the origin.
#[derive(Clone)]
pub struct Layout {
    placed: Vec<(SharedShape, WideShape, Pose)>,
}

impl Layout {
    /// The colliders of a world, less those whose box f64 does not have: half-spaces.
    pub fn of_world(world: &World) -> Self {
        let bounded = world.colliders.iter().filter(|(_, one)| one.shape().as_halfspace().is_none());
        let placed = |one: &Collider| {
            Some((one.shared_shape().clone(), shape_in_f64(one.shape())?, to_f64(one.position())))
        };
        Self { placed: bounded.filter_map(|(_, one)| placed(one)).collect() }
    }

    /// Shapes of every kind about as large as `size`, turned and placed at random, about two pairs of boxes each.
    pub fn crowd(count: usize, size: f64, seed: u64) -> Self {
        let mut rng = StdRng::seed_from_u64(seed);
        let side = size * 1.1 * (count as f64).cbrt();
        let mut place = |i: usize| {
            let shape = shape(i, size as f32, &mut rng);
            let at = Vector3::from_fn(|_, _| rng.random_range(-0.5 * side..=0.5 * side));
            let turn = Vector3::from_fn(|_, _| rng.random_range(-2.0..2.0));
            let wide = shape_in_f64(&*shape).expect("a shape that f64 has");
            (shape, wide, Pose::new(at, turn))
        };
        Self { placed: (0..count).map(&mut place).collect() }
    }

    /// The poses of all shapes when the world lies elsewhere.
    pub fn poses(&self, offset: [f64; 3]) -> Vec<Pose> {
        let by = Translation3::from(Vector3::from(offset));
        self.placed.iter().map(|(.., pose)| by * pose).collect()
    }

    /// The boxes of all shapes at these poses, grown by `reach`.
    pub fn boxes(&self, poses: &[Pose], reach: f64) -> Vec<Wide> {
        let wide = |((_, shape, _), pose): (&(_, WideShape, _), &Pose)| {
            let aabb = shape.compute_aabb(pose).loosened(reach);
            Wide { min: aabb.mins.coords.into(), max: aabb.maxs.coords.into() }
        };
        self.placed.iter().zip(poses).map(wide).collect()
    }

    /// All shapes as rapier's colliders.
    pub fn colliders(&self, poses: &[Isometry<Real>]) -> Vec<Collider> {
        let shapes = self.placed.iter().map(|(shape, ..)| shape.clone());
        shapes.zip(poses).map(|(shape, &pose)| ColliderBuilder::new(shape).position(pose).build()).collect()
    }
}

/// The `i`-th of a crowd.
fn shape(i: usize, size: f32, rng: &mut StdRng) -> SharedShape {
    let mut part = |low: f32, high: f32| size * rng.random_range(low..high);
    match i % 7 {
        0 => SharedShape::ball(part(0.3, 0.6)),
        1 => SharedShape::cuboid(part(0.2, 0.5), part(0.2, 0.5), part(0.2, 0.5)),
        2 => SharedShape::capsule_y(part(0.2, 0.4), part(0.1, 0.3)),
        3 => SharedShape::cylinder(part(0.2, 0.5), part(0.2, 0.5)),
        4 => SharedShape::cone(part(0.3, 0.6), part(0.2, 0.5)),
        5 => {
            let corners: Vec<_> = (0..12).map(|_| Point3::from([(); 3].map(|()| part(-0.5, 0.5)))).collect();
            SharedShape::convex_hull(&corners).unwrap_or_else(|| SharedShape::ball(0.5 * size))
        }
        _ => {
            let mut beside = |x| Isometry::translation(x * part(0.2, 0.4), part(-0.1, 0.1), 0.0);
            let (left, right) = (beside(-1.0), beside(1.0));
            let half = 0.2 * size;
            SharedShape::compound(vec![
                (left, SharedShape::cuboid(half, half, half)),
                (right, SharedShape::ball(half)),
            ])
        }
    }
}

/// Returns a shape that rapier has in f32, its sizes taken as they are. None for kinds of shapes that no scene has.
fn shape_in_f64(shape: &dyn Shape) -> Option<WideShape> {
    Some(match shape.as_typed_shape() {
        TypedShape::Ball(ball) => WideShape::ball(ball.radius.into()),
        TypedShape::Cuboid(cuboid) => {
            let half = cuboid.half_extents.cast::<f64>();
            WideShape::cuboid(half.x, half.y, half.z)
        }
        TypedShape::Capsule(capsule) => {
            let [a, b] = [capsule.segment.a, capsule.segment.b].map(|end| end.cast());
            WideShape::capsule(a, b, capsule.radius.into())
        }
        TypedShape::Cylinder(it) => WideShape::cylinder(it.half_height.into(), it.radius.into()),
        TypedShape::Cone(it) => WideShape::cone(it.half_height.into(), it.radius.into()),
        TypedShape::ConvexPolyhedron(hull) => {
            let corners: Vec<_> = hull.points().iter().map(|corner| corner.cast()).collect();
            WideShape::convex_hull(&corners)?
        }
        TypedShape::Compound(compound) => {
            let part =
                |(pose, part): &(Isometry<Real>, SharedShape)| Some((to_f64(pose), shape_in_f64(&**part)?));
            WideShape::compound(compound.shapes().iter().map(part).collect::<Option<_>>()?)
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(x: f64) -> Wide {
        Wide { min: [x, 0.0, 0.0], max: [x + 1.0, 1.0, 1.0] }
    }

    #[test]
    fn missed_and_added_pairs_count_and_doubtful_ones_do_not() {
        let truth = Truth::of([0.0, 0.5, 1.25, 2.25 + 1e-12].map(cube).to_vec(), 1e-9);
        let pair = Pair::new;
        assert_eq!(truth.pairs, [(pair(0, 1), -0.5), (pair(1, 2), -0.25)]);
        let differences = |found: &[Pair], deep| {
            let d = truth.differences(found, deep);
            [d.missed, d.missed_deep, d.added]
        };
        assert_eq!(differences(&[pair(0, 1), pair(1, 2)], 0.0), [0, 0, 0]);
        // The third and fourth touch, to the precision of f64.
        assert_eq!(differences(&[pair(2, 3)], 0.3), [2, 1, 0]);
        assert_eq!(differences(&[pair(0, 1), pair(0, 2), pair(1, 2)], 0.0), [0, 0, 1]);
    }

    /// Near the origin f32 and f64 differ by some 2^-24: another formula, or another size, would by far more.
    #[test]
    fn near_the_origin_boxes_are_what_parry_computes_in_f32() {
        let crowd = Layout::crowd(70, 1.0, 3);
        let poses = crowd.poses([0.3, -0.6, 0.2]);
        for (((shape, ..), wide), pose) in crowd.placed.iter().zip(crowd.boxes(&poses, 0.0)).zip(&poses) {
            let (narrow, kind) = (shape.compute_aabb(&to_f32(pose)), shape.shape_type());
            let near = |wide: f64, narrow: f32| (wide - f64::from(narrow)).abs() < 1e-5;
            for k in 0..3 {
                let is_near = near(wide.min[k], narrow.mins[k]) && near(wide.max[k], narrow.maxs[k]);
                assert!(is_near && wide.max[k] - wide.min[k] > 0.1, "{kind:?}: {wide:?} {narrow:?}");
            }
        }
    }

    #[test]
    fn a_world_elsewhere_has_the_same_pairs_in_f64() {
        let near = Layout::crowd(700, 1.0, 3);
        let pairs_at = |offset| Truth::of(near.boxes(&near.poses(offset), 0.0), 0.0).pairs.len();
        assert!((1000..2000).contains(&pairs_at([0.0; 3])), "{} pairs", pairs_at([0.0; 3]));
        assert_eq!(pairs_at([1e7, -1e7, 3e5]), pairs_at([0.0; 3]));
    }
}

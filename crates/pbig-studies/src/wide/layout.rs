//! Shapes and where they are, near the origin; and the same elsewhere, in f64 and as f32 has it.

use super::{Pose, Wide, aabb};
use pbig_harness::world::World;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rapier3d::na::{Point3, Translation3, UnitQuaternion, Vector3};
use rapier3d::prelude::{Collider, ColliderBuilder, Isometry, Real, SharedShape};

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
    placed: Vec<(SharedShape, Pose)>,
}

impl Layout {
    /// The colliders of a world, less those whose box f64 does not have: half-spaces.
    pub fn of_world(world: &World) -> Self {
        let placed =
            world.colliders.iter().map(|(_, one)| (one.shared_shape().clone(), to_f64(one.position())));
        Self { placed: placed.filter(|(shape, pose)| aabb(&**shape, pose).is_some()).collect() }
    }

    /// Shapes of every kind about as large as `size`, turned and placed at random, about two pairs of boxes each.
    pub fn crowd(count: usize, size: f64, seed: u64) -> Self {
        let mut rng = StdRng::seed_from_u64(seed);
        let side = size * 1.1 * (count as f64).cbrt();
        let mut place = |i: usize| {
            let shape = shape(i, size as f32, &mut rng);
            let at = Vector3::from_fn(|_, _| rng.random_range(-0.5 * side..=0.5 * side));
            let turn = Vector3::from_fn(|_, _| rng.random_range(-2.0..2.0));
            (shape, Pose::new(at, turn))
        };
        Self { placed: (0..count).map(&mut place).collect() }
    }

    /// Returns the number of shapes.
    pub fn len(&self) -> usize {
        self.placed.len()
    }

    /// Returns true if there is no shape.
    pub fn is_empty(&self) -> bool {
        self.placed.is_empty()
    }

    /// The poses of all shapes when the world lies elsewhere.
    pub fn poses(&self, offset: [f64; 3]) -> Vec<Pose> {
        let by = Translation3::from(Vector3::from(offset));
        self.placed.iter().map(|(_, pose)| by * pose).collect()
    }

    /// The boxes of all shapes at these poses, grown by `reach`.
    pub fn boxes(&self, poses: &[Pose], reach: f64) -> Vec<Wide> {
        let boxes = self.placed.iter().zip(poses).filter_map(|((shape, _), pose)| aabb(&**shape, pose));
        boxes.map(|one| one.inflated(reach)).collect()
    }

    /// All shapes as rapier's colliders.
    pub fn colliders(&self, poses: &[Isometry<Real>]) -> Vec<Collider> {
        let shapes = self.placed.iter().map(|(shape, _)| shape.clone());
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wide::pairs;
    use pbig_harness::scenes::Scene;

    #[test]
    fn a_world_elsewhere_has_the_same_pairs_in_f64() {
        let near = Layout::crowd(700, 1.0, 3);
        let pairs_at = |offset| pairs(&near.boxes(&near.poses(offset), 0.0)).len();
        assert!((1000..2000).contains(&pairs_at([0.0; 3])), "{} pairs", pairs_at([0.0; 3]));
        assert_eq!(pairs_at([1e7, -1e7, 3e5]), pairs_at([0.0; 3]));
    }

    #[test]
    fn a_scene_has_all_its_colliders_but_the_ground() {
        for name in ["column", "ragdolls", "compounds", "pile"] {
            let world = Scene::named(name).expect("a scene").build(60, 1);
            let layout = Layout::of_world(&world);
            assert_eq!(layout.len() + 1, world.colliders.len(), "{name}");
            assert_eq!(layout.boxes(&layout.poses([0.0; 3]), 0.0).len(), layout.len(), "{name}");
        }
    }
}

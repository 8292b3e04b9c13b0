//! Shapes and where they are, near the origin; and the same elsewhere, in f64 and as f32 has it.

use super::{Pose, Wide};
use parry3d_f64::bounding_volume::{Aabb, BoundingVolume, details::point_cloud_aabb};
use parry3d_f64::shape::{Ball, Capsule, Cone, Cuboid, Cylinder};
use pbig_harness::world::World;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rapier3d::na::{Point3, Translation3, UnitQuaternion, Vector3};
use rapier3d::prelude::{Collider, ColliderBuilder, Isometry, Real, Shape, SharedShape, TypedShape};

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
        Self { placed: placed.filter(|(shape, pose)| parry_aabb(&**shape, pose).is_some()).collect() }
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

    /// The poses of all shapes when the world lies elsewhere.
    pub fn poses(&self, offset: [f64; 3]) -> Vec<Pose> {
        let by = Translation3::from(Vector3::from(offset));
        self.placed.iter().map(|(_, pose)| by * pose).collect()
    }

    /// The boxes of all shapes at these poses, grown by `reach`.
    pub fn boxes(&self, poses: &[Pose], reach: f64) -> Vec<Wide> {
        let boxes = self.placed.iter().zip(poses).filter_map(|((shape, _), pose)| parry_aabb(&**shape, pose));
        let wide = |Aabb { mins, maxs }: Aabb| Wide { min: mins.coords.into(), max: maxs.coords.into() };
        boxes.map(|one| wide(one.loosened(reach))).collect()
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

/// Returns the box of a shape that rapier has in f32, its sizes taken as they are, at a pose in f64. None for kinds of shapes
/// that no scene has, and for half-spaces, whose boxes are no smaller than the world.
fn parry_aabb(shape: &dyn Shape, pose: &Pose) -> Option<Aabb> {
    Some(match shape.as_typed_shape() {
        TypedShape::Ball(ball) => Ball::new(ball.radius.into()).aabb(pose),
        TypedShape::Cuboid(cuboid) => Cuboid::new(cuboid.half_extents.cast()).aabb(pose),
        TypedShape::Capsule(capsule) => {
            let [a, b] = [capsule.segment.a, capsule.segment.b].map(|end| end.cast());
            Capsule::new(a, b, capsule.radius.into()).aabb(pose)
        }
        TypedShape::Cylinder(it) => Cylinder::new(it.half_height.into(), it.radius.into()).aabb(pose),
        TypedShape::Cone(it) => Cone::new(it.half_height.into(), it.radius.into()).aabb(pose),
        TypedShape::ConvexPolyhedron(hull) => {
            point_cloud_aabb(pose, hull.points().iter().map(|corner| corner.cast()))
        }
        TypedShape::Compound(compound) => compound_aabb(compound.shapes())?.transform_by(pose),
        TypedShape::HeightField(_) | TypedShape::TriMesh(_) => {
            let local = shape.compute_local_aabb();
            Aabb::new(local.mins.cast(), local.maxs.cast()).transform_by(pose)
        }
        _ => return None,
    })
}

/// Around its parts, in its own coordinates.
fn compound_aabb<S: std::ops::Deref<Target = dyn Shape>>(parts: &[(Isometry<Real>, S)]) -> Option<Aabb> {
    let parts = parts.iter().map(|(pose, part)| parry_aabb(&**part, &to_f64(pose)));
    parts.reduce(|sum, part| Some(sum?.merged(&part?))).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rapier3d::prelude::Vector;

    /// Near the origin f32 and f64 differ by some 2^-24: another formula, or another size, would by far more.
    #[test]
    fn near_the_origin_boxes_are_what_parry_computes_in_f32() {
        let crowd = Layout::crowd(70, 1.0, 3);
        let poses = crowd.poses([0.3, -0.6, 0.2]);
        for ((shape, _), (wide, pose)) in crowd.placed.iter().zip(crowd.boxes(&poses, 0.0).iter().zip(&poses))
        {
            let narrow = shape.compute_aabb(&to_f32(pose));
            for k in 0..3 {
                let apart =
                    [wide.min[k] - f64::from(narrow.mins[k]), wide.max[k] - f64::from(narrow.maxs[k])];
                assert!(apart.iter().all(|x| x.abs() < 1e-5), "{:?}: {apart:?}", shape.shape_type());
                assert!(wide.max[k] - wide.min[k] > 0.1, "{:?}: {wide:?}", shape.shape_type());
            }
        }
        assert_eq!(parry_aabb(&*SharedShape::halfspace(Vector::y_axis()), &Pose::identity()), None);
    }

    #[test]
    fn a_world_elsewhere_has_the_same_pairs_in_f64() {
        let near = Layout::crowd(700, 1.0, 3);
        let pairs_at = |offset| super::super::pairs(&near.boxes(&near.poses(offset), 0.0)).len();
        assert!((1000..2000).contains(&pairs_at([0.0; 3])), "{} pairs", pairs_at([0.0; 3]));
        assert_eq!(pairs_at([1e7, -1e7, 3e5]), pairs_at([0.0; 3]));
    }
}

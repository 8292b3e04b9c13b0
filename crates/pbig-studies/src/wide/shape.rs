//! The box of a shape in f64.

use super::{Pose, Wide};
use parry3d_f64::bounding_volume::{Aabb, BoundingVolume, details::point_cloud_aabb};
use parry3d_f64::shape::{Ball, Capsule, Cone, Cuboid, Cylinder};
use rapier3d::prelude::{Isometry, Real, Shape, TypedShape};

/// The box of a shape that rapier has in f32, its sizes taken as they are, at a pose in f64. None for kinds of shapes that no
/// scene has, and for half-spaces, whose boxes are no smaller than the world.
pub fn aabb(shape: &dyn Shape, pose: &Pose) -> Option<Wide> {
    let Aabb { mins, maxs } = parry_aabb(shape, pose)?;
    Some(Wide { min: mins.coords.into(), max: maxs.coords.into() })
}

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
    let parts = parts.iter().map(|(pose, part)| parry_aabb(&**part, &super::to_f64(pose)));
    parts.reduce(|sum, part| Some(sum?.merged(&part?))).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rapier3d::prelude::{SharedShape, Vector, nalgebra, vector};

    /// Near the origin f32 and f64 differ by some 2^-24: another formula, or another size, would by far more.
    #[test]
    fn near_the_origin_it_is_what_parry_computes_in_f32() {
        let turn: Vector<Real> = vector![0.4, -1.1, 0.7];
        let pose = Isometry::new(vector![0.3, -0.6, 0.2], turn);
        let part = (Isometry::new(vector![0.5, 0.0, 0.1], turn), SharedShape::cuboid(0.2, 0.3, 0.4));
        let corners: Vec<_> = (0..12)
            .map(|i| rapier3d::na::Point3::new((i % 3) as f32, (i % 5) as f32, (i % 7) as f32))
            .collect();
        let shapes = [
            SharedShape::ball(0.7),
            SharedShape::cuboid(0.2, 0.5, 0.9),
            SharedShape::capsule_x(0.6, 0.2),
            SharedShape::cylinder(0.6, 0.2),
            SharedShape::cone(0.6, 0.4),
            SharedShape::convex_hull(&corners).expect("a hull"),
            SharedShape::compound(vec![part, (pose, SharedShape::ball(0.3))]),
        ];
        for shape in shapes {
            let (wide, narrow) = (aabb(&*shape, &super::super::to_f64(&pose)), shape.compute_aabb(&pose));
            let wide = wide.expect("a kind that is known");
            for k in 0..3 {
                let apart =
                    [wide.min[k] - f64::from(narrow.mins[k]), wide.max[k] - f64::from(narrow.maxs[k])];
                assert!(apart.iter().all(|x| x.abs() < 1e-5), "{:?}: {apart:?}", shape.shape_type());
                assert!(wide.max[k] - wide.min[k] > 0.3, "{:?}: {wide:?}", shape.shape_type());
            }
        }
        assert_eq!(aabb(&*SharedShape::halfspace(Vector::y_axis()), &Pose::identity()), None);
    }
}

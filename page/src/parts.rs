//! The simple shapes that a collider is drawn with.

use crate::mesh::Mesh;
use rapier3d::parry::shape::{Shape, TypedShape};
use rapier3d::prelude::*;

/// Shape of a part before it is scaled. Each fits into the cube from -1 to 1, but for half-spaces and meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A ball of radius 1.
    Ball,
    /// The cube from -1 to 1.
    Cuboid,
    /// A cylinder of radius 1, along y from -1 to 1.
    Cylinder,
    /// A cone of radius 1, along y from its base at -1 to its tip at 1.
    Cone,
    /// The half-space below the plane y = 0.
    HalfSpace,
    /// Triangles of a shape that is none of the others; the number of its mesh.
    Mesh(u32),
}

/// Colour class of a part. A page maps each class to a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Colour {
    Fixed,
    Ball,
    Cuboid,
    Slab,
    Capsule,
    Other,
}

/// A scaled shape at a place in its collider.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    pub(crate) kind: Kind,
    pub(crate) colour: Colour,
    pub(crate) local: Isometry<Real>,
    pub(crate) scale: Vector<Real>,
}

/// Number of sides of a round border in a mesh.
const MESH_SIDES: u32 = 12;

/// Appends the parts of a shape at a place in its collider. Shapes without a kind of their own become meshes.
pub(crate) fn append_parts(
    shape: &dyn Shape,
    at: &Isometry<Real>,
    parts: &mut Vec<Part>,
    meshes: &mut Vec<Mesh>,
) {
    let mut add = |kind, colour, scale| parts.push(Part { kind, colour, local: *at, scale });
    let upright = |radius, half_height| vector![radius, half_height, radius];
    match shape.as_typed_shape() {
        TypedShape::Ball(ball) => add(Kind::Ball, Colour::Ball, Vector::repeat(ball.radius)),
        TypedShape::Cuboid(cuboid) => add(Kind::Cuboid, colour_of(&cuboid.half_extents), cuboid.half_extents),
        TypedShape::Cylinder(it) => add(Kind::Cylinder, Colour::Other, upright(it.radius, it.half_height)),
        TypedShape::Cone(it) => add(Kind::Cone, Colour::Other, upright(it.radius, it.half_height)),
        // Drawn with sharp corners, so that all of them are one group.
        TypedShape::RoundCuboid(it) => {
            let half_extents = it.inner_shape.half_extents.add_scalar(it.border_radius);
            add(Kind::Cuboid, colour_of(&half_extents), half_extents);
        }
        TypedShape::HalfSpace(it) => parts.push(half_space(it, at)),
        TypedShape::Capsule(capsule) => parts.extend(capsule_parts(capsule, at)),
        TypedShape::Compound(compound) => {
            for (pose, shape) in compound.shapes() {
                append_parts(&**shape, &(at * pose), parts, meshes);
            }
        }
        other => append_mesh(other, at, parts, meshes),
    }
}

fn append_mesh(shape: TypedShape<'_>, at: &Isometry<Real>, parts: &mut Vec<Part>, meshes: &mut Vec<Mesh>) {
    // A shape without triangles, such as a polyline, is not drawn.
    let Some(mesh) = Mesh::of(shape, MESH_SIDES) else { return };
    let kind = Kind::Mesh(meshes.len() as u32);
    meshes.push(mesh);
    parts.push(Part { kind, colour: Colour::Other, local: *at, scale: Vector::repeat(1.0) });
}

/// A cuboid that is less than half as thick as wide is a slab.
fn colour_of(half_extents: &Vector<Real>) -> Colour {
    if half_extents.min() < 0.5 * half_extents.max() { Colour::Slab } else { Colour::Cuboid }
}

fn half_space(half_space: &HalfSpace, at: &Isometry<Real>) -> Part {
    let turn = Rotation::rotation_between(&Vector::y_axis(), &half_space.normal);
    // A normal straight down has no shortest rotation.
    let turn = turn.unwrap_or_else(|| Rotation::from_axis_angle(&Vector::x_axis(), std::f32::consts::PI));
    let local = at * Isometry::from_parts(Translation::identity(), turn);
    Part { kind: Kind::HalfSpace, colour: Colour::Fixed, local, scale: Vector::repeat(1.0) }
}

/// A cylinder between two balls: a scaled capsule would have flat ends.
fn capsule_parts(capsule: &Capsule, at: &Isometry<Real>) -> [Part; 3] {
    let radius = capsule.radius;
    let ends = [capsule.segment.a, capsule.segment.b];
    let ball = |end: Point<Real>| Part {
        kind: Kind::Ball,
        colour: Colour::Capsule,
        local: at * Translation::from(end),
        scale: Vector::repeat(radius),
    };
    let middle = Translation::from(capsule.segment.a.coords.lerp(&capsule.segment.b.coords, 0.5));
    let local = at * Isometry::from_parts(middle, capsule.rotation_wrt_y());
    let scale = vector![radius, capsule.half_height(), radius];
    [Part { kind: Kind::Cylinder, colour: Colour::Capsule, local, scale }, ball(ends[0]), ball(ends[1])]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts_of(shape: &SharedShape) -> Vec<Part> {
        let mut parts = Vec::new();
        append_parts(&*shape.0, &Isometry::identity(), &mut parts, &mut Vec::new());
        parts
    }

    /// The parts of a shape fill its AABB, whatever the shape and its place.
    #[test]
    fn parts_have_the_aabb_of_their_shape() {
        let pose = Isometry::translation(1.0, 2.0, 3.0);
        let shapes = [
            SharedShape::ball(0.7),
            SharedShape::cuboid(0.1, 0.2, 0.3),
            SharedShape::capsule_x(0.4, 0.2),
            SharedShape::capsule_y(0.4, 0.2),
            SharedShape::cylinder(0.4, 0.2),
            SharedShape::round_cuboid(0.1, 0.2, 0.3, 0.05),
            SharedShape::compound(vec![
                (pose, SharedShape::ball(0.5)),
                (pose, SharedShape::cuboid(0.1, 2.0, 0.1)),
            ]),
        ];
        for shape in shapes {
            let boxes = parts_of(&shape).into_iter().map(|part| aabb(&part));
            let drawn = boxes.reduce(|one, other| one.merged(&other)).expect("a part");
            let wanted = shape.compute_local_aabb();
            let distance = (drawn.mins - wanted.mins).norm() + (drawn.maxs - wanted.maxs).norm();
            assert!(distance < 1e-5, "{:?}: {drawn:?} is not {wanted:?}", shape.shape_type());
        }
    }

    fn aabb(part: &Part) -> Aabb {
        let s = part.scale;
        match part.kind {
            Kind::Ball => Ball::new(s.x).aabb(&part.local),
            Kind::Cuboid => Cuboid::new(s).aabb(&part.local),
            Kind::Cylinder => Cylinder::new(s.y, s.x).aabb(&part.local),
            kind => panic!("{kind:?} is not expected"),
        }
    }

    #[test]
    fn the_plane_of_a_half_space_faces_its_normal() {
        for normal in [Vector::y_axis(), Vector::x_axis(), -Vector::y_axis()] {
            let part = parts_of(&SharedShape::halfspace(normal))[0];
            assert!((part.local * Vector::y() - *normal).norm() < 1e-6, "{normal:?}");
        }
    }
}

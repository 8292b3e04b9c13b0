//! The simple shapes that a world's colliders are drawn with, for a window and for a web page. Parts of one kind are a group,
//! which one instanced call draws.

use crate::world::World;
use rapier3d::na::Matrix4;
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
    /// The half-space below the plane y = 0.
    HalfSpace,
    /// The triangles of a height field; the number of its mesh.
    Mesh(u32),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Colour {
    Fixed,
    Ball,
    /// A box that is about as thick as it is wide.
    Cuboid,
    /// A flat or long box.
    Slab,
    Capsule,
    Other,
}

/// A scaled shape at a place in its collider.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    pub kind: Kind,
    pub colour: Colour,
    pub local: Isometry<Real>,
    /// Its half extents, if its kind fits into the cube.
    pub scale: Vector<Real>,
}

impl Part {
    /// Returns the matrix that scales the shape, and places it where its collider is.
    pub fn matrix(&self, collider: &Collider) -> Matrix4<Real> {
        (collider.position() * self.local).to_homogeneous().prepend_nonuniform_scaling(&self.scale)
    }
}

/// Vertices in the frame of a shape, and the three vertices of each triangle.
pub type Triangles = (Vec<Point<Real>>, Vec<[u32; 3]>);

#[derive(Clone, Copy, Debug)]
pub struct Member {
    pub collider: ColliderHandle,
    /// True for parts that would hide what happens: those of sensors, and walls.
    pub is_translucent: bool,
    pub part: Part,
}

impl Member {
    fn key(&self) -> (Kind, bool) {
        (self.part.kind, self.is_translucent)
    }
}

/// Every part of a world, sorted by kind.
pub struct Drawn {
    /// The parts. Those of a kind and translucency lie together, in the order of their colliders.
    pub members: Vec<Member>,
    /// The meshes that parts name by number.
    pub meshes: Vec<Triangles>,
    colliders: usize,
}

impl Drawn {
    /// Takes the colliders of a world apart.
    pub fn new(world: &World) -> Self {
        let mut drawn = Self { members: Vec::new(), meshes: Vec::new(), colliders: world.colliders.len() };
        for (handle, collider) in world.colliders.iter() {
            drawn.append(handle, collider, world);
        }
        // A stable sort: parts of a group keep the order of their colliders.
        drawn.members.sort_by_key(Member::key);
        drawn
    }

    /// Returns true if the world has another number of colliders than the parts were made from.
    pub fn is_outdated(&self, world: &World) -> bool {
        self.colliders != world.colliders.len()
    }

    /// Returns the parts group by group: of one kind, translucent or not.
    pub fn groups(&self) -> impl Iterator<Item = &[Member]> {
        self.members.chunk_by(|one, other| one.key() == other.key())
    }

    fn append(&mut self, handle: ColliderHandle, collider: &Collider, world: &World) {
        let mut parts = Vec::new();
        append_parts(collider.shape(), &Isometry::identity(), &mut parts, &mut self.meshes);
        let is_fixed = !world.can_move(collider);
        for mut part in parts {
            if is_fixed {
                part.colour = Colour::Fixed;
            }
            let is_ground = matches!(part.kind, Kind::HalfSpace | Kind::Mesh(_));
            let is_translucent = collider.is_sensor() || is_fixed && !is_ground;
            self.members.push(Member { collider: handle, is_translucent, part });
        }
    }
}

/// Appends the parts of a shape at a place in its collider. Shapes that no scene has are not drawn.
fn append_parts(shape: &dyn Shape, at: &Isometry<Real>, parts: &mut Vec<Part>, meshes: &mut Vec<Triangles>) {
    let mut add = |kind, colour, scale| parts.push(Part { kind, colour, local: *at, scale });
    match shape.as_typed_shape() {
        TypedShape::Ball(ball) => add(Kind::Ball, Colour::Ball, Vector::repeat(ball.radius)),
        TypedShape::Cuboid(cuboid) => add(Kind::Cuboid, colour_of(&cuboid.half_extents), cuboid.half_extents),
        TypedShape::HalfSpace(it) => parts.push(half_space(it, at)),
        TypedShape::Capsule(capsule) => parts.extend(capsule_parts(capsule, at)),
        TypedShape::HeightField(field) => {
            add(Kind::Mesh(meshes.len() as u32), Colour::Other, Vector::repeat(1.0));
            meshes.push(field.to_trimesh());
        }
        TypedShape::Compound(compound) => {
            for (pose, shape) in compound.shapes() {
                append_parts(&**shape, &(at * pose), parts, meshes);
            }
        }
        _ => {}
    }
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
    use crate::scenes::Scene;

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
            SharedShape::capsule_z(0.4, 0.2),
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

    #[test]
    fn a_matrix_scales_then_places() {
        let cuboid = ColliderBuilder::cuboid(1.0, 2.0, 3.0).translation(vector![4.0, 5.0, 6.0]).build();
        let wanted = [1., 0., 0., 0., 0., 2., 0., 0., 0., 0., 3., 0., 4., 5., 6., 1.];
        assert_eq!(parts_of(&cuboid.shared_shape().clone())[0].matrix(&cuboid).as_slice(), wanted);
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
    fn flat_boxes_are_slabs() {
        assert_eq!(parts_of(&SharedShape::cuboid(0.5, 0.1, 0.5))[0].colour, Colour::Slab);
        assert_eq!(parts_of(&SharedShape::cuboid(0.5, 0.4, 0.5))[0].colour, Colour::Cuboid);
    }

    #[test]
    fn the_plane_of_a_half_space_faces_its_normal() {
        for normal in [Vector::y_axis(), Vector::x_axis(), -Vector::y_axis()] {
            let part = parts_of(&SharedShape::halfspace(normal))[0];
            assert!((part.local * Vector::y() - *normal).norm() < 1e-6, "{normal:?}");
        }
    }

    /// Each scene has a part to draw of every collider, and groups that have all parts.
    #[test]
    fn groups_cover_every_scene() {
        for scene in Scene::ALL {
            let mut world = scene.build(100, 1);
            let drawn = Drawn::new(&world);
            let grouped: usize = drawn.groups().map(<[Member]>::len).sum();
            assert_eq!(grouped, drawn.members.len(), "{}", scene.name);
            let has_part = |(handle, _): (ColliderHandle, &Collider)| {
                drawn.members.iter().any(|member| member.collider == handle)
            };
            assert!(world.colliders.iter().all(has_part), "{}", scene.name);
            let is_number = |member: &Member| member.part.scale.iter().all(|x| x.is_finite());
            assert!(drawn.members.iter().all(is_number), "{}", scene.name);
            assert!(!drawn.is_outdated(&world));
            world.colliders.insert(ColliderBuilder::ball(1.0));
            assert!(drawn.is_outdated(&world));
        }
    }
}

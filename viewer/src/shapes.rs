//! Colliders as instances of a few meshes.

use crate::palette::{Palette, Rgb};
use crate::rapier::pose;
use kiss3d::prelude::{Mat3, Pose3, Quat, Vec3};
use pbig_scenes::world::World;
use rapier3d::parry::shape::{Shape, TypedShape};
use rapier3d::prelude::*;

/// The mesh of an object. Cubes and slabs share a mesh, and so do the parts of capsules with balls and cylinders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Primitive {
    /// A ball.
    Ball,
    /// A box that is about as thick as it is wide.
    Cube,
    /// A flat or long box.
    Slab,
    /// A cylinder with round ends.
    Capsule,
    /// A cylinder along y.
    Cylinder,
    /// A cone along y.
    Cone,
}

/// The meshes that are drawn, each in the cube from -0.5 to 0.5.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mesh {
    /// A ball.
    Ball,
    /// A cube.
    Cube,
    /// A cylinder along y.
    Cylinder,
    /// A cone along y.
    Cone,
}

impl Mesh {
    /// Every mesh.
    pub const ALL: [Self; 4] = [Self::Ball, Self::Cube, Self::Cylinder, Self::Cone];
}

/// A mesh at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// The mesh.
    pub mesh: Mesh,
    /// The place of the mesh's origin.
    pub position: [f32; 3],
    /// Rotation times scale, by columns.
    pub columns: [[f32; 3]; 3],
    /// The colour.
    pub colour: Rgb,
    /// True for sensors, which one can look through.
    pub is_sensor: bool,
}

/// A surface that does not move, such as a height field.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Corners.
    pub vertices: Vec<[f32; 3]>,
    /// Triangles, as three corners each.
    pub triangles: Vec<[u32; 3]>,
}

/// A slab's smallest edge is at most this share of its largest.
const SLAB_FLATNESS: f32 = 0.6;

/// Returns a vector of rapier's, or a point, as one that can be drawn.
pub fn to_vec3(vector: impl Into<[f32; 3]>) -> Vec3 {
    Vec3::from_array(vector.into())
}

/// Returns the kind of a shape.
pub fn primitive_of(shape: &dyn Shape) -> Primitive {
    match shape.as_typed_shape() {
        TypedShape::Ball(_) => Primitive::Ball,
        TypedShape::Cuboid(cuboid) => primitive_of_box(to_vec3(cuboid.half_extents)),
        TypedShape::RoundCuboid(round) => primitive_of_box(to_vec3(round.inner_shape.half_extents)),
        TypedShape::Capsule(_) => Primitive::Capsule,
        TypedShape::Cylinder(_) => Primitive::Cylinder,
        TypedShape::Cone(_) => Primitive::Cone,
        _ => Primitive::Cube,
    }
}

fn primitive_of_box(half: Vec3) -> Primitive {
    if half.min_element() <= SLAB_FLATNESS * half.max_element() { Primitive::Slab } else { Primitive::Cube }
}

/// Appends what is to be drawn of all colliders, but for surfaces and half-spaces.
pub fn instances(world: &World, palette: &Palette<'_>, out: &mut Vec<Instance>) {
    for (handle, collider) in world.colliders.iter_enabled() {
        let mut push = |shape: &dyn Shape, pose: Pose3| {
            let colour = palette.colour(handle, collider, primitive_of(shape));
            append(shape, pose, |mesh, pose, size| {
                out.push(place(mesh, pose, size, colour, collider.is_sensor()));
            });
        };
        let at = pose(collider.position());
        match collider.shape().as_compound() {
            None => push(collider.shape(), at),
            Some(compound) => {
                for (local, shape) in compound.shapes() {
                    push(&**shape, at * pose(local));
                }
            }
        }
    }
}

/// Calls `draw` with each mesh of a shape, its pose and its size. A shape without a mesh is drawn as the box around it.
fn append(shape: &dyn Shape, pose: Pose3, mut draw: impl FnMut(Mesh, Pose3, Vec3)) {
    let round = |radius: f32, half_height: f32| 2.0 * Vec3::new(radius, half_height, radius);
    match shape.as_typed_shape() {
        TypedShape::Ball(ball) => draw(Mesh::Ball, pose, Vec3::splat(2.0 * ball.radius)),
        TypedShape::Cuboid(cuboid) => draw(Mesh::Cube, pose, 2.0 * to_vec3(cuboid.half_extents)),
        TypedShape::Cylinder(c) => draw(Mesh::Cylinder, pose, round(c.radius, c.half_height)),
        TypedShape::Cone(c) => draw(Mesh::Cone, pose, round(c.radius, c.half_height)),
        TypedShape::Capsule(capsule) => append_capsule(capsule, pose, draw),
        TypedShape::HalfSpace(_) | TypedShape::HeightField(_) | TypedShape::TriMesh(_) => {}
        _ => {
            let around = shape.compute_local_aabb();
            let middle = Pose3::from_translation(to_vec3(around.center()));
            draw(Mesh::Cube, pose * middle, to_vec3(around.extents()));
        }
    }
}

fn append_capsule(capsule: &Capsule, pose: Pose3, mut draw: impl FnMut(Mesh, Pose3, Vec3)) {
    let wide = 2.0 * capsule.radius;
    let ends = [capsule.segment.a, capsule.segment.b].map(to_vec3);
    for end in ends {
        draw(Mesh::Ball, pose * Pose3::from_translation(end), Vec3::splat(wide));
    }
    let along = ends[1] - ends[0];
    let turn = Quat::from_rotation_arc(Vec3::Y, along.normalize_or(Vec3::Y));
    let middle = Pose3::from_parts(ends[0] + 0.5 * along, turn);
    draw(Mesh::Cylinder, pose * middle, Vec3::new(wide, along.length(), wide));
}

fn place(mesh: Mesh, pose: Pose3, size: Vec3, colour: Rgb, is_sensor: bool) -> Instance {
    let columns = (Mat3::from_quat(pose.rotation) * Mat3::from_diagonal(size)).to_cols_array_2d();
    Instance { mesh, position: pose.translation.into(), columns, colour, is_sensor }
}

/// Returns the surfaces of fixed colliders, in world coordinates. They are read once, because they do not move.
pub fn surfaces(world: &World) -> Vec<Surface> {
    let surface = |collider: &Collider| {
        let (points, triangles) = match collider.shape().as_typed_shape() {
            TypedShape::HeightField(field) => field.to_trimesh(),
            TypedShape::TriMesh(mesh) => (mesh.vertices().to_vec(), mesh.indices().to_vec()),
            _ => return None,
        };
        let at = pose(collider.position());
        let vertices = points.iter().map(|&point| (at * to_vec3(point)).into()).collect();
        Some(Surface { vertices, triangles })
    };
    world.colliders.iter_enabled().filter_map(|(_, collider)| surface(collider)).collect()
}

/// Returns true if a half-space is among the colliders. It is drawn as ground at height 0, where all scenes have theirs.
pub fn has_ground(world: &World) -> bool {
    world.colliders.iter().any(|(_, collider)| collider.shape().as_halfspace().is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(collider: &Collider) -> Vec<Instance> {
        let mut drawn = Vec::new();
        append(collider.shape(), pose(collider.position()), |mesh, pose, size| {
            drawn.push(place(mesh, pose, size, [1.0; 3], false));
        });
        drawn
    }

    /// The lower and the upper corner of the box around instances of meshes that fill their cubes.
    fn around(instances: &[Instance]) -> [Vec3; 2] {
        let mut points = Vec::new();
        for Instance { position, columns, .. } in instances {
            for corner in 0..8 {
                let at = |i: usize| if corner >> i & 1 == 0 { -0.5 } else { 0.5 };
                let local = Vec3::new(at(0), at(1), at(2));
                points.push(to_vec3(*position) + Mat3::from_cols_array_2d(columns) * local);
            }
        }
        [Vec3::min, Vec3::max].map(|choose| points.iter().copied().reduce(choose).unwrap())
    }

    #[test]
    fn shapes_are_drawn_where_rapier_has_them() {
        let shapes = [
            SharedShape::ball(0.5),
            SharedShape::cuboid(0.1, 0.2, 0.3),
            SharedShape::cylinder(0.7, 0.2),
            SharedShape::cone(0.7, 0.2),
            SharedShape::capsule_x(0.6, 0.2),
            SharedShape::capsule_y(0.6, 0.2),
            SharedShape::capsule_z(0.6, 0.2),
            SharedShape::round_cuboid(0.3, 0.2, 0.1, 0.05),
        ];
        for shape in shapes {
            let turn = [std::f32::consts::FRAC_PI_2, 0.0, 0.0];
            let placed =
                ColliderBuilder::new(shape).translation([1.0, 2.0, 3.0].into()).rotation(turn.into());
            let collider = placed.build();
            let (found, wanted) = (around(&drawn(&collider)), collider.compute_aabb());
            let is_near = |a: Vec3, b: Vec3| (a - b).abs().max_element() < 1e-4;
            let is_right = is_near(found[0], to_vec3(wanted.mins)) && is_near(found[1], to_vec3(wanted.maxs));
            assert!(is_right, "{:?}: {found:?}, not {wanted:?}", collider.shape().shape_type());
        }
    }

    #[test]
    fn flat_boxes_are_slabs() {
        assert_eq!(primitive_of(&*SharedShape::cuboid(0.5, 0.1, 0.5)), Primitive::Slab);
        assert_eq!(primitive_of(&*SharedShape::cuboid(0.5, 0.4, 0.5)), Primitive::Cube);
    }

    #[test]
    fn a_height_field_is_a_surface_and_a_half_space_is_the_ground() {
        let mut world = World::default();
        assert!(!has_ground(&world));
        world.colliders.insert(World::ground());
        let field = ColliderBuilder::heightfield(DMatrix::from_element(3, 3, 0.5), [4.0, 2.0, 4.0].into());
        world.colliders.insert(field.translation([0.0, 1.0, 0.0].into()));
        let surfaces = surfaces(&world);
        assert!(has_ground(&world) && surfaces.len() == 1 && surfaces[0].triangles.len() == 8);
        assert!(surfaces[0].vertices.iter().all(|vertex| vertex[1] == 2.0));
    }
}

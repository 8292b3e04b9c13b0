//! Colliders as instances of a few meshes.

use crate::palette::{Palette, Rgb};
use pbig_scenes::world::World;
use rapier3d::parry::shape::{Shape, TypedShape};
use rapier3d::prelude::*;

/// What an object looks like. Cubes and slabs share a mesh, and so do the parts of capsules with balls and cylinders.
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

/// Returns the kind of a shape.
pub fn primitive_of(shape: &dyn Shape) -> Primitive {
    match shape.as_typed_shape() {
        TypedShape::Ball(_) => Primitive::Ball,
        TypedShape::Cuboid(cuboid) => primitive_of_box(cuboid.half_extents),
        TypedShape::RoundCuboid(round) => primitive_of_box(round.inner_shape.half_extents),
        TypedShape::Capsule(_) => Primitive::Capsule,
        TypedShape::Cylinder(_) => Primitive::Cylinder,
        TypedShape::Cone(_) => Primitive::Cone,
        _ => Primitive::Cube,
    }
}

fn primitive_of_box(half: Vector<Real>) -> Primitive {
    if half.min() <= SLAB_FLATNESS * half.max() { Primitive::Slab } else { Primitive::Cube }
}

/// Appends what is to be drawn of all colliders, but for surfaces and half-spaces.
pub fn instances(world: &World, palette: &Palette<'_>, out: &mut Vec<Instance>) {
    for (handle, collider) in world.colliders.iter_enabled() {
        let mut push = |shape: &dyn Shape, pose: &Isometry<Real>| {
            let colour = palette.colour(handle, collider, primitive_of(shape));
            append(shape, pose, |mesh, pose, size| {
                out.push(place(mesh, &pose, size, colour, collider.is_sensor()));
            });
        };
        match collider.shape().as_compound() {
            None => push(collider.shape(), collider.position()),
            Some(compound) => {
                for (local, shape) in compound.shapes() {
                    push(&**shape, &(collider.position() * local));
                }
            }
        }
    }
}

/// Calls `draw` with each mesh of a shape, its pose and its size. A shape without a mesh is drawn as the box around it.
fn append(
    shape: &dyn Shape,
    pose: &Isometry<Real>,
    mut draw: impl FnMut(Mesh, Isometry<Real>, Vector<Real>),
) {
    match shape.as_typed_shape() {
        TypedShape::Ball(ball) => draw(Mesh::Ball, *pose, Vector::repeat(2.0 * ball.radius)),
        TypedShape::Cuboid(cuboid) => draw(Mesh::Cube, *pose, 2.0 * cuboid.half_extents),
        TypedShape::Cylinder(c) => {
            draw(Mesh::Cylinder, *pose, vector![2.0 * c.radius, 2.0 * c.half_height, 2.0 * c.radius]);
        }
        TypedShape::Cone(c) => {
            draw(Mesh::Cone, *pose, vector![2.0 * c.radius, 2.0 * c.half_height, 2.0 * c.radius])
        }
        TypedShape::Capsule(capsule) => append_capsule(capsule, pose, draw),
        TypedShape::HalfSpace(_) | TypedShape::HeightField(_) | TypedShape::TriMesh(_) => {}
        _ => {
            let around = shape.compute_local_aabb();
            draw(Mesh::Cube, pose * Translation::from(around.center().coords), around.extents());
        }
    }
}

fn append_capsule(
    capsule: &Capsule,
    pose: &Isometry<Real>,
    mut draw: impl FnMut(Mesh, Isometry<Real>, Vector<Real>),
) {
    let wide = 2.0 * capsule.radius;
    for end in [capsule.segment.a, capsule.segment.b] {
        draw(Mesh::Ball, pose * Translation::from(end.coords), Vector::repeat(wide));
    }
    let along = capsule.segment.b - capsule.segment.a;
    let turn = Rotation::rotation_between(&Vector::y(), &along).unwrap_or_default();
    let middle = Translation::from(capsule.segment.a.coords + 0.5 * along);
    draw(Mesh::Cylinder, pose * Isometry::from_parts(middle, turn), vector![wide, along.norm(), wide]);
}

fn place(mesh: Mesh, pose: &Isometry<Real>, size: Vector<Real>, colour: Rgb, is_sensor: bool) -> Instance {
    let turn = pose.rotation.to_rotation_matrix();
    let columns = std::array::from_fn(|i| (turn.matrix().column(i) * size[i]).into());
    Instance { mesh, position: pose.translation.vector.into(), columns, colour, is_sensor }
}

/// Returns the surfaces of fixed colliders, in world coordinates. They are read once, because they do not move.
pub fn surfaces(world: &World) -> Vec<Surface> {
    let surface = |collider: &Collider| {
        let (points, triangles) = match collider.shape().as_typed_shape() {
            TypedShape::HeightField(field) => field.to_trimesh(),
            TypedShape::TriMesh(mesh) => (mesh.vertices().to_vec(), mesh.indices().to_vec()),
            _ => return None,
        };
        let vertices = points.iter().map(|point| (collider.position() * point).into()).collect();
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

    fn drawn(shape: &SharedShape, pose: Isometry<Real>) -> Vec<Instance> {
        let mut drawn = Vec::new();
        append(&**shape, &pose, |mesh, pose, size| drawn.push(place(mesh, &pose, size, [1.0; 3], false)));
        drawn
    }

    /// The box around an instance of a mesh that fills its cube.
    fn around(instances: &[Instance]) -> Aabb {
        let mut points = Vec::new();
        for Instance { position, columns, .. } in instances {
            for corner in 0..8 {
                let at = |i: usize| if corner >> i & 1 == 0 { -0.5 } else { 0.5 };
                points.push(Point::from(std::array::from_fn(|axis| {
                    position[axis] + (0..3).map(|i| at(i) * columns[i][axis]).sum::<f32>()
                })));
            }
        }
        Aabb::from_points(points)
    }

    #[test]
    fn shapes_are_drawn_where_rapier_has_them() {
        let pose = Isometry::new(vector![1.0, 2.0, 3.0], Vector::x() * std::f32::consts::FRAC_PI_2);
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
            let (found, wanted) = (around(&drawn(&shape, pose)), shape.compute_aabb(&pose));
            let apart = (found.mins - wanted.mins).amax().max((found.maxs - wanted.maxs).amax());
            assert!(apart < 1e-4, "{:?}: {found:?}, not {wanted:?}", shape.shape_type());
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
        let heights = DMatrix::from_element(3, 3, 0.5);
        let field =
            ColliderBuilder::heightfield(heights, vector![4.0, 2.0, 4.0]).translation(vector![0.0, 1.0, 0.0]);
        world.colliders.insert(field);
        let surfaces = surfaces(&world);
        assert!(has_ground(&world) && surfaces.len() == 1 && surfaces[0].triangles.len() == 8);
        assert!(surfaces[0].vertices.iter().all(|vertex| vertex[1] == 2.0));
    }
}

//! Parts of colliders as instances of a few meshes.

use crate::palette::{Palette, Rgb};
use kiss3d::prelude::{Mat3, Pose3, Quat, Vec3};
use pbig_scenes::drawn::{Drawn, Kind, Member};
use pbig_scenes::world::World;
use rapier3d::prelude::*;

/// The kinds of parts that are drawn as instances. Half-spaces and meshes do not move.
pub const KINDS: [Kind; 3] = [Kind::Ball, Kind::Cuboid, Kind::Cylinder];

/// A part at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// The shape, one of [`KINDS`].
    pub kind: Kind,
    /// The place of the shape's origin.
    pub position: [f32; 3],
    /// Rotation times scale, by columns.
    pub columns: [[f32; 3]; 3],
    pub colour: Rgb,
    /// True for sensors, which one can look through.
    pub is_sensor: bool,
}

/// Returns a vector of rapier's, or a point, as one that can be drawn.
pub fn to_vec3(vector: impl Into<[f32; 3]>) -> Vec3 {
    Vec3::from_array(vector.into())
}

fn to_pose(pose: &Isometry<Real>) -> Pose3 {
    let (at, turn) = (pose.translation.vector, pose.rotation.coords.into());
    Pose3::from_parts(to_vec3(at), Quat::from_array(turn))
}

/// Returns the parts to draw of all enabled colliders, but for surfaces and half-spaces.
pub fn instances(world: &World, drawn: &Drawn, palette: &Palette<'_>) -> Vec<Instance> {
    let instance = |member: &Member| {
        let part = &member.part;
        let collider = world.colliders.get(member.collider).filter(|it| it.is_enabled())?;
        let pose = to_pose(&(collider.position() * part.local));
        let columns = Mat3::from_quat(pose.rotation) * Mat3::from_diagonal(to_vec3(part.scale));
        Some(Instance {
            kind: part.kind,
            position: pose.translation.into(),
            columns: columns.to_cols_array_2d(),
            colour: palette.colour(member.collider, collider, part.colour),
            is_sensor: collider.is_sensor(),
        })
    };
    drawn.members.iter().filter(|member| KINDS.contains(&member.part.kind)).filter_map(instance).collect()
}

/// A surface that does not move, such as a height field.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    pub vertices: Vec<[f32; 3]>,
    /// Triangles, as three corners each.
    pub triangles: Vec<[u32; 3]>,
}

/// Returns the surfaces in world coordinates. They are read once, because they do not move.
pub fn surfaces(world: &World, drawn: &Drawn) -> Vec<Surface> {
    let surface = |member: &Member| {
        let Kind::Mesh(number) = member.part.kind else { return None };
        let (points, triangles) = &drawn.meshes[number as usize];
        let at = world.colliders.get(member.collider)?.position() * member.part.local;
        let vertices = points.iter().map(|point| (at * point).into()).collect();
        Some(Surface { vertices, triangles: triangles.clone() })
    };
    drawn.members.iter().filter_map(surface).collect()
}

/// Returns true if a half-space is among the parts. It is drawn as ground at height 0, where all scenes have theirs.
pub fn has_ground(drawn: &Drawn) -> bool {
    drawn.members.iter().any(|member| member.part.kind == Kind::HalfSpace)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::palette::Colouring;
    use rapier3d::na::DMatrix;

    fn instances_of(world: &World) -> Vec<Instance> {
        instances(world, &Drawn::new(world), &Palette::new(Colouring::Shape, world))
    }

    /// The lower and the upper corner of the box around instances of shapes that fill their cubes.
    fn around(instances: &[Instance]) -> [Vec3; 2] {
        let mut points = Vec::new();
        for Instance { position, columns, .. } in instances {
            for corner in 0..8 {
                let at = |i: usize| if corner >> i & 1 == 0 { -1.0 } else { 1.0 };
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
            SharedShape::capsule_z(0.6, 0.2),
            SharedShape::round_cuboid(0.3, 0.2, 0.1, 0.05),
        ];
        for shape in shapes {
            let (mut world, turn) = (World::default(), [std::f32::consts::FRAC_PI_2, 0.0, 0.0]);
            let placed =
                ColliderBuilder::new(shape).translation([1.0, 2.0, 3.0].into()).rotation(turn.into());
            let handle = world.colliders.insert(placed);
            let collider = &world.colliders[handle];
            let (found, wanted) = (around(&instances_of(&world)), collider.compute_aabb());
            let is_near = |a: Vec3, b: Vec3| (a - b).abs().max_element() < 1e-4;
            let is_right = is_near(found[0], to_vec3(wanted.mins)) && is_near(found[1], to_vec3(wanted.maxs));
            assert!(is_right, "{:?}: {found:?}, not {wanted:?}", collider.shape().shape_type());
        }
    }

    #[test]
    fn a_height_field_is_a_surface_and_a_half_space_is_the_ground() {
        let mut world = World::default();
        assert!(!has_ground(&Drawn::new(&world)));
        world.colliders.insert(World::ground());
        let field = ColliderBuilder::heightfield(DMatrix::from_element(3, 3, 0.5), [4.0, 2.0, 4.0].into());
        world.colliders.insert(field.translation([0.0, 1.0, 0.0].into()));
        let drawn = Drawn::new(&world);
        let surfaces = surfaces(&world, &drawn);
        assert!(has_ground(&drawn) && surfaces.len() == 1 && surfaces[0].triangles.len() == 8);
        assert!(surfaces[0].vertices.iter().all(|vertex| vertex[1] == 2.0));
        assert!(instances_of(&world).is_empty());
    }
}

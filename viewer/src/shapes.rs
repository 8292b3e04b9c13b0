//! Parts of colliders as instances of a few meshes.

use crate::palette::{Palette, Rgb};
use kiss3d::prelude::Vec3;
use pbig_scenes::drawn::{Drawn, Kind, Member};
use pbig_scenes::world::World;

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

/// Returns the parts to draw of all enabled colliders, but for surfaces and half-spaces.
pub fn instances(world: &World, drawn: &Drawn, palette: &Palette<'_>) -> Vec<Instance> {
    let instance = |member: &Member| {
        let part = &member.part;
        let collider = world.colliders.get(member.collider).filter(|it| it.is_enabled())?;
        let columns: [[f32; 4]; 4] = part.matrix(collider).into();
        let [x, y, z, position] = columns.map(|[x, y, z, _]| [x, y, z]);
        Some(Instance {
            kind: part.kind,
            position,
            columns: [x, y, z],
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
    use rapier3d::prelude::*;

    fn instances_of(world: &World) -> Vec<Instance> {
        instances(world, &Drawn::new(world), &Palette::new(Colouring::Shape, world))
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

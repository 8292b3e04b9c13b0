//! The parts of a world's colliders, grouped so that each group is one instanced draw call.

use crate::mesh::Mesh;
use crate::parts::{Kind, Part, append_parts};
use rapier3d::prelude::*;

/// Floats of one matrix.
const MATRIX_FLOATS: usize = 16;

/// Parts of one kind. Translucent parts are a group of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Group {
    /// Shape before scaling.
    pub kind: Kind,
    /// True for parts that would hide what happens: those of sensors, and walls.
    pub is_translucent: bool,
    /// Number of parts.
    pub count: u32,
}

struct Member {
    collider: ColliderHandle,
    is_translucent: bool,
    part: Part,
}

impl Member {
    fn key(&self) -> (Kind, bool) {
        (self.part.kind, self.is_translucent)
    }
}

/// Every part of a world, in the order of the groups.
pub struct Groups {
    /// The groups, in the order of [`Groups::matrices`].
    pub groups: Vec<Group>,
    pub(crate) meshes: Vec<Mesh>,
    members: Vec<Member>,
    colliders: usize,
}

impl Groups {
    /// Groups the parts of these colliders.
    pub fn new(bodies: &RigidBodySet, colliders: &ColliderSet) -> Self {
        let (mut members, mut meshes) = (Vec::new(), Vec::new());
        for (handle, collider) in colliders.iter() {
            append_members(handle, collider, bodies, &mut members, &mut meshes);
        }
        // A stable sort: parts of a group keep the order of their colliders.
        members.sort_by_key(Member::key);
        let groups = members.chunk_by(|one, other| one.key() == other.key()).map(group).collect();
        Self { groups, meshes, members, colliders: colliders.len() }
    }

    /// Returns true if the set has another number of colliders than the groups were made from.
    pub fn is_outdated(&self, colliders: &ColliderSet) -> bool {
        self.colliders != colliders.len()
    }

    /// Returns a matrix of 16 floats for each part, column by column, at the present pose of its collider.
    pub fn matrices(&self, colliders: &ColliderSet) -> Vec<f32> {
        let mut floats = Vec::with_capacity(MATRIX_FLOATS * self.members.len());
        for Member { collider, part, .. } in &self.members {
            let matrix =
                colliders.get(*collider).map_or_else(Matrix4::zeros, |it| matrix(it.position(), part));
            floats.extend_from_slice(matrix.as_slice());
        }
        floats
    }

    /// Returns the colour class of each part.
    pub fn colours(&self) -> Vec<u8> {
        self.members.iter().map(|member| member.part.colour as u8).collect()
    }
}

type Matrix4 = rapier3d::na::Matrix4<f32>;

fn matrix(pose: &Isometry<Real>, part: &Part) -> Matrix4 {
    (pose * part.local).to_homogeneous().prepend_nonuniform_scaling(&part.scale)
}

fn group(members: &[Member]) -> Group {
    let (kind, is_translucent) = members[0].key();
    Group { kind, is_translucent, count: members.len() as u32 }
}

fn append_members(
    handle: ColliderHandle,
    collider: &Collider,
    bodies: &RigidBodySet,
    members: &mut Vec<Member>,
    meshes: &mut Vec<Mesh>,
) {
    let mut parts = Vec::new();
    append_parts(collider.shape(), &Isometry::identity(), &mut parts, meshes);
    let is_fixed = collider.parent().and_then(|body| bodies.get(body)).is_none_or(RigidBody::is_fixed);
    for mut part in parts {
        if is_fixed {
            part.colour = crate::parts::Colour::Fixed;
        }
        let is_ground = matches!(part.kind, Kind::HalfSpace | Kind::Mesh(_));
        let is_translucent = collider.is_sensor() || is_fixed && !is_ground;
        members.push(Member { collider: handle, is_translucent, part });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_scenes::scenes::Scene;

    /// Each scene has parts to draw, in groups whose counts, matrices and colours agree.
    #[test]
    fn groups_cover_every_scene() {
        for scene in Scene::ALL {
            let world = scene.build(100, 1);
            let groups = Groups::new(&world.bodies, &world.colliders);
            let parts: u32 = groups.groups.iter().map(|group| group.count).sum();
            assert!(parts as usize >= world.colliders.len(), "{}", scene.name);
            assert_eq!(groups.colours().len(), parts as usize, "{}", scene.name);
            let matrices = groups.matrices(&world.colliders);
            assert_eq!(matrices.len(), MATRIX_FLOATS * parts as usize, "{}", scene.name);
            assert!(matrices.iter().all(|x| x.is_finite()), "{}", scene.name);
        }
    }

    #[test]
    fn a_matrix_scales_then_places() {
        let mut colliders = ColliderSet::new();
        colliders.insert(ColliderBuilder::cuboid(1.0, 2.0, 3.0).translation(vector![4.0, 5.0, 6.0]));
        let groups = Groups::new(&RigidBodySet::new(), &colliders);
        let wanted = [1., 0., 0., 0., 0., 2., 0., 0., 0., 0., 3., 0., 4., 5., 6., 1.];
        assert_eq!(groups.matrices(&colliders), wanted);
        assert!(!groups.is_outdated(&colliders));
        colliders.insert(ColliderBuilder::ball(1.0));
        assert!(groups.is_outdated(&colliders));
    }
}

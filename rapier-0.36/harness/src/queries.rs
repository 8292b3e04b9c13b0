//! The scene queries of each frame, put to rapier.

use crate::world::{from_vector, pose, real, to_vector};
use glam::Vec3;
use pbig_scenes::frames::{
    CAPSULE_HALF_HEIGHT_METRES, CAPSULE_RADIUS_METRES, Extent, FRAME_SECONDS, FrameKind, MAX_DISTANCE_METRES,
    Query,
};
use rapier::control::KinematicCharacterController;
use rapier::prelude::*;

/// The queries of one frame after the other.
pub struct FrameQueries {
    kind: FrameKind,
    extent: Extent,
    frame: u64,
    character: Vec3,
}

impl FrameQueries {
    /// Begins at the first frame, in a world that has not made a step. Returns nothing for a kind without queries: a frame
    /// must not touch the broad phase then, because its index may wait for a first query.
    pub fn new(kind: FrameKind, world: &PhysicsWorld) -> Option<Self> {
        let extent = extent(world);
        let queries = Self { kind, extent, frame: 0, character: extent.character_start() };
        (kind != FrameKind::None).then_some(queries)
    }

    /// Asks the queries of the next frame, and returns the number of hits.
    pub fn ask(&mut self, world: &PhysicsWorld) -> u64 {
        let hits = self.hits(&world.query_pipeline());
        self.frame += 1;
        hits
    }

    fn hits(&mut self, queries: &QueryPipeline<'_>) -> u64 {
        if self.kind == FrameKind::Character {
            return self.walk(queries);
        }
        self.extent.queries(self.kind, self.frame).map(|query| ray(queries, query) as u64).sum()
    }

    /// Moves the character, and returns its collisions.
    fn walk(&mut self, queries: &QueryPipeline<'_>) -> u64 {
        let capsule = Capsule::new_y(real(CAPSULE_HALF_HEIGHT_METRES), real(CAPSULE_RADIUS_METRES));
        let (at, wanted) = (pose(self.character), to_vector(self.extent.character_motion(self.frame)));
        let (controller, mut collisions) = (KinematicCharacterController::default(), 0);
        let count = |_| collisions += 1;
        let moved = controller.move_shape(real(FRAME_SECONDS), queries, &capsule, &at, wanted, count);
        self.character += from_vector(moved.translation);
        collisions
    }
}

/// Returns the AABB around the colliders of all bodies that can move.
fn extent(world: &PhysicsWorld) -> Extent {
    let can_move = |collider: &Collider| collider.parent().is_some_and(|body| !world.bodies[body].is_fixed());
    let moving = world.colliders.iter().filter(|(_, collider)| can_move(collider));
    Extent::around(moving.map(|(_, collider)| {
        let aabb = collider.compute_aabb();
        [aabb.mins, aabb.maxs].map(from_vector)
    }))
}

fn ray(queries: &QueryPipeline<'_>, query: Query) -> usize {
    let ray = Ray::new(to_vector(query.origin), to_vector(query.direction));
    queries.cast_ray(&ray, real(MAX_DISTANCE_METRES), true).iter().count()
}

//! The scene queries of each frame, put to any broad phase that answers some.

use crate::frames::{
    AREA_RADIUS_METRES, CAPSULE_HALF_HEIGHT_METRES, CAPSULE_RADIUS_METRES, CAST_RADIUS_METRES, Extent,
    FRAME_SECONDS, FrameKind, MAX_DISTANCE_METRES, MAX_PROJECTION_METRES, Query,
};
use crate::world::{World, pose, to_point, to_vector};
use glam::Vec3;
use rapier_pbig::PbigBroadPhase;
use rapier3d::control::KinematicCharacterController;
use rapier3d::parry::query::ShapeCastOptions;
use rapier3d::prelude::*;

/// The queries of one frame after the other.
pub struct FrameQueries {
    kind: FrameKind,
    extent: Extent,
    frame: u64,
    character: Vec3,
}

/// A broad phase that answers scene queries. Rapier's trait `BroadPhase` has none.
pub trait Answer {
    /// Answers the queries of the present frame, and returns the number of hits.
    fn answer(&self, world: &World, queries: &mut FrameQueries) -> u64;
}

/// Implements [`Answer`] by the broad phase's own `as_query_pipeline`. A macro, because each may return a type of its own, whose
/// methods have the same names.
macro_rules! answer {
    ($broad_phase:ty) => {
        impl Answer for $broad_phase {
            fn answer(&self, world: &World, queries: &mut FrameQueries) -> u64 {
                let World { bodies, colliders, narrow_phase, .. } = world;
                let (dispatcher, filter) = (narrow_phase.query_dispatcher(), QueryFilter::default());
                let pipeline = self.as_query_pipeline(dispatcher, bodies, colliders, filter);
                match queries.kind {
                    FrameKind::None => 0,
                    FrameKind::Ray | FrameKind::Rays100 | FrameKind::Rays10000 | FrameKind::RaysToMiddle => {
                        queries.hits(|query| {
                            pipeline.cast_ray(&ray(query), MAX_DISTANCE_METRES, true).iter().count()
                        })
                    }
                    FrameKind::Cast => queries.hits(|query| {
                        let (at, along, ball) = cast(query);
                        pipeline.cast_shape(&at, &along, &ball, cast_options()).iter().count()
                    }),
                    FrameKind::Character => {
                        let (capsule, at, wanted) = queries.character();
                        let (controller, mut collisions) = (KinematicCharacterController::default(), 0);
                        let count = |_| collisions += 1;
                        let moved =
                            controller.move_shape(FRAME_SECONDS, &pipeline, &capsule, &at, wanted, count);
                        queries.move_character(moved.translation);
                        collisions
                    }
                    FrameKind::Boxes => queries.hits(|query| {
                        let ball = Ball::new(AREA_RADIUS_METRES);
                        pipeline.intersect_shape(pose(query.origin), &ball).count()
                    }),
                    FrameKind::Point => queries.hits(|query| {
                        let point = to_point(query.origin);
                        let found = pipeline.project_point(&point, MAX_PROJECTION_METRES, true);
                        found.iter().filter(|(_, found)| is_near(&point, found)).count()
                    }),
                }
            }
        }
    };
}

answer!(DefaultBroadPhase);
answer!(PbigBroadPhase);

impl FrameQueries {
    /// Begins at the first frame, in a world that has not made a step. Returns nothing for a kind without queries, so that frames
    /// leave the broad phase alone: its index may wait for a first query.
    pub fn new(kind: FrameKind, world: &World) -> Option<Self> {
        let extent = extent(world);
        let queries = Self { kind, extent, frame: 0, character: extent.character_start() };
        (kind != FrameKind::None).then_some(queries)
    }

    /// Asks the queries of the next frame, and returns the number of hits.
    pub fn ask(&mut self, world: &World, broad_phase: &impl Answer) -> u64 {
        let hits = broad_phase.answer(world, self);
        self.frame += 1;
        hits
    }

    /// Returns the sum of the hits of all queries.
    fn hits(&self, hits_of: impl Fn(Query) -> usize) -> u64 {
        self.extent.queries(self.kind, self.frame).map(|query| hits_of(query) as u64).sum()
    }

    /// Returns the character's shape, its pose and the wanted motion.
    fn character(&self) -> (Capsule, Isometry<Real>, Vector<Real>) {
        let capsule = Capsule::new_y(CAPSULE_HALF_HEIGHT_METRES, CAPSULE_RADIUS_METRES);
        (capsule, pose(self.character), to_vector(self.extent.character_motion(self.frame)))
    }

    fn move_character(&mut self, way: Vector<Real>) {
        self.character += Vec3::new(way.x, way.y, way.z);
    }
}

/// Returns the AABB around the colliders of all bodies that can move.
fn extent(world: &World) -> Extent {
    let moving = world.colliders.iter().filter(|(_, collider)| world.can_move(collider));
    Extent::around(moving.map(|(_, collider)| {
        let aabb = collider.compute_aabb();
        [aabb.mins, aabb.maxs].map(|corner| Vec3::new(corner.x, corner.y, corner.z))
    }))
}

fn ray(query: Query) -> Ray {
    Ray::new(to_point(query.origin), to_vector(query.direction))
}

/// Returns the pose and the direction of a ball that is cast, and the ball.
fn cast(query: Query) -> (Isometry<Real>, Vector<Real>, Ball) {
    (pose(query.origin), to_vector(query.direction), Ball::new(CAST_RADIUS_METRES))
}

fn cast_options() -> ShapeCastOptions {
    ShapeCastOptions::with_max_time_of_impact(MAX_DISTANCE_METRES)
}

/// Returns true for a projection within the limit, which rapier 0.27 ignores.
fn is_near(point: &Point<Real>, found: &PointProjection) -> bool {
    (found.point - point).norm() <= MAX_PROJECTION_METRES
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns balls that hang still above a ground.
    fn still_world() -> World {
        let mut world = World::with_gravity(Vec3::ZERO);
        world.colliders.insert(World::ground());
        for i in 0..216 {
            let place = Vec3::new((i % 6) as f32, (i / 36) as f32, (i / 6 % 6) as f32);
            world.add(World::dynamic(2.0 * place + Vec3::Y), ColliderBuilder::ball(0.5));
        }
        world
    }

    /// Returns the hits of some frames.
    fn hits(kind: FrameKind, mut broad_phase: impl BroadPhase + Answer) -> u64 {
        let mut world = still_world();
        let mut queries = FrameQueries::new(kind, &world).expect("a kind with queries");
        let frames = (0..40).map(|_| {
            world.step(&mut broad_phase);
            queries.ask(&world, &broad_phase)
        });
        frames.sum()
    }

    #[test]
    fn both_broad_phases_have_the_same_hits_in_a_world_at_rest() {
        for kind in FrameKind::ALL.into_iter().filter(|kind| *kind != FrameKind::None) {
            let [stock, ours] = [hits(kind, DefaultBroadPhase::new()), hits(kind, PbigBroadPhase::new())];
            assert!(stock > 0 && ours > 0, "{}: {stock} and {ours}", kind.name());
            // A character that touches two colliders at once may slide along either.
            assert!(kind == FrameKind::Character || stock == ours, "{}: {stock} and {ours}", kind.name());
        }
    }
}

//! Asks pbig's index and a tree of the same boxes, searched by rapier's own code, the same questions.

use glam::Vec3;
use pbig_harness_036::world::{pose, to_vector};
use rand::RngExt;
use rand::rngs::StdRng;
use rapier::math::Real;
use rapier::parry::partitioning::Bvh;
use rapier::parry::query::ShapeCastOptions;
use rapier::pipeline::QueryPipeline;
use rapier::prelude::*;
use std::collections::BTreeSet;

/// One answer to each kind of query. Rapier's tree decides which of several equally near colliders it names, so the distance
/// stands for them.
#[derive(Debug, PartialEq)]
struct Answers {
    ray: Option<Real>,
    normal: Option<Real>,
    on_ray: BTreeSet<(u32, u32)>,
    nearest: Option<Real>,
    around: BTreeSet<(u32, u32)>,
    cast: Option<Real>,
    touched: BTreeSet<(u32, u32)>,
    in_box: BTreeSet<(u32, u32)>,
}

struct Question {
    at: Vec3,
    along: Vec3,
    reach: Real,
    is_solid: bool,
}

impl Question {
    fn new(rng: &mut StdRng) -> Self {
        let mut along = |by: f32| Vec3::from_array([0.0; 3].map(|_: f32| rng.random_range(-by..by)));
        let (at, along) = (along(6.0), along(1.0));
        let along = [along, Vec3::NEG_Y, Vec3::ZERO, 1e-3 * along][rng.random_range(0..4)];
        Self {
            at,
            along,
            reach: [3.0, 50.0, Real::MAX][rng.random_range(0..3)],
            is_solid: rng.random_range(0..2) == 0,
        }
    }

    fn ask(&self, queries: &QueryPipeline<'_>) -> (Answers, Option<(u32, u32)>) {
        let Self { at, along, reach, is_solid } = *self;
        let (point, along, ball) = (to_vector(at), to_vector(along), Ball::new(0.6));
        let ray = Ray::new(point, along);
        let hit = queries.cast_ray(&ray, reach, is_solid);
        let area = Aabb::from_half_extents(point, Vector::splat(1.0));
        let options = ShapeCastOptions::with_max_time_of_impact(reach);
        let answers = Answers {
            ray: hit.map(|hit| hit.1),
            normal: queries.cast_ray_and_get_normal(&ray, reach, is_solid).map(|hit| hit.1.time_of_impact),
            on_ray: queries.intersect_ray(ray, reach, is_solid).map(|hit| hit.0.into_raw_parts()).collect(),
            nearest: queries
                .project_point(point, reach, is_solid)
                .map(|(_, found)| (found.point - point).length()),
            around: queries.intersect_point(point).map(|hit| hit.0.into_raw_parts()).collect(),
            cast: queries.cast_shape(&pose(at), along, &ball, options).map(|(_, hit)| hit.time_of_impact),
            touched: queries.intersect_shape(pose(at), &ball).map(|hit| hit.0.into_raw_parts()).collect(),
            in_box: queries.intersect_aabb_conservative(area).map(|hit| hit.0.into_raw_parts()).collect(),
        };
        (answers, hit.map(|hit| hit.0.into_raw_parts()))
    }
}

/// Asks both some questions. Returns how many rays hit.
pub(crate) fn compare(world: &PhysicsWorld, rng: &mut StdRng) -> u64 {
    let mut hits = 0;
    for filter in
        [QueryFilter::default(), QueryFilter::only_dynamic(), QueryFilter::default().exclude_sensors()]
    {
        let (question, of_index) = (Question::new(rng), world.query_pipeline_with_filter(filter));
        // Before its first update a finder knows nothing, and rapier's own tree answers.
        let Some(finder) = of_index.bvh.finder() else { return hits };
        // As code that was written for the unpatched rapier reads and sets the field.
        let bvh: &Bvh = of_index.bvh;
        assert!(std::ptr::eq(bvh, finder.tree()));
        let of_tree = QueryPipeline { bvh, ..of_index };
        let (ours, wanted) = (question.ask(&of_index), question.ask(&of_tree));
        assert_eq!(ours.0, wanted.0, "at {} along {} within {}", question.at, question.along, question.reach);
        if ours.1 != wanted.1 {
            assert!(
                ours.1 < wanted.1,
                "of colliders at one distance the first is named: {ours:?}, {wanted:?}"
            );
        }
        hits += u64::from(ours.1.is_some());
    }
    hits
}

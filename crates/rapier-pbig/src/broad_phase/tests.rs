use super::*;
use crate::{Backend, PbigConfig, Why};
use rapier3d::parry::bounding_volume::BoundingSphere;
use rapier3d::parry::query::{PointProjection, PointQuery, RayCast, RayIntersection};
use rapier3d::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Balls in a row, each of which touches the next one.
fn row(count: usize) -> (ColliderSet, Vec<ColliderHandle>) {
    let mut colliders = ColliderSet::new();
    let ball = |i: usize| ColliderBuilder::ball(0.5).translation(vector![0.9 * i as f32, 0.0, 0.0]);
    let all = ActiveCollisionTypes::all();
    let handles = (0..count).map(|i| colliders.insert(ball(i).active_collision_types(all))).collect();
    (colliders, handles)
}

/// Calls the broad phase, and returns the number of events.
fn update(
    broad_phase: &mut PbigBroadPhase,
    colliders: &ColliderSet,
    modified: &[ColliderHandle],
    removed: &[ColliderHandle],
) -> usize {
    let (params, bodies, mut events) = (IntegrationParameters::default(), RigidBodySet::new(), Vec::new());
    broad_phase.update(&params, colliders, &bodies, modified, removed, &mut events);
    events.len()
}

#[test]
fn a_broad_phase_may_be_sent_to_and_shared_between_threads() {
    fn assert_send_and_sync<T: Send + Sync>(_: &T) {}
    assert_send_and_sync(&PbigBroadPhase::new());
    assert_send_and_sync(&PbigConfig::DEFAULT);
    assert_send_and_sync(&PbigBroadPhase::new().stats());
}

#[test]
fn a_bad_margin_is_an_error_and_no_other_margin_is_taken() {
    for margin in [-0.01, f32::NAN, f32::INFINITY] {
        let error = PbigBroadPhase::with_config(PbigConfig { margin, ..PbigConfig::DEFAULT });
        assert!(matches!(error.expect_err("an error"), Error::Margin { .. }), "{margin}");
    }
    let wide = PbigConfig { margin: 0.5, backend: Backend::Cpu, ..PbigConfig::default() };
    let broad_phase = PbigBroadPhase::with_config(wide).expect("a length");
    assert_eq!(
        (broad_phase.relative_margin, broad_phase.colliders.core().config().backend),
        (0.5, Backend::Cpu)
    );
}

#[test]
fn a_failed_update_says_why_and_the_next_sees_its_changes() {
    let (colliders, handles) = row(12);
    let config = PbigConfig { max_pairs: 3, ..PbigConfig::DEFAULT };
    let mut broad_phase = PbigBroadPhase::with_config(config).expect("a length");
    let mut call = |modified: &[ColliderHandle], removed: &[ColliderHandle]| {
        let events = update(&mut broad_phase, &colliders, modified, removed);
        let error = broad_phase.last_error().cloned();
        (events, error, broad_phase.stats().totals.failures, broad_phase.pair_count())
    };
    let too_many = || Some(Error::TooManyPairs { limit: 3 });
    let text = too_many().map(|error| error.to_string()).unwrap_or_default();
    assert!(
        text.contains("than max_pairs = 3"),
        "{text}: the setting's name, without a type that an app lacks"
    );
    assert_eq!(call(&handles, &[]), (0, too_many(), 1, 0), "11 pairs");
    assert_eq!(call(&[], &[]), (0, too_many(), 2, 0), "still");
    // Rapier lists disabled colliders as removed.
    assert_eq!(call(&[], &handles[4..]), (3, None, 2, 3));
    assert_eq!(call(&[], &[]), (0, None, 2, 3));
}

/// A ground and balls on it, in an update that has too many pairs after some balls were removed.
#[test]
fn after_a_failed_update_pairs_have_existing_colliders() {
    let mut colliders = ColliderSet::new();
    let ground = colliders.insert(ColliderBuilder::cuboid(100.0, 1.0, 1.0));
    let mut ball = |i: usize| {
        let at = vector![3.0 * i as f32, 0.0, 0.0];
        let all = ActiveCollisionTypes::all();
        colliders.insert(ColliderBuilder::ball(0.5).translation(at).active_collision_types(all))
    };
    let [balls, more] = [0..20, 0..21].map(|range| range.map(&mut ball).collect::<Vec<_>>());
    let config = PbigConfig { max_pairs: 20, ..PbigConfig::DEFAULT };
    let mut broad_phase = PbigBroadPhase::with_config(config).expect("a length");
    let mut old = colliders.clone();
    more.iter()
        .for_each(|&ball| _ = old.remove(ball, &mut IslandManager::new(), &mut RigidBodySet::new(), false));
    assert_eq!(update(&mut broad_phase, &old, &[&[ground], &balls[..]].concat(), &[]), 20);
    let (gone, left) = balls.split_at(5);
    gone.iter().for_each(|&ball| {
        _ = colliders.remove(ball, &mut IslandManager::new(), &mut RigidBodySet::new(), false)
    });
    assert_eq!(update(&mut broad_phase, &colliders, &more, gone), 0);
    assert_eq!(broad_phase.last_error(), Some(&Error::TooManyPairs { limit: 20 }));
    let pairs: Vec<ColliderPair> = broad_phase.pairs().collect();
    let wanted: Vec<ColliderPair> = left.iter().map(|&ball| ColliderPair::new(ball, ground)).collect();
    assert_eq!(
        (pairs, broad_phase.pair_count()),
        (wanted, 15),
        "the ground has more pairs, so it comes second"
    );
}

#[test]
fn a_refused_box_is_an_error_until_there_is_room() {
    let (mut colliders, handles) = row(5);
    let limits = pbig_core::Limits { max_boxes: 4, ..pbig_core::Limits::DEFAULT };
    let config = pbig_core::Config { limits, ..PbigConfig::DEFAULT.into() };
    let mut broad_phase = PbigBroadPhase::around(pbig_core::BroadPhase::new(config).expect("a length"));
    let error = Some(Error::TooManyBoxes { boxes: 5, limit: 4 });
    assert_eq!(update(&mut broad_phase, &colliders, &handles, &[]), 3, "the others pair");
    assert_eq!(broad_phase.last_error().cloned(), error);
    assert_eq!(update(&mut broad_phase, &colliders, &[], &[]), 0);
    assert_eq!(
        broad_phase.last_error().cloned(),
        error,
        "the collider is read again, although it is not listed"
    );
    colliders.remove(handles[4], &mut IslandManager::new(), &mut RigidBodySet::new(), false);
    assert_eq!(update(&mut broad_phase, &colliders, &[], &handles[4..]), 0);
    assert_eq!((broad_phase.last_error(), broad_phase.pair_count()), (None, 3));
}

#[test]
fn a_bad_length_unit_is_an_error_until_it_is_mended() {
    let (colliders, handles) = row(3);
    let (mut broad_phase, bodies) = (PbigBroadPhase::new(), RigidBodySet::new());
    for (length_unit, is_good) in [(1.0, true), (-1.0, false), (1.0, true)] {
        let params = IntegrationParameters { length_unit, ..IntegrationParameters::default() };
        broad_phase.update(&params, &colliders, &bodies, &handles[..1], &[], &mut Vec::new());
        assert_eq!(broad_phase.last_error().is_none(), is_good, "{length_unit}");
        assert_eq!(broad_phase.colliders.core().config().margin, 0.01, "the margin stays");
    }
}

#[test]
fn adopting_a_world_forgets_the_old_colliders() {
    let (colliders, handles) = row(100);
    let mut broad_phase = PbigBroadPhase::new();
    update(&mut broad_phase, &colliders, &handles, &[]);
    broad_phase.adopt(&NarrowPhase::new());
    assert_eq!(
        (broad_phase.pair_count(), broad_phase.pairs().count(), broad_phase.stats().colliders),
        (0, 0, 0)
    );
    assert_eq!(broad_phase.why(handles[0], handles[1]), Why::Unknown(crate::scene::handle(handles[0])));
    assert_eq!(update(&mut broad_phase, &colliders, &[], &[]), 99, "all are read again");
}

/// A ball whose AABB panics while the flag is set, as a shape of an app's own may.
#[derive(Clone)]
struct Trap(Ball, Arc<AtomicBool>);

impl Shape for Trap {
    fn compute_aabb(&self, pose: &Isometry<Real>) -> Aabb {
        assert!(!self.1.load(Ordering::Relaxed), "planted");
        self.0.aabb(pose)
    }
    fn compute_local_aabb(&self) -> Aabb {
        self.0.local_aabb()
    }
    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.0.local_bounding_sphere()
    }
    fn clone_box(&self) -> Box<dyn Shape> {
        self.clone_dyn()
    }
    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(self.clone())
    }
    fn scale_dyn(&self, _: &Vector<Real>, _: u32) -> Option<Box<dyn Shape>> {
        None
    }
    fn mass_properties(&self, density: Real) -> MassProperties {
        Shape::mass_properties(&self.0, density)
    }
    fn shape_type(&self) -> ShapeType {
        ShapeType::Custom
    }
    fn as_typed_shape(&self) -> TypedShape<'_> {
        TypedShape::Custom(self)
    }
    fn ccd_thickness(&self) -> Real {
        self.0.radius
    }
    fn ccd_angular_thickness(&self) -> Real {
        0.0
    }
}

impl RayCast for Trap {
    fn cast_local_ray_and_get_normal(&self, ray: &Ray, far: Real, solid: bool) -> Option<RayIntersection> {
        self.0.cast_local_ray_and_get_normal(ray, far, solid)
    }
}

impl PointQuery for Trap {
    fn project_local_point(&self, point: &Point<Real>, solid: bool) -> PointProjection {
        self.0.project_local_point(point, solid)
    }
    fn project_local_point_and_get_feature(&self, point: &Point<Real>) -> (PointProjection, FeatureId) {
        self.0.project_local_point_and_get_feature(point)
    }
}

/// The call in which a shape panics changes nothing half: the next call reads all colliders, although rapier lists them once.
#[test]
fn after_a_shape_panicked_the_next_call_misses_nothing() {
    // On one thread, and on several.
    for count in [40, 9000] {
        let ((mut colliders, mut handles), is_armed) = (row(count), Arc::new(AtomicBool::new(false)));
        colliders[handles[count / 2]].set_shape(SharedShape::new(Trap(Ball::new(0.5), is_armed.clone())));
        let mut broad_phase = PbigBroadPhase::new();
        assert_eq!(update(&mut broad_phase, &colliders, &handles, &[]), count - 1);
        // Every second ball moves away, and the last one is replaced by a ball with the same index.
        for &handle in handles.iter().skip(1).step_by(2) {
            let x = colliders[handle].translation().x;
            colliders[handle].set_translation(vector![x, 5.0, 0.0]);
        }
        let old = handles.pop().expect("a ball");
        colliders.remove(old, &mut IslandManager::new(), &mut RigidBodySet::new(), false);
        let all = ActiveCollisionTypes::all();
        let new = ColliderBuilder::ball(0.5).translation(vector![0.4, 0.0, 0.0]).active_collision_types(all);
        handles.push(colliders.insert(new));
        is_armed.store(true, Ordering::Relaxed);
        let call = || update(&mut broad_phase, &colliders, &handles, &[old]);
        catch_unwind(AssertUnwindSafe(call)).expect_err("a panic");
        is_armed.store(false, Ordering::Relaxed);
        assert_eq!(update(&mut broad_phase, &colliders, &[], &[]), count - 2 + 1, "pairs end, one is new");
        assert_eq!((broad_phase.pair_count(), update(&mut broad_phase, &colliders, &[], &[])), (1, 0));
        assert_eq!(broad_phase.why(handles[0], handles[count - 1]), Why::Reported);
        assert_eq!(broad_phase.stats().colliders, count);
    }
}

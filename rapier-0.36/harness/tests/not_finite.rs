//! Colliders whose AABB is not finite: rapier keeps its last box, and so does pbig.

use rapier::math::Real;
use rapier::prelude::*;
use rapier_pbig::finder;

/// Two overlapping balls on bodies of their own.
struct Two {
    bodies: RigidBodySet,
    colliders: ColliderSet,
    broad_phase: BroadPhaseBvh,
    of_body: [RigidBodyHandle; 2],
    boxes: [ColliderHandle; 2],
}

impl Two {
    fn new(body: impl Fn() -> RigidBodyBuilder) -> Self {
        let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
        let of_body = [bodies.insert(body()), bodies.insert(body())];
        let ball = || ColliderBuilder::ball(1.0);
        let boxes = of_body.map(|body| colliders.insert_with_parent(ball(), body, &mut bodies));
        Self { bodies, colliders, broad_phase: rapier_pbig::broad_phase(), of_body, boxes }
    }

    fn update(&mut self) -> Vec<BroadPhasePairEvent> {
        let (params, mut events) = (IntegrationParameters::default(), Vec::new());
        let Self { bodies, colliders, broad_phase, boxes, .. } = self;
        broad_phase.update(&params, colliders, bodies, boxes, &[], &mut events);
        events
    }
}

#[test]
fn a_prediction_that_is_no_number_hides_no_pair() {
    let nan = Vector::splat(Real::NAN);
    let mut two = Two::new(|| RigidBodyBuilder::dynamic().soft_ccd_prediction(0.5).linvel(nan));
    let predicted = two.colliders[two.boxes[0]].compute_broad_phase_aabb(&Default::default(), &two.bodies);
    assert!(!predicted.mins.is_finite(), "{predicted:?}");
    assert!(matches!(two.update()[..], [BroadPhasePairEvent::AddPair(_)]));
}

#[test]
fn a_collider_that_keeps_its_box_gets_its_new_filter() {
    let mut two = Two::new(RigidBodyBuilder::dynamic);
    assert!(matches!(two.update()[..], [BroadPhasePairEvent::AddPair(_)]));
    let ([_, lost], [to, _]) = (two.boxes, two.of_body);
    two.colliders[lost].set_translation(Vector::splat(Real::NAN));
    assert!(two.update().is_empty(), "it keeps its last box");
    two.colliders.set_parent(lost, Some(to), &mut two.bodies);
    two.colliders[lost].set_translation(Vector::splat(Real::NAN));
    assert!(matches!(two.update()[..], [BroadPhasePairEvent::DeletePair(_)]));
    assert_eq!(finder(&two.broad_phase).map(|finder| finder.pair_count()), Some(0));
}

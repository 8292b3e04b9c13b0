//! Contacts that begin anew after a change: each test fails without the observer that it is about.

mod support;

use avian::prelude::*;
use bevy::prelude::*;
use support::{Number, app_with_pbig, collider};

struct Two {
    app: App,
    ids: [Entity; 2],
}

impl Two {
    /// Two overlapping balls, with a contact.
    fn new() -> Self {
        let mut app = app_with_pbig();
        let ids = [(0.0, 3), (0.4, 4)].map(|(x, number)| {
            let body =
                (RigidBody::Dynamic, GravityScale(0.0), collider(1.0), Transform::from_xyz(x, 0.0, 0.0));
            app.world_mut().spawn((body, Number(number))).id()
        });
        let mut two = Self { app, ids };
        two.step();
        assert!(two.has_contact(), "at first");
        two
    }

    /// Moves one body far enough to leave its enlarged AABB, and back, so that avian looks at the pair; then steps.
    fn step(&mut self) {
        let y = self.app.world().get::<Transform>(self.ids[0]).map_or(0.0, |at| at.translation.y);
        if let Some(mut at) = self.app.world_mut().get_mut::<Transform>(self.ids[0]) {
            at.translation.y = if y < 0.2 { 0.3 } else { 0.0 };
        }
        self.app.update();
    }

    fn has_contact(&self) -> bool {
        self.app.world().resource::<ContactGraph>().contains(self.ids[0], self.ids[1])
    }

    fn edit(&mut self, edit: impl FnOnce(&mut EntityWorldMut)) {
        let id = self.ids[1];
        edit(&mut self.app.world_mut().entity_mut(id));
    }

    /// Expects a contact after two changes of the second body, each followed by a step.
    fn expect_contact_after(
        mut self,
        one: impl FnOnce(&mut EntityWorldMut),
        other: impl FnOnce(&mut EntityWorldMut),
    ) {
        self.edit(one);
        self.step();
        self.edit(other);
        self.step();
        assert!(self.has_contact());
    }
}

#[test]
fn a_collider_that_is_disabled_and_enabled() {
    Two::new()
        .expect_contact_after(|e| _ = e.insert(ColliderDisabled), |e| _ = e.remove::<ColliderDisabled>());
}

#[test]
fn a_sensor_that_becomes_solid() {
    Two::new().expect_contact_after(|e| _ = e.insert(Sensor), |e| _ = e.remove::<Sensor>());
}

#[test]
fn a_body_that_is_disabled_and_enabled() {
    Two::new()
        .expect_contact_after(|e| _ = e.insert(RigidBodyDisabled), |e| _ = e.remove::<RigidBodyDisabled>());
}

#[test]
fn a_body_that_gets_its_kind_again() {
    Two::new()
        .expect_contact_after(|e| _ = e.insert(RigidBody::Static), |e| _ = e.insert(RigidBody::Dynamic));
}

#[test]
fn a_body_that_is_inserted_again() {
    Two::new()
        .expect_contact_after(|e| _ = e.insert(RigidBody::Dynamic), |e| _ = e.insert(RigidBody::Dynamic));
}

#[test]
fn a_collider_that_is_inserted_again() {
    Two::new().expect_contact_after(|e| _ = e.remove::<Collider>(), |e| _ = e.insert(collider(1.0)));
}

#[test]
fn layers_that_change_for_a_step() {
    let none = CollisionLayers::new(LayerMask::NONE, LayerMask::NONE);
    Two::new().expect_contact_after(
        move |e| _ = e.insert(none),
        |e| _ = e.insert(CollisionLayers::new(LayerMask::ALL, LayerMask::ALL)),
    );
}

#[test]
fn a_veto_that_ends() {
    let mut two = Two::new();
    two.edit(|e| _ = e.insert((ActiveCollisionHooks::FILTER_PAIRS, ColliderDisabled)));
    two.app.world_mut().resource_mut::<support::Divisor>().0 = 3 + 4;
    two.step();
    two.edit(|e| _ = e.remove::<ColliderDisabled>());
    two.step();
    assert!(!two.has_contact(), "vetoed");
    two.app.world_mut().resource_mut::<support::Divisor>().0 = 0;
    two.app.update();
    two.step();
    assert!(two.has_contact());
}

#[test]
fn a_joint_that_ends() {
    let mut two = Two::new();
    let joint = DistanceJoint::new(two.ids[0], two.ids[1]).with_limits(0.0, 10.0);
    two.edit(|e| _ = e.insert(ColliderDisabled));
    let joint = two.app.world_mut().spawn((joint, JointCollisionDisabled)).id();
    two.step();
    two.edit(|e| _ = e.remove::<ColliderDisabled>());
    two.step();
    assert!(!two.has_contact(), "joined");
    two.app.world_mut().despawn(joint);
    two.step();
    assert!(two.has_contact());
}

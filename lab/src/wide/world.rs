//! A world of rapier3d-f64: what a simulation is held against that runs in f32.

use super::{Pose, shape_in_f64, to_f32, to_f64};
use pbig_harness::world::World;
use rapier3d::na::{Translation3, Vector3};
use rapier3d::prelude as narrow;
use rapier3d_f64::prelude::*;

/// The bodies and colliders of a [`World`] in f64, with rapier's own broad phase.
#[derive(Default)]
pub struct WideWorld {
    bodies: RigidBodySet,
    colliders: ColliderSet,
    /// All but half-spaces, in the order of the world they are from.
    bounded: Vec<ColliderHandle>,
    gravity: Vector<Real>,
    params: IntegrationParameters,
    islands: IslandManager,
    broad_phase: BroadPhaseBvh,
    narrow_phase: NarrowPhase,
    impulse_joints: ImpulseJointSet,
    multibody_joints: MultibodyJointSet,
    ccd_solver: CCDSolver,
    pipeline: PhysicsPipeline,
}

impl WideWorld {
    /// Returns this world in f64 before its first step, moved by `offset`: dynamic bodies with one collider in their middle,
    /// without joints, with rapier's settings but for density, friction and restitution.
    ///
    /// # Errors
    /// If it has shapes that no scene has.
    pub fn of(world: &World, offset: [f64; 3]) -> Result<Self, String> {
        let gravity = world.gravity.to_array().map(f64::from).into();
        let mut wide = Self { gravity, ..Self::default() };
        let by = Translation3::from(Vector3::from(offset));
        for (_, collider) in world.colliders.iter() {
            wide.add(world, collider, by)?;
        }
        Ok(wide)
    }

    /// A collider, with a body of its own where it has one.
    fn add(&mut self, world: &World, one: &narrow::Collider, by: Translation3<f64>) -> Result<(), String> {
        let shape = shape_in_f64(one.shape()).ok_or("a shape that no scene has")?;
        let is_bounded = shape.as_halfspace().is_none();
        let builder = ColliderBuilder::new(shape)
            .density(one.density().into())
            .friction(one.friction().into())
            .restitution(one.restitution().into());
        let handle = match one.parent().and_then(|handle| world.bodies.get(handle)) {
            Some(body) => {
                let [linear, angular] = [body.linvel(), body.angvel()].map(|velocity| velocity.cast());
                let moving = RigidBodyBuilder::dynamic().linvel(linear).angvel(angular);
                let body = self.bodies.insert(moving.position(by * to_f64(body.position())));
                self.colliders.insert_with_parent(builder, body, &mut self.bodies)
            }
            None => self.colliders.insert(builder.position(by * to_f64(one.position()))),
        };
        self.bounded.extend(is_bounded.then_some(handle));
        Ok(())
    }

    /// One step of rapier's physics pipeline.
    pub fn step(&mut self) {
        self.pipeline.step(
            &self.gravity,
            &self.params,
            &mut self.islands,
            &mut self.broad_phase,
            &mut self.narrow_phase,
            &mut self.bodies,
            &mut self.colliders,
            &mut self.impulse_joints,
            &mut self.multibody_joints,
            &mut self.ccd_solver,
            &(),
            &(),
        );
    }

    /// Returns the poses of all colliders except half-spaces, in the order of [`super::Layout::of_world`].
    pub fn poses(&self) -> Vec<Pose> {
        self.bounded.iter().map(|&handle| *self.colliders[handle].position()).collect()
    }
}

/// The world at a distance from where it is, rounded as f32 has it.
pub fn moved(mut world: World, offset: [f64; 3]) -> World {
    let by = Translation3::from(Vector3::from(offset));
    let elsewhere = |pose: &narrow::Isometry<narrow::Real>| to_f32(&(by * to_f64(pose)));
    for (_, body) in world.bodies.iter_mut() {
        let pose = elsewhere(body.position());
        body.set_position(pose, true);
    }
    for (_, collider) in world.colliders.iter_mut().filter(|(_, one)| one.parent().is_none()) {
        let pose = elsewhere(collider.position());
        collider.set_position(pose);
    }
    world
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_harness::scenes::Scene;
    use rapier_pbig::PbigBroadPhase;

    /// Both fall by Newton's law until the lowest touch the ground. Only rounding makes them differ.
    #[test]
    fn worlds_in_f64_and_f32_agree_while_nothing_touches() {
        let offset = [5.0; 3];
        let world = Scene::named("column").expect("a scene").build(27, 1);
        let mut wide = WideWorld::of(&world, offset).expect("balls and cuboids");
        let (mut narrow, mut broad_phase) = (moved(world, offset), PbigBroadPhase::new());
        let start = wide.poses();
        for _ in 0..10 {
            wide.step();
            narrow.step(&mut broad_phase);
        }
        let held = narrow.colliders.iter().filter(|(_, one)| one.parent().is_some());
        let held: Vec<_> = held.map(|(_, one)| to_f64(one.position()).translation.vector).collect();
        assert_eq!([start.len(), held.len()], [27; 2]);
        let ends = wide.poses();
        let apart = ends.iter().zip(&held).map(|(pose, at)| (pose.translation.vector - at).norm());
        let apart = apart.fold(0.0, f64::max);
        assert!(apart < 1e-4, "{apart}");
        let fallen = start[26].translation.y - ends[26].translation.y;
        assert!((0.1..0.2).contains(&fallen), "{fallen}: g t^2 / 2 is 0.136");
    }
}

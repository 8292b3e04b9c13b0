//! A headless rapier world, and the conversion from glam, in which scenes are built.

use crate::dimension::{parts, rotation, soft_cube};
use glam::{Quat, Vec3};
use rapier::math::{DIM, Pose, Real, Vector};
use rapier::na::Unit;
use rapier::prelude::*;
use std::sync::mpsc::channel;

/// Everything that rapier keeps apart, together; the broad phase is lent to each step.
pub struct World {
    /// Rigid bodies.
    pub bodies: RigidBodySet,
    /// Colliders.
    pub colliders: ColliderSet,
    /// Joints between bodies.
    pub impulse_joints: ImpulseJointSet,
    /// Articulations.
    pub multibody_joints: MultibodyJointSet,
    /// Bodies that bend.
    pub soft_bodies: SoftBodySet,
    /// Contacts and intersections.
    pub narrow_phase: NarrowPhase,
    /// Acceleration, m/s^2.
    pub gravity: Vec3,
    /// Step length and the like.
    pub params: IntegrationParameters,
    /// Groups of touching bodies.
    pub islands: IslandManager,
    /// Steps and their times.
    pub pipeline: PhysicsPipeline,
    ccd_solver: CCDSolver,
}

impl Default for World {
    fn default() -> Self {
        Self {
            bodies: RigidBodySet::new(),
            colliders: ColliderSet::new(),
            impulse_joints: ImpulseJointSet::new(),
            multibody_joints: MultibodyJointSet::new(),
            soft_bodies: SoftBodySet::new(),
            narrow_phase: NarrowPhase::new(),
            gravity: Vec3::new(0.0, -9.81, 0.0),
            params: IntegrationParameters::default(),
            islands: IslandManager::new(),
            pipeline: PhysicsPipeline::new(),
            ccd_solver: CCDSolver::new(),
        }
    }
}

impl World {
    /// Runs one step of rapier's physics pipeline.
    pub fn step(&mut self, broad_phase: &mut BroadPhaseBvh) {
        self.step_for(broad_phase, &());
    }

    /// Runs one step, and returns its collision events.
    pub fn step_with_events(&mut self, broad_phase: &mut BroadPhaseBvh) -> Vec<CollisionEvent> {
        let (send, received) = channel();
        self.step_for(broad_phase, &ChannelEventCollector::new(send, channel().0, channel().0));
        received.try_iter().collect()
    }

    fn step_for(&mut self, broad_phase: &mut BroadPhaseBvh, listener: &dyn EventHandler) {
        self.pipeline.step(
            to_vector(self.gravity),
            &self.params,
            &mut self.islands,
            broad_phase,
            &mut self.narrow_phase,
            &mut self.bodies,
            &mut self.colliders,
            &mut self.impulse_joints,
            &mut self.multibody_joints,
            &mut self.soft_bodies,
            &mut self.ccd_solver,
            &(),
            listener,
        );
    }

    /// Adds a body with one collider.
    pub fn add(&mut self, body: RigidBodyBuilder, collider: ColliderBuilder) -> RigidBodyHandle {
        let handle = self.bodies.insert(body);
        self.colliders.insert_with_parent(collider, handle, &mut self.bodies);
        handle
    }

    /// Returns a dynamic body without rotation at a place.
    pub fn dynamic(at: Vec3) -> RigidBodyBuilder {
        RigidBodyBuilder::dynamic().translation(to_vector(at))
    }

    /// Returns a half-space, whose surface is at height 0.
    pub fn ground() -> ColliderBuilder {
        ColliderBuilder::halfspace(Unit::new_unchecked(Vector::Y))
    }

    /// Removes a body with its colliders.
    pub fn remove(&mut self, body: RigidBodyHandle) {
        self.remove_body(body, true);
    }

    /// Removes a body. Its colliders stay, without a body.
    pub fn remove_body_alone(&mut self, body: RigidBodyHandle) {
        self.remove_body(body, false);
    }

    fn remove_body(&mut self, body: RigidBodyHandle, colliders_too: bool) {
        let Self { bodies, islands, colliders, impulse_joints, multibody_joints, soft_bodies, .. } = self;
        bodies.remove(body, islands, colliders, impulse_joints, multibody_joints, soft_bodies, colliders_too);
    }

    /// Removes a collider.
    pub fn remove_collider(&mut self, collider: ColliderHandle) {
        let Self { colliders, islands, bodies, soft_bodies, .. } = self;
        colliders.remove(collider, islands, bodies, soft_bodies, true);
    }

    /// Adds a cube that bends, a square in two dimensions, half an edge long in each direction.
    pub fn add_soft(&mut self, at: Vec3, half: f32) -> SoftBodyHandle {
        let cube = soft_cube(at, half).particle_mass(0.2);
        let Self { soft_bodies, bodies, colliders, .. } = self;
        soft_bodies.insert(cube, bodies, colliders)
    }

    /// Throws a heavy ball with a radius of half a metre; the velocity in m/s.
    pub fn throw(&mut self, from: Vec3, velocity: Vec3) -> RigidBodyHandle {
        let ball = Self::dynamic(from).linvel(to_vector(velocity)).ccd_enabled(true);
        self.add(ball, ColliderBuilder::ball(0.5).density(10.0))
    }

    /// Returns everything with its broad phase as bytes, bit by bit.
    ///
    /// # Panics
    /// If a part cannot be saved, which none of rapier's refuses.
    pub fn to_bytes(&self, broad_phase: &BroadPhaseBvh) -> Vec<u8> {
        let sets = (&self.bodies, &self.colliders, &self.impulse_joints, &self.multibody_joints);
        let rest = (&self.narrow_phase, &self.params, &self.islands, &self.ccd_solver, &self.soft_bodies);
        let all = (sets, rest, self.gravity.to_array(), broad_phase);
        postcard::to_stdvec(&all).expect("rapier's sets can be saved")
    }

    /// Returns the world and the broad phase that were saved.
    ///
    /// # Errors
    /// If these are not the bytes of a world.
    pub fn from_bytes(bytes: &[u8]) -> Result<(Self, BroadPhaseBvh), postcard::Error> {
        let (sets, rest, gravity, broad_phase): (_, _, [f32; 3], _) = postcard::from_bytes(bytes)?;
        let (bodies, colliders, impulse_joints, multibody_joints) = sets;
        let (narrow_phase, params, islands, ccd_solver, soft_bodies) = rest;
        let (gravity, pipeline) = (Vec3::from_array(gravity), PhysicsPipeline::new());
        let world = Self {
            bodies,
            colliders,
            impulse_joints,
            multibody_joints,
            soft_bodies,
            narrow_phase,
            gravity,
            params,
            islands,
            pipeline,
            ccd_solver,
        };
        Ok((world, broad_phase))
    }

    /// Returns the bits of all numbers in the poses of all bodies, in order. They are equal exactly when all poses are.
    pub fn pose_bits(&self) -> Vec<u64> {
        let bits = |(_, body): (RigidBodyHandle, &RigidBody)| {
            let at: [Real; DIM] = body.translation().into();
            at.into_iter().chain(parts(body.rotation())).map(bits).collect::<Vec<_>>()
        };
        self.bodies.iter().flat_map(bits).collect()
    }
}

#[allow(clippy::unnecessary_cast, reason = "rapier's numbers are f32 or f64")]
fn bits(x: Real) -> u64 {
    (x as f64).to_bits()
}

/// Returns a number in rapier's precision.
#[allow(clippy::useless_conversion, reason = "rapier's numbers are f32 or f64")]
pub fn real(x: f32) -> Real {
    Real::from(x)
}

/// Returns a glam vector as rapier's, which is of another version of glam. In two dimensions it loses z.
pub fn to_vector(v: Vec3) -> Vector {
    let numbers = v.to_array();
    Vector::from(std::array::from_fn::<Real, DIM, _>(|k| real(numbers[k])))
}

/// Returns rapier's vector as glam's. In two dimensions z is 0.
#[allow(clippy::unnecessary_cast, reason = "rapier's numbers are f32 or f64")]
pub fn from_vector(v: Vector) -> Vec3 {
    let numbers: [Real; DIM] = v.into();
    Vec3::from_array(std::array::from_fn(|k| numbers.get(k).map_or(0.0, |&x| x as f32)))
}

/// Returns a pose without rotation.
pub fn pose(at: Vec3) -> Pose {
    Pose::from_translation(to_vector(at))
}

/// Returns a pose with a rotation.
pub fn turned(at: Vec3, turn: Quat) -> Pose {
    Pose::from_parts(to_vector(at), rotation(turn))
}

/// Returns groups that meet if each has a group of the other's filter.
pub fn groups_that_meet(memberships: Group, filter: Group) -> InteractionGroups {
    InteractionGroups::new(memberships, filter, InteractionTestMode::And)
}

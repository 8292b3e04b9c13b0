//! A headless rapier world, and the conversion from glam, in which scenes are built.

use glam::{Quat, Vec3};
use rapier3d::na::{Quaternion, UnitQuaternion};
use rapier3d::prelude::*;
use std::sync::mpsc::channel;

/// Everything that rapier keeps apart, together; the broad phase is lent to each step.
pub struct World {
    pub bodies: RigidBodySet,
    pub colliders: ColliderSet,
    pub impulse_joints: ImpulseJointSet,
    pub multibody_joints: MultibodyJointSet,
    pub narrow_phase: NarrowPhase,
    /// Acceleration, m/s^2.
    pub gravity: Vec3,
    pub params: IntegrationParameters,
    islands: IslandManager,
    ccd_solver: CCDSolver,
    pipeline: PhysicsPipeline,
}

impl Default for World {
    fn default() -> Self {
        Self {
            bodies: RigidBodySet::new(),
            colliders: ColliderSet::new(),
            impulse_joints: ImpulseJointSet::new(),
            multibody_joints: MultibodyJointSet::new(),
            narrow_phase: NarrowPhase::new(),
            gravity: Vec3::new(0.0, -9.81, 0.0),
            params: IntegrationParameters::default(),
            islands: IslandManager::new(),
            ccd_solver: CCDSolver::new(),
            pipeline: PhysicsPipeline::new(),
        }
    }
}

impl World {
    pub fn with_gravity(gravity: Vec3) -> Self {
        Self { gravity, ..Self::default() }
    }

    pub fn step(&mut self, broad_phase: &mut dyn BroadPhase) {
        self.step_for(broad_phase, &());
    }

    pub fn step_with_events(&mut self, broad_phase: &mut dyn BroadPhase) -> Vec<CollisionEvent> {
        let (send, received) = channel();
        self.step_for(broad_phase, &ChannelEventCollector::new(send, channel().0));
        received.try_iter().collect()
    }

    fn step_for(&mut self, broad_phase: &mut dyn BroadPhase, listener: &dyn EventHandler) {
        self.pipeline.step(
            &to_vector(self.gravity),
            &self.params,
            &mut self.islands,
            broad_phase,
            &mut self.narrow_phase,
            &mut self.bodies,
            &mut self.colliders,
            &mut self.impulse_joints,
            &mut self.multibody_joints,
            &mut self.ccd_solver,
            &(),
            listener,
        );
    }

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
        ColliderBuilder::halfspace(Vector::y_axis())
    }

    pub fn remove(&mut self, body: RigidBodyHandle) {
        let Self { bodies, islands, colliders, impulse_joints, multibody_joints, .. } = self;
        bodies.remove(body, islands, colliders, impulse_joints, multibody_joints, true);
    }

    pub fn remove_collider(&mut self, collider: ColliderHandle) {
        self.colliders.remove(collider, &mut self.islands, &mut self.bodies, true);
    }

    /// Returns the pairs of the narrow phase: of contacts, and with sensors.
    pub fn pairs(&self) -> impl Iterator<Item = ColliderPair> {
        let contacts = self.narrow_phase.contact_pairs().map(|pair| (pair.collider1, pair.collider2));
        let intersections = self.narrow_phase.intersection_pairs().map(|(one, other, _)| (one, other));
        contacts.chain(intersections).map(|(one, other)| ColliderPair::new(one, other))
    }

    pub fn pair_count(&self) -> usize {
        let contacts = self.narrow_phase.contact_graph().raw_graph().raw_edges().len();
        contacts + self.narrow_phase.intersection_graph().raw_graph().raw_edges().len()
    }

    pub fn can_move(&self, collider: &Collider) -> bool {
        collider.parent().and_then(|body| self.bodies.get(body)).is_some_and(|body| !body.is_fixed())
    }

    /// Returns the AABB around the colliders that can move, or around all if none can. Half-spaces do not count.
    pub fn moving_aabb(&self) -> Option<Aabb> {
        let all = || self.colliders.iter().map(|(_, collider)| collider);
        around(all().filter(|collider| self.can_move(collider))).or_else(|| around(all()))
    }

    /// Returns the bits of all numbers in the poses of all bodies, in order. They are equal exactly when all poses are.
    pub fn pose_bits(&self) -> Vec<u32> {
        let bits = |(_, body): (RigidBodyHandle, &RigidBody)| {
            let pose = body.position();
            let numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
            numbers.map(|x| x.to_bits()).collect::<Vec<_>>()
        };
        self.bodies.iter().flat_map(bits).collect()
    }
}

#[cfg(feature = "snapshot")]
impl World {
    /// Returns everything as bytes, bit by bit.
    ///
    /// # Panics
    /// If a part cannot be saved, which none of rapier's refuses.
    pub fn to_bytes(&self) -> Vec<u8> {
        let sets = (&self.bodies, &self.colliders, &self.impulse_joints, &self.multibody_joints);
        let rest = (&self.narrow_phase, &self.params, &self.islands, &self.ccd_solver);
        postcard::to_stdvec(&(sets, rest, self.gravity.to_array())).expect("rapier's sets can be saved")
    }

    /// Returns the world that was saved.
    ///
    /// # Errors
    /// If these are not the bytes of a world.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, postcard::Error> {
        let (sets, rest, gravity): (_, _, [f32; 3]) = postcard::from_bytes(bytes)?;
        let (bodies, colliders, impulse_joints, multibody_joints) = sets;
        let (narrow_phase, params, islands, ccd_solver) = rest;
        let gravity = Vec3::from_array(gravity);
        let pipeline = PhysicsPipeline::new();
        Ok(Self {
            bodies,
            colliders,
            impulse_joints,
            multibody_joints,
            narrow_phase,
            gravity,
            params,
            islands,
            ccd_solver,
            pipeline,
        })
    }
}

/// Half extents, in metres, above which an AABB is that of a half-space.
const MAX_HALF_EXTENT: f32 = 1e6;

/// Returns the AABB around those colliders that have an end.
fn around<'a>(colliders: impl Iterator<Item = &'a Collider>) -> Option<Aabb> {
    let aabbs = colliders.map(Collider::compute_aabb);
    aabbs.filter(|aabb| aabb.half_extents().max() < MAX_HALF_EXTENT).reduce(|a, b| a.merged(&b))
}

pub fn to_vector(v: Vec3) -> Vector<Real> {
    vector![v.x, v.y, v.z]
}

pub fn to_point(v: Vec3) -> Point<Real> {
    to_vector(v).into()
}

pub fn pose(at: Vec3) -> Isometry<Real> {
    Isometry::translation(at.x, at.y, at.z)
}

/// Returns a pose with a rotation, bit by bit. The builders' own `rotation` takes an angle, of which rapier computes the
/// sine and the cosine as the platform does.
pub fn turned(at: Vec3, turn: Quat) -> Isometry<Real> {
    let turn = UnitQuaternion::new_unchecked(Quaternion::new(turn.w, turn.x, turn.y, turn.z));
    Isometry::from_parts(to_vector(at).into(), turn)
}

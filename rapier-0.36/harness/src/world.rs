//! Helpers of tests and measurements around rapier's own `PhysicsWorld`, and the conversion from glam, in which scenes are built.

use crate::dimension::{parts, rotation};
use glam::{Quat, Vec3};
use rapier::math::{DIM, Pose, Real, Vector};
use rapier::na::Unit;
use rapier::prelude::*;

/// Returns an empty world with a broad phase.
pub fn with(broad_phase: BroadPhaseBvh) -> PhysicsWorld {
    PhysicsWorld { broad_phase, ..PhysicsWorld::default() }
}

/// Returns a dynamic body without rotation at a place.
pub fn dynamic(at: Vec3) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic().translation(to_vector(at))
}

/// Returns a half-space, whose surface is at height 0.
pub fn ground() -> ColliderBuilder {
    ColliderBuilder::halfspace(Unit::new_unchecked(Vector::Y))
}

/// Returns a world as bytes, bit by bit.
///
/// # Panics
/// If a part cannot be saved, which none of rapier's refuses.
pub fn to_bytes(world: &PhysicsWorld) -> Vec<u8> {
    postcard::to_stdvec(world).expect("rapier's sets can be saved")
}

/// Returns the world that was saved.
///
/// # Panics
/// If these are not the bytes of a world.
pub fn from_bytes(bytes: &[u8]) -> PhysicsWorld {
    postcard::from_bytes(bytes).expect("these are the bytes of a world")
}

/// Returns the bits of all numbers in the poses of all bodies, in order. They are equal exactly when all poses are.
pub fn pose_bits(world: &PhysicsWorld) -> Vec<u64> {
    let bits = |(_, body): (RigidBodyHandle, &RigidBody)| {
        let at: [Real; DIM] = body.translation().into();
        at.into_iter().chain(parts(body.rotation())).map(bits).collect::<Vec<_>>()
    };
    world.bodies.iter().flat_map(bits).collect()
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

pub fn pose(at: Vec3) -> Pose {
    Pose::from_translation(to_vector(at))
}

pub fn turned(at: Vec3, turn: Quat) -> Pose {
    Pose::from_parts(to_vector(at), rotation(turn))
}

/// Returns groups that meet if each has a group of the other's filter.
pub fn groups_that_meet(memberships: Group, filter: Group) -> InteractionGroups {
    InteractionGroups::new(memberships, filter, InteractionTestMode::And)
}

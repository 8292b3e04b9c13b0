//! Scenes at their beginning: no body is inside another, and the same world begins with the same bits.

use pbig_scenes::scenes::Scene;
use pbig_scenes::world::{World, to_vector, turned};
use rapier3d::prelude::*;

fn build(name: &str, bodies: usize, seed: u64) -> World {
    Scene::named(name).expect("the scene exists").build(bodies, seed)
}

/// Returns the pairs of bodies that touch after one step.
fn touching(world: &mut World) -> Vec<[RigidBodyHandle; 2]> {
    world.step(&mut DefaultBroadPhase::new());
    let contacts = world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact);
    let parent = |collider: ColliderHandle| world.colliders[collider].parent();
    contacts.filter_map(|pair| Some([parent(pair.collider1)?, parent(pair.collider2)?])).collect()
}

/// Returns the touching bodies of two figures, which are eleven bodies each.
fn touching_figures(world: &mut World) -> Vec<[u32; 2]> {
    let figures = touching(world).into_iter().map(|pair| pair.map(|body| body.into_raw_parts().0 / 11));
    figures.filter(|[one, other]| one != other).collect()
}

#[test]
fn no_ragdoll_begins_inside_another() {
    for seed in 1..=3 {
        assert_eq!(touching_figures(&mut build("ragdolls", 3300, seed)), [[0; 2]; 0], "seed {seed}");
    }
    let mut planted = build("ragdolls", 22, 1);
    for (_, body) in planted.bodies.iter_mut().skip(11) {
        body.set_translation(body.translation() - vector![0.0, 2.8, 0.0], true);
    }
    assert!(!touching_figures(&mut planted).is_empty());
}

/// Returns the FNV-1a hash of the poses of all bodies, and of all colliders without a body.
fn hash(world: &World) -> u64 {
    let fixed = world.colliders.iter().filter(|(_, collider)| collider.parent().is_none());
    let fixed = fixed.flat_map(|(_, collider)| {
        let pose = collider.position();
        let numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
        numbers.map(|x| x.to_bits()).collect::<Vec<_>>()
    });
    let bytes = world.pose_bits().into_iter().chain(fixed).flat_map(u32::to_le_bytes);
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

/// These hold on every machine and for every build. They change with the scene and with `rand` only.
#[test]
fn scenes_begin_with_the_recorded_bits() {
    let hashes = ["ragdolls", "conveyor"].map(|name| hash(&build(name, 500, 1)));
    assert_eq!(hashes.map(|hash| format!("{hash:016x}")), ["241f819eb595adbe", "5d6be72b264f8156"]);
}

#[test]
fn a_pose_has_the_bits_of_its_rotation() {
    let turn = glam::Quat::from_rotation_y(1.0) * glam::Quat::from_rotation_x(2.0);
    let mut world = World::default();
    world.bodies.insert(RigidBodyBuilder::dynamic().position(turned(glam::Vec3::ONE, turn)));
    let bits = [turn.x, turn.y, turn.z, turn.w].map(f32::to_bits);
    assert_eq!(world.pose_bits()[3..], bits);
    assert_eq!(world.bodies.iter().next().expect("it is there").1.translation(), &to_vector(glam::Vec3::ONE));
}

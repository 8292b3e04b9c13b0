//! Tests like avian's own of motion and determinism, with pbig in place of its broad phase.

mod support;

use avian::math::RVector;
use avian::prelude::*;
use bevy::prelude::*;
use bevy::tasks::{ComputeTaskPool, TaskPoolBuilder};
use std::process::Command;
use support::{DIMENSIONS, app, app_with_pbig, collider, plugins};

/// The variable with a number of threads, which tells a test that it runs in a process of its own.
const THREADS: &str = "PBIG_AVIAN_THREADS";

/// Makes a box, or a rectangle, by its half extents.
fn cuboid(half: RVector) -> Collider {
    let corner = |i: u32| {
        let mut corner = half;
        (0..DIMENSIONS as usize).filter(|k| i >> k & 1 == 1).for_each(|k| corner[k] = -half[k]);
        corner
    };
    let corners: Vec<_> = (0..1 << DIMENSIONS as u32).map(corner).collect();
    Collider::convex_hull(&corners).expect("a hull")
}

/// A place in the plane that two and three dimensions share.
fn place(x: f32, y: f32) -> Transform {
    Transform::from_xyz(x, y, 0.0)
}

fn spawn_ground(world: &mut World, x: f32, half_width: f32) {
    let mut half = RVector::splat(half_width);
    half.y = 1.0;
    world.spawn((RigidBody::Static, cuboid(half), place(x, -1.0)));
}

fn spawn_cube(world: &mut World, at: Transform) -> Entity {
    world.spawn((RigidBody::Dynamic, cuboid(RVector::splat(0.25)), at)).id()
}

/// Leaning towers of cubes, hinged in twos, as in avian's test of determinism.
fn spawn_hinges(world: &mut World, towers: u32, rows: u32) {
    let width = towers as f32 * 2.5;
    spawn_ground(world, 0.0, width + 20.0);
    for tower in 0..towers {
        let mut below = None;
        for row in 0..rows {
            let x = 2.5 * tower as f32 - width / 2.0 + 0.1 * row as f32;
            let turn = Quat::from_rotation_z(0.1 * row as f32 - 1.0);
            let cube = spawn_cube(world, place(x, 0.25 + 0.5 * row as f32).with_rotation(turn));
            below = match below {
                None => Some(cube),
                Some(below) => {
                    let joint = RevoluteJoint::new(below, cube).with_local_anchor1(RVector::splat(0.25));
                    world.spawn((joint, JointCollisionDisabled));
                    None
                }
            };
        }
    }
}

/// Returns the poses of all bodies as bits, in the order in which they were spawned.
fn poses(app: &mut App) -> Vec<String> {
    let mut query = app.world_mut().query::<(Entity, &Position, &Rotation)>();
    // The shortest decimals that give a number back tell all numbers apart.
    let mut poses: Vec<_> =
        query.iter(app.world()).map(|(id, at, turn)| (id, format!("{:?} {turn:?}", at.0))).collect();
    poses.sort();
    poses.into_iter().map(|(_, pose)| pose).collect()
}

/// Returns a hash of the poses after some steps.
fn hash_after(steps: usize, towers: u32, rows: u32) -> u64 {
    use std::hash::{DefaultHasher, Hash, Hasher};
    let mut app = app_with_pbig();
    spawn_hinges(app.world_mut(), towers, rows);
    (0..steps).for_each(|_| app.update());
    let mut hasher = DefaultHasher::new();
    poses(&mut app).hash(&mut hasher);
    hasher.finish()
}

/// Runs this test again with a number of threads, and returns its line of output. Bevy has one pool of threads in a process.
fn line_with_threads(test: &str, threads: &str) -> String {
    let mut again = Command::new(std::env::current_exe().expect("a path"));
    again.args([test, "--exact", "--nocapture"]).env(THREADS, threads).env("RAYON_NUM_THREADS", threads);
    let output = again.output().expect("it starts");
    let text = String::from_utf8(output.stdout).expect("text");
    text.lines().find(|line| line.starts_with("poses")).unwrap_or_else(|| panic!("{text}")).to_string()
}

#[test]
fn poses_are_the_same_with_1_2_and_5_threads() {
    if let Ok(threads) = std::env::var(THREADS) {
        let threads = threads.parse().expect("a number");
        ComputeTaskPool::get_or_init(|| TaskPoolBuilder::new().num_threads(threads).build());
        // Beyond 16,384 boxes pbig searches on several threads.
        return println!("\nposes {:x} {:x}", hash_after(300, 4, 30), hash_after(6, 600, 30));
    }
    let line = |threads| line_with_threads("poses_are_the_same_with_1_2_and_5_threads", threads);
    let lines = ["1", "2", "5", "5"].map(line);
    assert!(lines.iter().all(|line| *line == lines[0]), "{lines:#?}");
}

/// With one contact for each body, the order of contacts has no effect.
#[test]
fn cubes_apart_move_as_with_avians_own() {
    let poses = [app_with_pbig(), app(plugins())].map(|mut app| {
        for i in 0..40 {
            spawn_ground(app.world_mut(), 10.0 * i as f32, 3.0);
            let turn = Quat::from_rotation_z(0.1 * i as f32);
            spawn_cube(app.world_mut(), place(10.0 * i as f32, 2.0).with_rotation(turn));
        }
        (0..200).for_each(|_| app.update());
        let graph = app.world().resource::<ContactGraph>();
        assert!(graph.active_pairs().len() + graph.sleeping_pairs().len() > 30, "cubes lie");
        poses(&mut app)
    });
    assert_eq!(poses[0], poses[1]);
}

#[test]
fn a_body_with_velocity_moves() {
    let mut app = app_with_pbig();
    let ball = (RigidBody::Dynamic, GravityScale(0.0), collider(1.0), LinearVelocity(RVector::X));
    let body = app.world_mut().spawn((ball, place(0.0, 0.0))).id();
    (0..640).for_each(|_| app.update());
    let at = app.world().get::<Transform>(body).expect("a body").translation;
    assert!((at.x - 10.0).abs() < 0.03 && at.y == 0.0 && at.z == 0.0, "{at}");
}

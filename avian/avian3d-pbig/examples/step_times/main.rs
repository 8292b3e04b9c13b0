//! Steps scenes with avian's own broad phase and with pbig, in turn, and prints the times of both as CSV.
//!
//! ```sh
//! cargo run --release --example step_times -- column 10000 200
//! ```

// `compare.rs` here is a link to the example.
#[allow(dead_code, reason = "compare also prints a table and compares contacts")]
mod compare;

use avian::prelude::*;
use bevy::prelude::*;
use compare::{measure, summary};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, scene, bodies, steps] = &arguments[..] else {
        return eprintln!("usage: step_times column|rain|city BODIES STEPS");
    };
    let (Ok(bodies), Ok(steps)) = (bodies.parse::<usize>(), steps.parse::<usize>()) else {
        return eprintln!("BODIES and STEPS are numbers");
    };
    let times = measure(|app| add_scene(app, scene, bodies), steps);
    println!(
        "scene,bodies,steps,avian_broad_mean_ms,pbig_broad_mean_ms,avian_broad_p99_ms,pbig_broad_p99_ms,\
        avian_step_mean_ms,pbig_step_mean_ms,avian_step_p99_ms,pbig_step_p99_ms"
    );
    let columns = [0, 1].map(|part| {
        let [avian, pbig] = times.each_ref().map(|times| summary(times, part));
        [avian[0], pbig[0], avian[2], pbig[2]]
    });
    let columns: Vec<String> = columns.as_flattened().iter().map(|time| format!("{time:.3}")).collect();
    println!("{scene},{bodies},{steps},{}", columns.join(","));
}

fn add_scene(app: &mut App, scene: &str, bodies: usize) {
    let spawn = match scene {
        "column" => column,
        "rain" => rain,
        _ => city,
    };
    app.add_systems(Startup, move |world: &mut World| spawn(world, bodies, StdRng::seed_from_u64(1)));
}

fn ground(world: &mut World, width: f32) {
    world.spawn((
        RigidBody::Static,
        Collider::cuboid(width, 2.0, width),
        Transform::from_xyz(0.0, -1.0, 0.0),
    ));
}

fn shape(i: usize, size: f32) -> Collider {
    if i.is_multiple_of(2) { Collider::cuboid(size, size, size) } else { Collider::sphere(size / 2.0) }
}

/// A settled block of cubes and balls.
fn column(world: &mut World, bodies: usize, mut rng: StdRng) {
    let side = (bodies as f32 / 3.0).cbrt().ceil() as usize;
    ground(world, side as f32 * 8.0);
    for i in 0..bodies {
        let [x, z, y] = [i % side, i / side % side, i / side / side].map(|k| 1.3 * k as f32);
        let place = Vec3::new(x + rng.random_range(0.0..0.2), 1.0 + y, z + rng.random_range(0.0..0.2));
        world.spawn((RigidBody::Dynamic, shape(i, 1.0), Transform::from_translation(place)));
    }
}

/// Bodies of several sizes fall on a plain.
fn rain(world: &mut World, bodies: usize, mut rng: StdRng) {
    let half = (bodies as f32).sqrt() * 1.2;
    ground(world, 2.0 * half + 50.0);
    for i in 0..bodies {
        let [x, z] = [(); 2].map(|()| rng.random_range(-half..half));
        let place = Transform::from_xyz(x, rng.random_range(1.0..41.0), z);
        let size = rng.random_range(0.4..1.0);
        world.spawn((RigidBody::Dynamic, shape(i, size), place, LinearVelocity(Vec3::new(0.0, -2.0, 0.0))));
    }
}

/// One body in twenty moves between buildings.
fn city(world: &mut World, bodies: usize, mut rng: StdRng) {
    let side = (bodies as f32 * 0.95).sqrt() as usize;
    ground(world, side as f32 * 6.0);
    let corner = |i: usize| (i as f32 - side as f32 / 2.0) * 5.0;
    for i in 0..side * side {
        let height = rng.random_range(2.0..22.0);
        let place = Transform::from_xyz(corner(i % side), height / 2.0, corner(i / side));
        world.spawn((RigidBody::Static, Collider::cuboid(3.0, height, 3.0), place));
    }
    for i in side * side..bodies {
        let [x, z] = [(); 2].map(|()| corner(rng.random_range(0..side)) + 2.5);
        let velocity = if i % 2 == 0 { Vec3::X } else { Vec3::NEG_Z } * 8.0;
        let body = (RigidBody::Dynamic, Collider::sphere(0.5), GravityScale(0.0), Friction::new(0.0));
        world.spawn((body, Transform::from_xyz(x, rng.random_range(0.6..3.6), z), LinearVelocity(velocity)));
    }
}

//! Steps scenes with avian's own broad phase and with pbig, in turn, and prints the times of both as CSV.
//!
//! ```sh
//! cargo run --release --example step_times -- column 10000 200
//! ```

use avian::collision::CollisionDiagnostics;
use avian::prelude::*;
use avian_pbig::PbigBroadPhasePlugin;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::time::{Duration, Instant};

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, scene, bodies, steps] = &arguments[..] else {
        return eprintln!("usage: step_times column|rain|city BODIES STEPS");
    };
    let (Ok(bodies), Ok(steps)) = (bodies.parse::<usize>(), steps.parse::<usize>()) else {
        return eprintln!("BODIES and STEPS are numbers");
    };
    let mut apps = [false, true].map(|is_pbig| app(is_pbig, scene, bodies));
    let mut times = [vec![], vec![]];
    for step in 0..steps + 2 {
        for (app, times) in apps.iter_mut().zip(&mut times) {
            let row = step_once(app);
            // The first steps build everything.
            if step >= 2 {
                times.push(row);
            }
        }
    }
    println!(
        "scene,bodies,steps,avian_broad_mean_ms,pbig_broad_mean_ms,avian_broad_p99_ms,pbig_broad_p99_ms,\
        avian_step_mean_ms,pbig_step_mean_ms,avian_step_p99_ms,pbig_step_p99_ms"
    );
    let [broad, step] = [1, 0].map(|part| times.each_ref().map(|times| mean_and_p99(times, part)));
    let columns = [broad, step].map(|[avian, pbig]| [avian[0], pbig[0], avian[1], pbig[1]]);
    println!(
        "{scene},{bodies},{steps},{}",
        columns.as_flattened().iter().map(f64::to_string).collect::<Vec<_>>().join(",")
    );
}

/// The times of a step, in ms: the whole of it, and its broad phase.
type Row = [f64; 2];

fn step_once(app: &mut App) -> Row {
    let start = Instant::now();
    app.update();
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    let step = start.elapsed();
    [ms(step), ms(app.world().resource::<CollisionDiagnostics>().broad_phase)]
}

/// Returns the mean and the 99th percentile of a column, to three digits.
fn mean_and_p99(rows: &[Row], column: usize) -> [f64; 2] {
    let mut times: Vec<f64> = rows.iter().map(|row| row[column]).collect();
    times.sort_by(f64::total_cmp);
    let mean = times.iter().sum::<f64>() / times.len() as f64;
    [mean, times[(times.len() * 99 / 100).min(times.len() - 1)]].map(|time| (time * 1000.0).round() / 1000.0)
}

fn app(is_pbig: bool, scene: &str, bodies: usize) -> App {
    let mut app = App::new();
    let plugins = PhysicsPlugins::default().build();
    app.add_plugins((MinimalPlugins, bevy::transform::TransformPlugin));
    if is_pbig {
        app.add_plugins(plugins.disable::<BvhBroadPhasePlugin>().add(PbigBroadPhasePlugin::new()));
    } else {
        app.add_plugins(plugins);
    }
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 64.0)));
    app.finish();
    app.cleanup();
    let rng = StdRng::seed_from_u64(1);
    match scene {
        "column" => column(app.world_mut(), bodies, rng),
        "rain" => rain(app.world_mut(), bodies, rng),
        _ => city(app.world_mut(), bodies, rng),
    }
    app
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

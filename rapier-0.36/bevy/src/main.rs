//! A headless bevy app whose physics use pbig: balls fall onto a ground, and every pair is checked.
//!
//! `scripts/patch-rapier.sh rapier-0.36`, then `cargo run --release --ignore-rust-version --manifest-path
//! rapier-0.36/Cargo.toml -p pbig-bevy-example` (Rust 1.95 or newer).

use bevy::prelude::*;
use bevy::time::{TimePlugin, TimeUpdateStrategy};
use bevy_rapier3d::prelude::*;
use rapier_pbig::PbigFinder;
use rapier_pbig::shadow::{self, Shadow};
use std::time::Duration;

/// Seconds of a step.
const STEP: f32 = 1.0 / 60.0;

fn main() {
    let mut app = App::new();
    app.add_plugins((TransformPlugin, TimePlugin, RapierPhysicsPlugin::<NoUserData>::default()));
    app.insert_resource(TimestepMode::Fixed { dt: STEP, substeps: 1 });
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f32(STEP)));
    app.add_systems(Startup, spawn);
    // The one line that an app adds. In an app without a check it is `rapier_pbig::install(&mut simulation.broad_phase)`.
    app.add_systems(PostStartup, use_pbig);
    app.finish();
    for _ in 0..240 {
        app.update();
    }
    report(&mut app);
}

fn spawn(mut commands: Commands) {
    commands.spawn((Transform::from_xyz(0.0, -0.5, 0.0), Collider::cuboid(30.0, 0.5, 30.0)));
    for i in 0..500 {
        let at = Vec3::new((i % 10) as f32, 1.0 + (i / 100) as f32 * 1.2, (i / 10 % 10) as f32) * 1.1;
        commands.spawn((Transform::from_translation(at), RigidBody::Dynamic, Collider::ball(0.5)));
    }
}

fn use_pbig(mut simulations: Query<&mut RapierContextSimulation>) {
    for mut simulation in &mut simulations {
        let finder = PbigFinder::default().with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle);
        rapier_pbig::install_finder(&mut simulation.broad_phase, finder);
    }
}

fn report(app: &mut App) {
    let mut lowest = f32::INFINITY;
    for transform in app.world_mut().query_filtered::<&Transform, With<RigidBody>>().iter(app.world()) {
        lowest = lowest.min(transform.translation.y);
    }
    let mut simulations = app.world_mut().query::<&RapierContextSimulation>();
    let simulation = simulations.single(app.world()).expect("one world");
    let finder = rapier_pbig::finder(&simulation.broad_phase).expect("it is installed");
    let checker = shadow::checker(&simulation.broad_phase).expect("it has a shadow");
    let (stats, differences) = (finder.stats(), &checker.differences);
    println!(
        "{} colliders, {} pairs, {} updates",
        stats.colliders,
        finder.pair_count(),
        stats.totals.updates
    );
    println!("{} updates compared with rapier's own broad phase and the oracle", checker.compared);
    println!("{} differences; the lowest ball is at {lowest:.2}", differences.len());
    assert!(differences.is_empty() && checker.compared > 50 && lowest > 0.3);
}

//! Steps a scene with avian's own broad phase and with pbig, in turn, and prints the times of both. Then it compares their contacts.
//!
//! Copy this file into `examples/` of your project, put your scene into `add_scene`, and run:
//!
//! ```sh
//! cargo run --release --example compare -- 300 # steps
//! ```

use avian_pbig::avian::collision::CollisionDiagnostics;
use avian_pbig::avian::prelude::*;
use avian_pbig::{PbigBroadPhasePlugin, Shadow};
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use std::collections::BTreeSet;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Your collision hooks, if you have any; with lifetimes, `MyHooks<'static, 'static>`.
type Hooks = ();

/// Adds the scene. Put your own plugins, systems and bodies here, but no window and no `PhysicsPlugins`. What is random needs a seed.
/// Avian's feature `collider-from-mesh`, a default one, needs bevy's `AssetPlugin` and `MeshPlugin` here.
fn add_scene(app: &mut App) {
    app.add_systems(Startup, |mut commands: Commands| {
        commands.spawn((RigidBody::Static, Collider::cuboid(200.0, 2.0, 200.0)));
        for i in 0..3000 {
            let [x, z, y] = [i % 14, i / 14 % 14, i / 196].map(|k| 1.3 * k as f32 + 0.01 * (i % 7) as f32);
            commands.spawn((
                RigidBody::Dynamic,
                Collider::cuboid(1.0, 1.0, 1.0),
                Transform::from_xyz(x, y + 2.0, z),
            ));
        }
    });
}

fn main() -> ExitCode {
    let Some(steps) =
        std::env::args().nth(1).map_or(Some(300), |steps| steps.parse().ok()).filter(|&n| n > 0)
    else {
        eprintln!("usage: compare [STEPS], a number from 1 on");
        return ExitCode::FAILURE;
    };
    let times = measure(add_scene, steps);
    println!("milliseconds, {steps} steps          mean    median       p99");
    for (part, name) in ["broad phase", "whole update"].iter().enumerate() {
        for (times, broad_phase) in times.iter().zip(["avian's own", "pbig"]) {
            let [mean, median, p99] = summary(times, part);
            println!("{name:<13} {broad_phase:<12} {mean:>9.3} {median:>9.3} {p99:>9.3}");
        }
    }
    match check(&shadow(add_scene, steps)) {
        Ok(contacts) => println!("{contacts} contacts compared in these steps: all are equal."),
        Err(difference) => {
            eprintln!("{difference}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

/// The times of a step in ms: its broad phase, and the whole update of the app.
pub(crate) type Row = [f64; 2];

/// Steps the scene with avian's own broad phase and with pbig, in turn, and returns the times of each.
pub(crate) fn measure(add_scene: impl Fn(&mut App), steps: usize) -> [Vec<Row>; 2] {
    let plugins = || PhysicsPlugins::default().with_collision_hooks::<Hooks>().build();
    let pbig = PbigBroadPhasePlugin::<Hooks>::default();
    let mut apps = [plugins(), plugins().disable::<BvhBroadPhasePlugin<Hooks>>().add(pbig)]
        .map(|plugins| start(plugins, &add_scene));
    let mut times = [vec![], vec![]];
    for _ in 0..steps {
        for (app, times) in apps.iter_mut().zip(&mut times) {
            times.push(step(app));
        }
    }
    times
}

/// Steps the scene with avian's own broad phase and pbig beside it. Returns how their contacts differ.
fn shadow(add_scene: impl Fn(&mut App), steps: usize) -> Shadow {
    let plugins = PhysicsPlugins::default().with_collision_hooks::<Hooks>().build();
    let mut app = start(plugins.add(PbigBroadPhasePlugin::<Hooks>::default().as_shadow()), add_scene);
    (0..steps).for_each(|_| app.update());
    app.world_mut().remove_resource::<Shadow>().expect("the plugin adds it")
}

/// Returns the number of contacts that were compared.
///
/// # Errors
/// The pairs that differ; or that nothing was compared.
fn check(shadow: &Shadow) -> Result<u64, String> {
    match shadow {
        Shadow { compared: 0, .. } => Err("nothing was compared: no colliders met".into()),
        Shadow { missing, spurious, compared } if missing.is_empty() && spurious.is_empty() => Ok(*compared),
        Shadow { missing, spurious, .. } => {
            let some =
                |pairs: &BTreeSet<_>| format!("{} {:?}", pairs.len(), Vec::from_iter(pairs.iter().take(10)));
            let [missing, spurious] = [missing, spurious].map(some);
            Err(format!(
                "pbig differs, the first 10 of each: it misses {missing}, and only pbig has {spurious}. \
                 (avian itself is wrong about colliders with a NaN)"
            ))
        }
    }
}

/// Makes an app with the scene that makes one step in each update. Its first updates build everything, and are not measured.
fn start(physics: impl PluginGroup, add_scene: impl Fn(&mut App)) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, bevy::transform::TransformPlugin)).add_plugins(physics.build());
    add_scene(&mut app);
    let step = app.world().resource::<Time<Fixed>>().timestep();
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    app.finish();
    app.cleanup();
    app.update();
    app.update();
    app
}

/// Makes a step, and returns its times.
fn step(app: &mut App) -> Row {
    let start = Instant::now();
    app.update();
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    [app.world().resource::<CollisionDiagnostics>().broad_phase, start.elapsed()].map(ms)
}

/// Returns mean, median and 99th percentile of a part of the steps.
pub(crate) fn summary(rows: &[Row], part: usize) -> [f64; 3] {
    let mut times: Vec<f64> = rows.iter().map(|row| row[part]).collect();
    times.sort_by(f64::total_cmp);
    let percentile = |percent: usize| times[(times.len() * percent / 100).min(times.len() - 1)];
    [times.iter().sum::<f64>() / times.len() as f64, percentile(50), percentile(99)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_summary_sorts_its_part() {
        let rows: Vec<Row> = (0..200).rev().map(|i| [f64::from(i), 7.0]).collect();
        assert_eq!(summary(&rows, 0), [99.5, 100.0, 198.0]);
        assert_eq!(summary(&rows[..1], 1), [7.0; 3]);
    }

    #[test]
    fn both_broad_phases_are_measured_and_agree() {
        let times = measure(add_scene, 5);
        for rows in &times {
            assert_eq!(rows.len(), 5);
            assert!(rows.iter().all(|[broad, update]| *broad > 0.0 && broad < update), "{rows:?}");
        }
        let contacts = check(&shadow(add_scene, 40)).expect("equal contacts");
        assert!(contacts > 1000, "{contacts} contacts");
    }

    #[test]
    fn a_difference_is_an_error() {
        assert!(check(&Shadow::default()).unwrap_err().contains("nothing was compared"));
        let pair = (Entity::PLACEHOLDER, Entity::PLACEHOLDER);
        let shadow = Shadow { compared: 9, missing: [pair].into(), ..Shadow::default() };
        assert!(check(&shadow).unwrap_err().contains("misses"));
    }
}

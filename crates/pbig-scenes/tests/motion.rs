//! Scenes in motion: nothing explodes or falls through the ground, and each scene does what its name says.

use glam::Vec3;
use pbig_scenes::scenes::Scene;
use pbig_scenes::world::World;
use rapier3d::prelude::*;
use std::collections::HashSet;

const STEPS: usize = 300;
/// Metres a second. Drops of rain begin with up to 40, and gravity adds 49 in 300 steps.
const MOST_SPEED: f32 = 100.0;
/// Metres that a body's centre may be below the ground: more than it sinks in for a moment, and less than it falls in
/// the first second without ground.
const MOST_DEPTH: f32 = 1.0;

/// A scene under way.
struct Run {
    world: World,
    broad_phase: DefaultBroadPhase,
    /// Where the bodies began.
    start: Vec<Vec3>,
    has_ground: bool,
}

impl Run {
    fn new(name: &str, bodies: usize) -> Self {
        let world = Scene::named(name).expect("the scene exists").build(bodies, 1);
        let (start, has_ground) = (places(&world), has_ground(&world));
        Self { world, broad_phase: DefaultBroadPhase::new(), start, has_ground }
    }

    fn steps(mut self, steps: usize) -> Self {
        for _ in 0..steps {
            self.world.step(&mut self.broad_phase);
        }
        self
    }

    /// Where the dynamic bodies began and where they are.
    fn dynamic(&self) -> Vec<(Vec3, Vec3)> {
        let pairs = self.world.bodies.iter().zip(&self.start);
        let dynamic = pairs.filter(|((_, body), _)| body.is_dynamic());
        dynamic.map(|((_, body), start)| (*start, place(body))).collect()
    }
}

fn place(body: &RigidBody) -> Vec3 {
    Vec3::from_slice(body.translation().as_slice())
}

fn places(world: &World) -> Vec<Vec3> {
    world.bodies.iter().map(|(_, body)| place(body)).collect()
}

/// Returns true if the scene has a half-space, whose surface is at height 0.
fn has_ground(world: &World) -> bool {
    world.colliders.iter().any(|(_, collider)| collider.shape().as_halfspace().is_some())
}

/// Returns the first body that is out of range, or too fast, or nowhere, or below the ground.
fn fault(run: &Run) -> Option<String> {
    let start = run.start.iter().fold(0.0, |most: f32, at| most.max(at.length()));
    // Nothing gets farther than it goes at the highest speed in all the steps.
    let range = start + MOST_SPEED * STEPS as f32 / 60.0;
    let is_wrong = |body: &RigidBody| {
        let (at, speed) = (place(body), body.linvel().norm());
        let is_buried = run.has_ground && body.is_dynamic() && at.y < -MOST_DEPTH;
        // A comparison with a NaN is false.
        is_buried || !(at.length() < range && speed < MOST_SPEED)
    };
    let (_, body) = run.world.bodies.iter().find(|(_, body)| is_wrong(body))?;
    Some(format!("{} with {} m/s", place(body), body.linvel().norm()))
}

#[test]
fn nothing_explodes_or_falls_through_the_ground_in_300_steps() {
    for scene in Scene::ALL {
        for bodies in [10, 300] {
            let run = Run::new(scene.name, bodies);
            assert_eq!(run.has_ground, scene.name != "asteroids", "{}", scene.name);
            let run = run.steps(STEPS);
            assert_eq!(fault(&run), None, "{}, {bodies} bodies", scene.name);
        }
    }
}

#[test]
fn a_conveyor_never_runs_dry() {
    let mut run = Run::new("conveyor", 140);
    for steps in [60, 140, 200, 500] {
        run = run.steps(steps);
        let gates = run.world.narrow_phase.intersection_pairs().filter(|(_, _, is_inside)| *is_inside);
        let gates = gates.count();
        assert!(gates > 15, "{gates} crates in gates");
        let moved =
            run.dynamic().iter().filter(|(start, now)| now.y > 1.2 && start.distance(*now) > 0.3).count();
        assert!(moved > 35, "{moved} of 40 crates are carried");
    }
}

#[test]
fn most_drops_of_rain_land_on_the_hills() {
    let run = Run::new("rain", 1000).steps(STEPS);
    let is_on_hills = |at: &Vec3| at.x.abs().max(at.z.abs()) < 1000_f32.sqrt() * 1.5;
    let landed: Vec<f32> =
        run.dynamic().iter().map(|(_, now)| *now).filter(is_on_hills).map(|at| at.y).collect();
    let through = landed.iter().filter(|height| **height < 0.2).count();
    assert!(landed.len() > 700, "{} drops are on the hills", landed.len());
    assert!(through * 50 < landed.len(), "{through} of {} drops fell through the hills", landed.len());
}

#[test]
fn a_jar_holds_what_falls_into_it() {
    let run = Run::new("jar", 500).steps(STEPS);
    let widest = run.start.iter().fold(0.0, |most: f32, at| most.max(Vec3::new(at.x, 0.0, at.z).length()));
    for (start, now) in run.dynamic() {
        assert!(Vec3::new(now.x, 0.0, now.z).length() < widest + 0.7 && now.y > 0.0, "{start} {now}");
    }
}

#[test]
fn asteroids_collide_and_stay_together() {
    let spread = |run: &Run| run.dynamic().iter().map(|(_, now)| now.length()).sum::<f32>() / 1500.0;
    let mut run = Run::new("asteroids", 1500);
    let before = spread(&run);
    let mut collided = HashSet::new();
    for _ in 0..STEPS {
        run = run.steps(1);
        let contacts = run.world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact);
        collided.extend(contacts.flat_map(|pair| [pair.collider1, pair.collider2]));
    }
    assert!(collided.len() > 1000, "{} of 1500 collided", collided.len());
    assert!(spread(&run) < before, "{} m, {before} m before", spread(&run));
}

#[test]
fn the_joints_of_ragdolls_hold() {
    let run = Run::new("ragdolls", 110).steps(STEPS);
    for (_, joint) in run.world.impulse_joints.iter() {
        let [one, other] = [joint.body1, joint.body2].map(|body| run.world.bodies[body].position());
        let apart = (one * joint.data.local_anchor1() - other * joint.data.local_anchor2()).norm();
        assert!(apart < 0.1, "{apart} m");
    }
}

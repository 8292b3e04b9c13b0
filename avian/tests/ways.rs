//! Ways in which a collider appears, changes or goes within a step: contacts and events equal those of avian's own broad phase.
//!
//! Each way has a lane of its own. Its target changes twice within a step, while balls rest on it, shake, and come and go.

mod support;

use avian::math::RVector;
use avian::prelude::*;
use bevy::prelude::*;
use std::collections::BTreeMap;
use support::places::{Place, add_places};
use support::record::{Compared, both};
use support::ways::{Change, Kind, Lane, OF_ALL_AABBS, OF_BODIES, OF_COLLIDERS, OF_PARTS, Way, spawn};
use support::{Divisor, Number, collider};

const STEPS: u32 = 72;
/// The steps in which targets change: while the ball that comes and goes is away, and while it is there.
const CHANGES: [[u32; 2]; 2] = [[8, 36], [20, 44]];
/// Numbers of entities in a lane.
const NUMBERS: u32 = 16;

/// The changes to make at a place.
#[derive(Resource)]
struct Plan {
    place: Place,
    changes: Vec<(Change, Lane)>,
}

/// A ball that moves along the first axis, and its velocity in each step.
#[derive(Component)]
struct Mover(fn(u32) -> f32);

fn spawn_lane(world: &mut World, kind: Kind, y: f32, number: u32) -> Lane {
    let ball = |number, x| (collider(1.0), Number(number), Transform::from_xyz(x, y, 0.0));
    let events = (RigidBody::Kinematic, CollisionEventsEnabled);
    let nobody = world.spawn((Number(number), Transform::from_xyz(0.0, y, 0.0))).id();
    let [target, body] = spawn(world, kind, nobody, y, number + 1);
    let resting = world.spawn((ball(number + 3, 0.6), events)).id();
    world.spawn((ball(number + 4, 0.0), ColliderOf { body: nobody }));
    world.spawn((ball(number + 5, -0.2), events, Mover(|step| if step % 12 < 6 { 8.0 } else { -8.0 })));
    world.spawn((ball(number + 6, -2.5), events, Mover(|step| if step < 40 { 8.0 } else { -8.0 })));
    Lane { kind, target, body, resting, nobody, y, number }
}

/// Makes the planned changes, once.
fn change(world: &mut World, place: Place) {
    let mut plan = world.resource_mut::<Plan>();
    if plan.place == place {
        for (change, lane) in std::mem::take(&mut plan.changes) {
            change(world, lane);
        }
    }
}

/// Spawns a lane for each way.
fn spawn_lanes(app: &mut App, kind: Kind, place: Place, ways: &[Way]) -> Vec<Lane> {
    // Which islands sleep depends on the order of contacts.
    app.insert_resource(TimeToSleep(f32::MAX));
    app.insert_resource(Plan { place, changes: vec![] }).insert_resource(Divisor(2));
    add_places(app, change);
    let lane = |(i, &(_, changes)): (u32, &Way)| {
        let lane = spawn_lane(app.world_mut(), kind, 20.0 * i as f32, NUMBERS * i);
        changes[0](app.world_mut(), lane);
        lane
    };
    (0..).zip(ways).map(lane).collect()
}

fn drive(app: &mut App, step: u32) {
    let mut movers = app.world_mut().query::<(&mut LinearVelocity, &Mover)>();
    for (mut velocity, mover) in movers.iter_mut(app.world_mut()) {
        velocity.0 = RVector::X * mover.0(step);
    }
}

/// Runs ways for targets of a kind, with changes at a place in two steps. Returns the step of the first difference of each way.
fn run(kind: Kind, place: Place, at: [u32; 2], ways: &[Way], compared: &mut Compared) -> BTreeMap<u32, u32> {
    let mut apps = both();
    let lanes = apps.each_mut().map(|app| spawn_lanes(app, kind, place, ways));
    let mut faults = BTreeMap::new();
    for step in 0..STEPS {
        for (app, lanes) in apps.iter_mut().zip(&lanes) {
            drive(app, step);
            if let Some(n) = at.iter().position(|&at| at == step) {
                let changes = ways.iter().zip(lanes).map(|((_, changes), &lane)| (changes[n + 1], lane));
                app.world_mut().resource_mut::<Plan>().changes = changes.collect();
            }
        }
        let differences = compared.step(&mut apps);
        let numbers = differences.iter().flat_map(|record| record.numbers());
        numbers.for_each(|number| _ = faults.entry(number.0 / NUMBERS).or_insert(step));
    }
    assert!(apps.iter().all(|app| app.world().resource::<Plan>().changes.is_empty()));
    faults
}

/// Runs all ways at all places, for targets of a kind.
fn run_all(kind: Kind) {
    let (mut compared, mut faults) = (Compared::default(), vec![]);
    let ways = [OF_COLLIDERS, OF_PARTS, OF_BODIES].concat();
    for place in Place::ALL {
        // Changes of all AABBs have worlds of their own, because they touch every lane. At the late places they are left out: there avian
        // may already have cleared its list of moved proxies.
        let is_late = matches!(place, Place::Finalize | Place::AfterFinalize | Place::BeforeLast);
        for ways in [&ways[..], OF_ALL_AABBS].into_iter().take(if is_late { 1 } else { 2 }) {
            for at in CHANGES {
                let differences = run(kind, place, at, ways, &mut compared);
                let name = |(way, step)| format!("{}: {place:?}, {at:?}, step {step}", ways[way as usize].0);
                faults.extend(differences.into_iter().map(name));
            }
        }
    }
    println!("{kind:?}: {compared:?}");
    assert!(faults.is_empty(), "{} differ:\n{}", faults.len(), faults.join("\n"));
    assert!(compared.contacts > 100_000 && compared.events > 10_000, "{compared:?}");
}

#[test]
fn a_collider_without_a_body() {
    run_all(Kind::Alone);
}

#[test]
fn a_collider_of_an_entity_that_is_no_body() {
    run_all(Kind::OfNobody);
}

#[test]
fn a_static_body() {
    run_all(Kind::Body(RigidBody::Static));
}

#[test]
fn a_kinematic_body() {
    run_all(Kind::Body(RigidBody::Kinematic));
}

#[test]
fn a_dynamic_body() {
    run_all(Kind::Body(RigidBody::Dynamic));
}

#[test]
fn a_child_of_a_static_body() {
    run_all(Kind::ChildOf(RigidBody::Static));
}

#[test]
fn a_child_of_a_dynamic_body() {
    run_all(Kind::ChildOf(RigidBody::Dynamic));
}

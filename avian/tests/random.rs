//! Random worlds: pbig beside avian's own broad phase, and in its place.

mod support;

use avian::collider_tree::{ColliderTreeProxyKey, ColliderTrees, MovedProxies};
use avian::collision::broad_phase::BroadPhaseSystems;
use avian::prelude::*;
use avian_pbig::{ColliderBoxes, PbigBroadPhasePlugin, Shadow};
use bevy::prelude::*;
use std::collections::HashMap;
use support::random::{Plan, RandomWorld};
use support::record::{Compared, both};
use support::{Number, Veto, app, app_with_pbig, plugins};

/// Returns the seeds of a number of worlds, times `PBIG_AVIAN_WORLDS`.
fn seeds(first: u64, worlds: u64) -> std::ops::Range<u64> {
    let times = std::env::var("PBIG_AVIAN_WORLDS").map_or(1, |times| times.parse().expect("a number"));
    first..first + worlds * times
}

fn plan(seed: u64, bodies: usize, steps: usize) -> Plan {
    Plan { seed, bodies, steps, is_locked: false, has_changes_within: true }
}

#[test]
fn pairs_equal_those_of_avian() {
    let (mut compared, mut steps, mut within) = (0, 0, 0);
    for seed in seeds(100, 4) {
        let plan = plan(seed, [30, 300, 300, 5000][seed as usize % 4], 320);
        let mut app = app(plugins().add(PbigBroadPhasePlugin::<Veto>::default().as_shadow()));
        plan.run(&mut app);
        let shadow = app.world().resource::<Shadow>();
        assert!(shadow.missing.is_empty(), "seed {seed}: {shadow:?}");
        assert!(shadow.spurious.is_empty(), "seed {seed}: {shadow:?}");
        compared += shadow.compared;
        steps += plan.steps;
        within += app.world().resource::<RandomWorld>().changes_within;
    }
    println!("shadow: {compared} contacts compared in {steps} steps, {within} changes within steps");
    assert!(compared > 1_000_000, "{compared} contacts compared");
}

/// Two worlds that change alike: in each step, avian's own broad phase leaves the same contacts and events.
#[test]
fn contacts_and_events_equal_those_of_avian() {
    let (mut compared, mut within) = (Compared::default(), 0);
    for seed in seeds(1000, 6) {
        let plan = Plan { is_locked: true, ..plan(seed, [30, 200, 400][seed as usize % 3], 160) };
        let mut apps = both();
        apps.iter_mut().for_each(|app| plan.add_to(app));
        for step in 0..plan.steps {
            apps.iter_mut().for_each(|app| plan.change(app, step));
            let [ours, avians] = compared.step(&mut apps);
            assert!(
                ours == avians,
                "seed {seed}, step {step}: only with pbig {ours:?}, only with avian's own {avians:?}"
            );
        }
        within += apps[0].world().resource::<RandomWorld>().changes_within;
    }
    println!("{compared:?}, {within} changes within steps");
    assert!(compared.contacts > 100_000 && compared.events > 1000, "{compared:?}");
}

/// Pairs that avian's own broad phase would add after pbig.
#[derive(Resource, Default)]
struct Missed(Vec<(Entity, Entity)>);

/// Avian's own broad phase runs after pbig, and must find nothing.
#[test]
fn avian_finds_nothing_after_pbig() {
    for seed in seeds(5, 2) {
        let mut app = app_with_pbig();
        app.init_resource::<Missed>();
        let place = note_missed.after(BroadPhaseSystems::CollectCollisions).before(BroadPhaseSystems::Last);
        app.add_systems(PhysicsSchedule, place.in_set(PhysicsStepSystems::BroadPhase));
        plan(seed, 400, 200).run(&mut app);
        assert_eq!(app.world().resource::<Missed>().0, []);
        assert!(app.world().resource::<ColliderBoxes>().broad_phase().len() > 300);
    }
}

/// Tests each moved proxy against every other, by avian's rules.
fn note_missed(
    (trees, moved): (Res<ColliderTrees>, Res<MovedProxies>),
    graph: Res<ContactGraph>,
    joints: Res<avian::dynamics::joints::joint_graph::JointGraph>,
    keys: Query<&ColliderTreeProxyKey>,
    hooks: Veto,
    mut commands: Commands,
    mut missed: ResMut<Missed>,
) {
    for &key in moved.proxies() {
        let proxy = trees.get_proxy(key).expect("a moved proxy");
        let aabb = trees.tree_for_type(key.tree_type()).get_proxy_aabb(key.id()).expect("an AABB");
        for &other_key in &keys {
            let Some(other) = trees.get_proxy(other_key) else { continue };
            let is_looked_at = !key.is_static() || proxy.is_sensor() || !other_key.is_static();
            let is_apart = {
                let tree = trees.tree_for_type(other_key.tree_type());
                let other = tree.get_proxy_aabb(other_key.id()).expect("an AABB");
                (aabb.min.cmpgt(other.max) | other.min.cmpgt(aabb.max)).any()
            };
            let is_joined = proxy.body.zip(other.body).is_some_and(|(one, other)| {
                joints.joints_between(one, other).any(|joint| joint.collision_disabled)
            });
            let asks = (proxy.flags.union(other.flags))
                .contains(avian::collider_tree::ColliderTreeProxyFlags::CUSTOM_FILTER);
            let (one, two) = (proxy.collider, other.collider);
            if one != two
                && is_looked_at
                && !is_apart
                && proxy.body != other.body
                && proxy.layers.interacts_with(other.layers)
                && !is_joined
                && !graph.contains(one, two)
                && (!asks || hooks.filter_pairs(one, two, &mut commands))
            {
                missed.0.push((one, two));
            }
        }
    }
}

/// The steps of two equal apps have equal contacts, in the same order.
#[test]
fn contacts_are_in_the_same_order_each_time() {
    let contacts = || {
        let mut app = app_with_pbig();
        plan(6, 300, 60).run(&mut app);
        let graph = app.world().resource::<ContactGraph>();
        let pairs = graph.active_pairs().iter().chain(graph.sleeping_pairs());
        pairs.map(|pair| (pair.collider1, pair.collider2)).collect::<Vec<_>>()
    };
    assert_eq!(contacts(), contacts());
}

/// Returns the contacts of numbered bodies by their numbers, the lower one first.
fn ends_by_pair(app: &App) -> HashMap<[Number; 2], [Number; 2]> {
    let graph = app.world().resource::<ContactGraph>();
    let pairs = graph.active_pairs().iter().chain(graph.sleeping_pairs());
    let number = |collider| app.world().get::<Number>(collider).copied();
    let ends = pairs.filter_map(|pair| Some([number(pair.collider1)?, number(pair.collider2)?]));
    ends.map(|ends| ([ends[0].min(ends[1]), ends[0].max(ends[1])], ends)).collect()
}

/// Two worlds begin alike. (Later their bodies are in other places, and others of them have moved.)
#[test]
fn contacts_have_their_colliders_in_avians_order() {
    let (mut compared, mut turned) = (0, 0);
    for seed in 10..20 {
        let [ours, avians] = [app_with_pbig(), app(plugins())].map(|mut app| {
            let plan = plan(seed, 300, 1);
            plan.add_to(&mut app);
            plan.change(&mut app, 0);
            app.update();
            ends_by_pair(&app)
        });
        assert_eq!(ours, avians);
        compared += ours.len();
        turned += ours.iter().filter(|(pair, ends)| pair != ends).count();
    }
    assert!(
        compared > 500 && turned > 100,
        "{compared} contacts compared, {turned} begin with the later body"
    );
}

//! Rapier's calls of a broad phase, and the order of its answers.

use crate::checked::{backends, pbig};
use crate::stress::memory::Weighed;
use pbig_harness::scenes::Scene;
use pbig_harness::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;

/// Notes the calls and the events of another broad phase.
struct Recorder<B> {
    inner: B,
    /// Modified and removed colliders, and `dt`, of each call.
    calls: Vec<(usize, usize, f32)>,
    /// Each event: true if a pair was added, and its indices.
    events: Vec<Vec<(bool, [u32; 2])>>,
}

impl<B> Recorder<B> {
    fn new(inner: B) -> Self {
        Self { inner, calls: Vec::new(), events: Vec::new() }
    }
}

impl<B: BroadPhase> BroadPhase for Recorder<B> {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        let start = events.len();
        self.inner.update(params, colliders, bodies, modified, removed, events);
        self.calls.push((modified.len(), removed.len(), params.dt));
        let indices = |pair: &ColliderPair| {
            let [a, b] = [pair.collider1, pair.collider2].map(|handle| handle.into_raw_parts().0);
            [a.min(b), a.max(b)]
        };
        let noted = |event: &BroadPhasePairEvent| match event {
            BroadPhasePairEvent::AddPair(pair) => (true, indices(pair)),
            BroadPhasePairEvent::DeletePair(pair) => (false, indices(pair)),
        };
        self.events.push(events[start..].iter().map(noted).collect());
    }
}

#[test]
fn a_step_is_two_calls_and_one_more_for_each_further_substep() {
    for (name, config) in backends() {
        let mut world = World::with_gravity(glam::Vec3::ZERO);
        world.params.max_ccd_substeps = 4;
        let wall = ColliderBuilder::cuboid(0.05, 5.0, 5.0).translation(vector![0.5, 0.0, 0.0]);
        world.colliders.insert(wall);
        // Five metres a step; the second one ends at the wall.
        let bullet = World::dynamic(glam::Vec3::X * -7.0).linvel(vector![300.0, 0.0, 0.0]);
        world.add(bullet.ccd_enabled(true).can_sleep(false), ColliderBuilder::ball(0.1));
        let mut recorder = Recorder::new(pbig(config));
        world.step(&mut recorder);
        let dt = world.params.dt;
        assert_eq!(recorder.calls, [(2, 0, dt), (1, 0, dt)], "{name}");
        recorder.calls.clear();
        world.step(&mut recorder);
        let calls = &recorder.calls;
        assert_eq!(calls[0], (0, 0, dt), "{name}: the app has changed nothing");
        assert!(calls.len() > 2 && calls[1..].iter().all(|call| call.2 < dt), "{name}: {calls:?}");
        assert!(world.bodies.iter().all(|(_, body)| body.translation().x < 0.5), "{name}: through the wall");
    }
}

#[test]
fn deletions_come_first_sorted_and_equal_on_every_backend() {
    let stream = |(_, config)| {
        let mut world = Scene::named("column").expect("the scene exists").build(150, 4);
        let mut recorder = Recorder::new(pbig(config));
        (0..60).for_each(|_| world.step(&mut recorder));
        recorder.events
    };
    let streams: Vec<_> = backends().into_iter().map(stream).collect();
    assert!(streams.iter().all(|stream| *stream == streams[0]));
    assert!(streams[0].iter().all(|call| call.is_sorted()), "false, a deletion, is less than true");
    let mixed = |call: &&Vec<(bool, [u32; 2])>| call.iter().any(|e| e.0) && call.iter().any(|e| !e.0);
    assert!(streams[0].iter().filter(mixed).count() > 5, "calls with both");
}

#[test]
fn repeated_calls_allocate_for_rare_plans_only() {
    let mut world = Scene::named("column").expect("the scene exists").build(3000, 4);
    let mut weighed = Weighed { inner: PbigBroadPhase::new(), bytes: 0, largest: vec![] };
    // While the column falls apart the number of pairs doubles, and buffers that hold pairs or candidates grow with it.
    (0..200).for_each(|_| world.step(&mut weighed));
    let before = weighed.inner.stats().totals.added;
    weighed.largest.clear();
    (0..200).for_each(|_| world.step(&mut weighed));
    let late = &weighed.largest;
    // Half of them have nothing to do.
    let asking = |least: usize| late.iter().filter(|bytes| **bytes > least).count();
    assert!(20 * asking(0) < late.len(), "{} of {} calls", asking(0), late.len());
    // Rows of pairs that have moved leave gaps, and move together into a new list once half of it is gaps.
    assert!(40 * asking(4096) <= late.len(), "{} calls for more than a plan: {late:?}", asking(4096));
    let added = weighed.inner.stats().totals.added - before;
    assert!(added > 1000, "{added} pairs");
}

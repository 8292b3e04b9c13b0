//! The order of the events that rapier gets.

use crate::checked::{backends, pbig};
use pbig_harness::scenes::Scene;
use rapier3d::prelude::*;

/// Notes the events of another broad phase.
struct Recorder<B> {
    inner: B,
    /// By call, each event: true if a pair was added, and its indices.
    events: Vec<Vec<(bool, [u32; 2])>>,
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
fn deletions_come_first_sorted_and_equal_on_every_backend() {
    let stream = |(_, config)| {
        let mut world = Scene::named("column").expect("the scene exists").build(150, 4);
        let mut recorder = Recorder { inner: pbig(config), events: Vec::new() };
        (0..60).for_each(|_| world.step(&mut recorder));
        recorder.events
    };
    let streams: Vec<_> = backends().into_iter().map(stream).collect();
    assert!(streams.iter().all(|stream| *stream == streams[0]));
    assert!(streams[0].iter().all(|call| call.is_sorted()), "false, a deletion, is less than true");
    let mixed = |call: &&Vec<(bool, [u32; 2])>| call.iter().any(|e| e.0) && call.iter().any(|e| !e.0);
    assert!(streams[0].iter().filter(mixed).count() > 5, "calls with both");
}

//! The broad phase in use, with its times and counts. Another one can take its place between two steps.

use crate::choice::Choice;
use pbig_scenes::world::World;
use rapier_pbig::{Error, PbigBroadPhase, PbigConfig};
use rapier3d::prelude::*;
use std::collections::HashSet;
use std::time::{Duration, Instant};

/// The broad phase that a world is stepped with.
pub struct Engine {
    choice: Choice,
    kind: Kind,
    /// Events of a swap, which the next update sends.
    pending: Vec<BroadPhasePairEvent>,
    /// Time inside since the last [`Engine::take_time`].
    time: Duration,
    /// `AddPair` events so far, those of swaps included.
    pub added: u64,
    /// `DeletePair` events so far, those of swaps included.
    pub deleted: u64,
}

enum Kind {
    Stock(Box<DefaultBroadPhase>),
    Pbig(Box<PbigBroadPhase>),
}

impl Kind {
    fn pbig(config: PbigConfig) -> Self {
        Self::Pbig(Box::new(PbigBroadPhase::with_config(config).expect("the default margin is a length")))
    }
}

impl Engine {
    /// Creates a broad phase for a world that has not been stepped.
    pub fn new(choice: Choice) -> Self {
        let kind = match choice.backend() {
            None => Kind::Stock(Box::default()),
            Some(backend) => Kind::pbig(PbigConfig { backend, ..PbigConfig::DEFAULT }),
        };
        Self { choice, kind, pending: Vec::new(), time: Duration::ZERO, added: 0, deleted: 0 }
    }

    /// Replaces the broad phase of a world that runs. The narrow phase keeps its pairs, so contacts stay warm.
    pub fn swap(&mut self, choice: Choice, world: &World) {
        let mut next = Self::new(choice);
        match &mut next.kind {
            Kind::Stock(stock) => next.pending = show_world(stock, world),
            Kind::Pbig(pbig) => pbig.adopt(&world.narrow_phase),
        }
        (next.added, next.deleted) = (self.added, self.deleted);
        *self = next;
    }

    /// Returns the broad phase that was asked for.
    pub fn choice(&self) -> Choice {
        self.choice
    }

    /// Returns pbig, unless stock is in use.
    pub fn pbig(&self) -> Option<&PbigBroadPhase> {
        match &self.kind {
            Kind::Stock(_) => None,
            Kind::Pbig(pbig) => Some(pbig),
        }
    }

    /// Returns the error of the last update. Stock has none.
    pub fn last_error(&self) -> Option<&Error> {
        self.pbig().and_then(PbigBroadPhase::last_error)
    }

    /// Returns the time inside the broad phase since the last call.
    pub fn take_time(&mut self) -> Duration {
        std::mem::take(&mut self.time)
    }
}

impl BroadPhase for Engine {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        let before = events.len();
        let broad_phase: &mut dyn BroadPhase = match &mut self.kind {
            Kind::Stock(stock) => &mut **stock,
            Kind::Pbig(pbig) => &mut **pbig,
        };
        let clock = Instant::now();
        events.append(&mut self.pending);
        broad_phase.update(params, colliders, bodies, modified, removed, events);
        self.time += clock.elapsed();
        let is_added = |event: &&BroadPhasePairEvent| matches!(event, BroadPhasePairEvent::AddPair(_));
        let added = events[before..].iter().filter(is_added).count();
        self.added += added as u64;
        self.deleted += (events.len() - before - added) as u64;
    }
}

/// Shows all colliders of a world to a new stock broad phase, and returns the events that bring the narrow phase up to date.
/// Stock skips colliders that have not changed, so a copy of them is marked as changed: marking the world's own colliders
/// would wake all bodies.
fn show_world(stock: &mut DefaultBroadPhase, world: &World) -> Vec<BroadPhasePairEvent> {
    let mut colliders = world.colliders.clone();
    let all: Vec<ColliderHandle> = colliders.iter_enabled().map(|(handle, _)| handle).collect();
    for &handle in &all {
        let pose = *colliders[handle].position();
        colliders[handle].set_position(pose);
    }
    let mut events = Vec::new();
    stock.update(&world.params, &colliders, &world.bodies, &all, &[], &mut events);
    differences(world, &events)
}

/// Returns the events that turn the narrow phase's pairs into the added ones. The narrow phase would skip a pair that it already
/// has, but the count of events would not.
fn differences(world: &World, added: &[BroadPhasePairEvent]) -> Vec<BroadPhasePairEvent> {
    let wanted: Vec<ColliderPair> = added.iter().map(event_pair).collect();
    let found: Vec<ColliderPair> = world.pairs().collect();
    let begun = missing_from(&found, &wanted).into_iter().map(BroadPhasePairEvent::AddPair);
    let ended = missing_from(&wanted, &found).into_iter().map(BroadPhasePairEvent::DeletePair);
    begun.chain(ended).collect()
}

/// Returns those of `pairs` that are not among `known`, whichever collider comes first.
fn missing_from(known: &[ColliderPair], pairs: &[ColliderPair]) -> Vec<ColliderPair> {
    let sorted = |pair: &ColliderPair| {
        let (a, b) = (pair.collider1, pair.collider2);
        if a.into_raw_parts() < b.into_raw_parts() { (a, b) } else { (b, a) }
    };
    let known: HashSet<_> = known.iter().map(sorted).collect();
    pairs.iter().filter(|pair| !known.contains(&sorted(pair))).copied().collect()
}

fn event_pair(event: &BroadPhasePairEvent) -> ColliderPair {
    match event {
        BroadPhasePairEvent::AddPair(pair) | BroadPhasePairEvent::DeletePair(pair) => *pair,
    }
}

#[cfg(test)]
impl Engine {
    /// Creates pbig with a limit on the number of pairs, above which updates fail.
    pub(crate) fn with_max_pairs(max_pairs: u64) -> Self {
        let kind = Kind::pbig(PbigConfig { max_pairs, ..PbigConfig::DEFAULT });
        Self { kind, ..Self::new(Choice::Auto) }
    }
}

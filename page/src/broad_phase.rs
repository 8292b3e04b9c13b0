//! A broad phase that changes between rapier's own and pbig's while a world runs, with a clock around it.

use crate::clock::now_ms;
use pbig_scenes::world::World;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;
use std::collections::HashSet;
use std::str::FromStr;

/// The broad phase in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// Rapier's own.
    Stock,
    /// pbig's.
    Pbig,
}

impl FromStr for Choice {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name {
            "stock" => Ok(Self::Stock),
            "pbig" => Ok(Self::Pbig),
            _ => Err(format!("no broad phase is called '{name}'; there are: stock, pbig")),
        }
    }
}

enum Inner {
    Stock(Box<DefaultBroadPhase>),
    Pbig(Box<PbigBroadPhase>),
}

/// The broad phase in use, the time spent in it, and the events of a change.
pub struct ExchangeableBroadPhase {
    inner: Inner,
    /// Events of a change to stock, which the next update sends.
    pending: Vec<BroadPhasePairEvent>,
    spent_ms: f64,
}

impl ExchangeableBroadPhase {
    /// Creates an empty broad phase, for a world that has not stepped yet.
    pub fn new(choice: Choice) -> Self {
        let inner = match choice {
            Choice::Stock => Inner::Stock(Box::default()),
            Choice::Pbig => Inner::Pbig(Box::default()),
        };
        Self { inner, pending: Vec::new(), spent_ms: 0.0 }
    }

    /// Returns the broad phase in use.
    pub fn choice(&self) -> Choice {
        match self.inner {
            Inner::Stock(_) => Choice::Stock,
            Inner::Pbig(_) => Choice::Pbig,
        }
    }

    /// Changes the broad phase of a running world. The narrow phase keeps its pairs, and sleeping bodies stay asleep.
    pub fn change(&mut self, choice: Choice, world: &World) {
        if choice == self.choice() {
            return;
        }
        *self = Self::new(choice);
        match &mut self.inner {
            Inner::Pbig(pbig) => pbig.adopt(&world.narrow_phase),
            Inner::Stock(stock) => self.pending = show_world(stock, world),
        }
    }

    /// Returns pbig's broad phase if it is in use.
    pub fn pbig(&self) -> Option<&PbigBroadPhase> {
        match &self.inner {
            Inner::Stock(_) => None,
            Inner::Pbig(pbig) => Some(pbig),
        }
    }

    /// Returns the milliseconds spent in updates since the last call.
    pub fn take_spent_ms(&mut self) -> f64 {
        std::mem::take(&mut self.spent_ms)
    }
}

/// Shows all colliders of a world to a new stock broad phase, and returns the events that bring the narrow phase up to date.
/// Stock skips colliders that are not marked as changed, so this marks a copy of them: rapier wakes the bodies of colliders that
/// are marked in the world itself.
fn show_world(stock: &mut DefaultBroadPhase, world: &World) -> Vec<BroadPhasePairEvent> {
    let colliders = marked_colliders(world);
    let all: Vec<_> = colliders.iter_enabled().map(|(handle, _)| handle).collect();
    let mut events = Vec::new();
    stock.update(&world.params, &colliders, &world.bodies, &all, &[], &mut events);
    differences(world, &events)
}

/// Returns a copy of a world's colliders, all marked as moved.
fn marked_colliders(world: &World) -> ColliderSet {
    let mut colliders = world.colliders.clone();
    for (_, collider) in colliders.iter_mut() {
        collider.set_position(*collider.position());
    }
    colliders
}

/// Returns the additions that the narrow phase lacks, and the ends of its pairs that are not among the additions.
fn differences(world: &World, additions: &[BroadPhasePairEvent]) -> Vec<BroadPhasePairEvent> {
    let held: HashSet<_> = world.pairs().map(sorted).collect();
    let added: HashSet<_> = additions.iter().filter_map(added_pair).map(sorted).collect();
    let is_new = |pair: &ColliderPair| !held.contains(&sorted(*pair));
    let new = additions.iter().filter_map(added_pair).filter(is_new);
    let ended = world.pairs().filter(|pair| !added.contains(&sorted(*pair)));
    new.map(BroadPhasePairEvent::AddPair).chain(ended.map(BroadPhasePairEvent::DeletePair)).collect()
}

fn added_pair(event: &BroadPhasePairEvent) -> Option<ColliderPair> {
    match event {
        BroadPhasePairEvent::AddPair(pair) => Some(*pair),
        BroadPhasePairEvent::DeletePair(_) => None,
    }
}

fn sorted(pair: ColliderPair) -> [(u32, u32); 2] {
    let mut handles = [pair.collider1, pair.collider2].map(ColliderHandle::into_raw_parts);
    handles.sort_unstable();
    handles
}

impl BroadPhase for ExchangeableBroadPhase {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        events.append(&mut self.pending);
        let start_ms = now_ms();
        let inner: &mut dyn BroadPhase = match &mut self.inner {
            Inner::Stock(stock) => &mut **stock,
            Inner::Pbig(pbig) => &mut **pbig,
        };
        inner.update(params, colliders, bodies, modified, removed, events);
        self.spent_ms += now_ms() - start_ms;
    }
}

#[cfg(test)]
mod tests;

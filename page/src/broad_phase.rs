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

/// The broad phase in use, the time spent in it, and what a change left behind.
pub struct ExchangeableBroadPhase {
    inner: Inner,
    /// Pairs of the narrow phase from before a change to stock. The next update ends those that stock does not add.
    inherited: Vec<ColliderPair>,
    spent_ms: f64,
}

impl ExchangeableBroadPhase {
    /// Creates an empty broad phase, for a world that has not stepped yet.
    pub fn new(choice: Choice) -> Self {
        let inner = match choice {
            Choice::Stock => Inner::Stock(Box::default()),
            Choice::Pbig => Inner::Pbig(Box::default()),
        };
        Self { inner, inherited: Vec::new(), spent_ms: 0.0 }
    }

    /// Returns the broad phase in use.
    pub fn choice(&self) -> Choice {
        match self.inner {
            Inner::Stock(_) => Choice::Stock,
            Inner::Pbig(_) => Choice::Pbig,
        }
    }

    /// Changes the broad phase of a running world.
    pub fn change(&mut self, choice: Choice, world: &mut World) {
        if choice == self.choice() {
            return;
        }
        *self = Self::new(choice);
        match &mut self.inner {
            Inner::Pbig(pbig) => pbig.adopt(&world.narrow_phase),
            Inner::Stock(_) => {
                self.inherited = world.pairs().collect();
                list_all_colliders(&mut world.colliders);
            }
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

/// Makes rapier list every collider in the next step, as moved. Its own broad phase learns of a collider in no other way, and
/// sleeping or fixed ones are not listed by themselves.
fn list_all_colliders(colliders: &mut ColliderSet) {
    for (_, collider) in colliders.iter_mut() {
        collider.set_position(*collider.position());
    }
}

/// Appends the end of each inherited pair that is not among the new ones.
fn end_pairs(inherited: Vec<ColliderPair>, events: &mut Vec<BroadPhasePairEvent>) {
    let added: HashSet<_> = events.iter().filter_map(added_pair).map(sorted).collect();
    let ended = inherited.into_iter().filter(|pair| !added.contains(&sorted(*pair)));
    events.extend(ended.map(BroadPhasePairEvent::DeletePair));
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
        let start_ms = now_ms();
        let inner: &mut dyn BroadPhase = match &mut self.inner {
            Inner::Stock(stock) => &mut **stock,
            Inner::Pbig(pbig) => &mut **pbig,
        };
        inner.update(params, colliders, bodies, modified, removed, events);
        self.spent_ms += now_ms() - start_ms;
        if !self.inherited.is_empty() {
            end_pairs(std::mem::take(&mut self.inherited), events);
        }
    }
}

#[cfg(test)]
mod tests;

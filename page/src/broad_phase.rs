//! A broad phase that changes between rapier's own and pbig's, on the CPU or on the GPU, while a world runs, with a clock around it.

use crate::clock::now_ms;
use crate::device::RemoteDevice;
use pbig_scenes::stock::StockBroadPhase;
use pbig_scenes::world::World;
use rapier_pbig::{Backend, PbigBroadPhase, PbigConfig};
use rapier3d::prelude::*;
use std::str::FromStr;

/// The broad phase in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// Rapier's own.
    Stock,
    /// pbig's, on the CPU.
    Pbig,
    /// pbig's, on the page's GPU.
    Gpu,
}

impl FromStr for Choice {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name {
            "stock" => Ok(Self::Stock),
            "pbig" => Ok(Self::Pbig),
            "gpu" => Ok(Self::Gpu),
            _ => Err(format!("no broad phase is called '{name}'; there are: stock, pbig, gpu")),
        }
    }
}

enum Inner {
    Stock(Box<StockBroadPhase>),
    Pbig(Box<PbigBroadPhase>),
}

impl Inner {
    fn new(choice: Choice) -> Self {
        match choice {
            Choice::Stock => Self::Stock(Box::default()),
            Choice::Pbig => Self::Pbig(Box::default()),
            Choice::Gpu => Self::Pbig(Box::new(on_device(RemoteDevice::gpu()))),
        }
    }
}

/// Returns pbig's broad phase on a device that does every call.
fn on_device(device: RemoteDevice) -> PbigBroadPhase {
    let config = PbigConfig { backend: Backend::Device, ..PbigConfig::DEFAULT };
    PbigBroadPhase::with_device(config, Box::new(device)).expect("the default margin is a length")
}

/// The broad phase in use, and the time spent in it.
pub struct ExchangeableBroadPhase {
    choice: Choice,
    inner: Inner,
    spent_ms: f64,
}

impl ExchangeableBroadPhase {
    /// Creates an empty broad phase, for a world that has not stepped yet.
    pub fn new(choice: Choice) -> Self {
        Self { choice, inner: Inner::new(choice), spent_ms: 0.0 }
    }

    /// Changes the broad phase of a running world. The narrow phase keeps its pairs, and sleeping bodies stay asleep.
    pub fn change(&mut self, choice: Choice, world: &World) {
        if choice == self.choice {
            return;
        }
        *self = Self::new(choice);
        match &mut self.inner {
            Inner::Pbig(pbig) => pbig.adopt(&world.narrow_phase),
            Inner::Stock(stock) => **stock = StockBroadPhase::adopt(world),
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
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Run;
    use std::collections::BTreeSet;

    /// Returns the sleeping bodies, and the pairs without those of two fixed colliders, which stock reports, too.
    fn state(run: &Run) -> (Vec<RigidBodyHandle>, BTreeSet<[(u32, u32); 2]>) {
        let World { bodies, colliders, .. } = &run.world;
        let asleep = bodies.iter().filter(|(_, body)| body.is_sleeping()).map(|(handle, _)| handle);
        let both = |pair: ColliderPair| [pair.collider1, pair.collider2];
        let can_move = |pair: &[ColliderHandle; 2]| pair.iter().any(|&it| colliders[it].parent().is_some());
        let raw = |pair: [ColliderHandle; 2]| {
            let mut raw = pair.map(ColliderHandle::into_raw_parts);
            raw.sort_unstable();
            raw
        };
        (asleep.collect(), run.world.pairs().map(both).filter(can_move).map(raw).collect())
    }

    /// After each change a world has the pairs that it would have had with stock from the start, and sleeps on.
    #[test]
    fn a_change_leaves_resting_bodies_alone() {
        let [mut changed, mut other] = [Choice::Pbig, Choice::Stock].map(|choice| {
            let mut run = Run::new("sleeping", 150, 1, choice).unwrap();
            (0..10).try_for_each(|_| run.step().map(drop)).unwrap();
            run
        });
        for choice in [Choice::Stock, Choice::Pbig, Choice::Stock] {
            changed.change_broad_phase(choice);
            for step in 1..=5 {
                changed.step().unwrap();
                other.step().unwrap();
                let (found, expected) = (state(&changed), state(&other));
                assert!(expected.0.len() > 100, "too few sleep: {}", expected.0.len());
                assert_eq!(found, expected, "{choice:?}, step {step}");
            }
        }
    }

    #[test]
    fn a_wrong_name_is_answered_with_the_right_ones() {
        assert_eq!("pbig".parse(), Ok(Choice::Pbig));
        let error = "grid".parse::<Choice>().unwrap_err();
        assert!(error.contains("'grid'") && error.contains("stock, pbig, gpu"), "{error}");
    }
}

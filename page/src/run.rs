//! A scene that runs, step by step.

use crate::choice::Choice;
use crate::clock::now_ms;
use pbig_scenes::exchange::Exchange;
use pbig_scenes::scenes::Scene;
use pbig_scenes::times::StepTime;
use pbig_scenes::world::World;
use rapier3d::prelude::ColliderPair;

/// A world and its broad phase.
pub struct Run {
    /// The world.
    pub world: World,
    choice: Choice,
    broad_phase: Exchange,
    steps: u32,
}

impl Run {
    /// Builds a scene with about this many bodies.
    ///
    /// # Errors
    /// A text that lists the scenes if none has this name.
    pub fn new(scene: &str, bodies: usize, seed: u64, choice: Choice) -> Result<Self, String> {
        let world = Scene::named(scene)?.build(bodies, seed);
        Ok(Self { world, choice, broad_phase: Exchange::new(choice.pbig(), now_ms), steps: 0 })
    }

    /// Advances the world by one step of rapier's length, 1/60 s.
    ///
    /// # Errors
    /// The text of pbig's error. Rapier has none.
    pub fn step(&mut self) -> Result<StepTime, String> {
        let start_ms = now_ms();
        self.world.step(&mut self.broad_phase);
        let step = now_ms() - start_ms;
        self.steps += 1;
        let time =
            StepTime { broad_phase: self.broad_phase.take_spent_ms(), step, queries: 0.0, frame: step };
        let error = self.broad_phase.pbig().and_then(|pbig| pbig.last_error());
        error.map_or(Ok(time), |error| Err(format!("step {}: {error}", self.steps)))
    }

    /// Changes the broad phase; the world goes on.
    pub fn change_broad_phase(&mut self, choice: Choice) {
        if choice != self.choice {
            self.choice = choice;
            self.broad_phase.change(choice.pbig(), &self.world);
        }
    }

    /// Returns the number of steps so far.
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Returns pbig's algorithm in the last update and the reason for it; empty with rapier's own broad phase.
    pub fn plan(&self) -> String {
        self.broad_phase.pbig().map(|pbig| pbig.stats().report.plan.to_string()).unwrap_or_default()
    }

    /// Returns the broad phase's pairs as sorted pairs of collider indices, the lower index first. For stock, whose own list
    /// is private, these are the narrow phase's.
    pub fn pairs(&self) -> Vec<[u32; 2]> {
        let mut pairs: Vec<_> = match self.broad_phase.pbig() {
            Some(pbig) => pbig.pairs().map(indices).collect(),
            None => self.world.pairs().map(indices).collect(),
        };
        pairs.sort_unstable();
        pairs
    }
}

fn indices(pair: ColliderPair) -> [u32; 2] {
    let mut both = [pair.collider1, pair.collider2].map(|handle| handle.into_raw_parts().0);
    both.sort_unstable();
    both
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::choice::on_device;
    use crate::remote::RemoteDevice;
    use pbig_core::oracle;
    use std::cell::Cell;

    thread_local!(static CALLS: Cell<u32> = const { Cell::new(0) });

    /// Rapier 0.27 updates its broad phase twice in each step, but boxes move before one of the updates only.
    #[test]
    fn a_step_asks_the_device_once_at_most() {
        let device = RemoteDevice {
            find_all: |boxes, filters| {
                CALLS.set(CALLS.get() + 1);
                Some(oracle::pairs_filtered(boxes, filters.expect("a world has filters")))
            },
        };
        let mut run = Run::new("column", 100, 1, Choice::Stock).unwrap();
        run.step().unwrap();
        run.broad_phase.change(Some(on_device(device)), &run.world);
        run.step().unwrap();
        for step in 0..30 {
            let before = CALLS.get();
            run.step().unwrap();
            assert!(CALLS.get() - before <= 1, "step {step}: {} calls", CALLS.get() - before);
        }
        assert!(CALLS.get() > 10, "{} calls", CALLS.get());
    }
}

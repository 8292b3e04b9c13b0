//! A broad phase for each engine, side by side: every call must return the same on all of them.

use pbig_core::{BroadPhase, Config, Engine};
use std::fmt::Debug;

/// The first one is left to the policy.
pub(super) struct Engines(Vec<BroadPhase>);

impl Engines {
    pub(super) fn new(config: Config) -> Self {
        let with = |engine| BroadPhase::new(Config { engine, ..config }).expect("a good margin");
        Self(std::iter::once(None).chain(Engine::ALL.map(Some)).map(with).collect())
    }

    /// Returns the answer that all broad phases give.
    pub(super) fn ask<T: PartialEq + Debug>(&self, question: impl Fn(&BroadPhase) -> T) -> T {
        let mut answers = self.0.iter().map(|one| (question(one), one));
        let (first, policy) = answers.next().expect("engines");
        for (other, one) in answers {
            let (plan, other_plan) = (&policy.report().plan, &one.report().plan);
            assert_eq!(first, other, "{plan} and {other_plan}, {:?}", one.config().engine);
        }
        first
    }

    /// Changes all broad phases alike, and returns the result that all of them give.
    pub(super) fn change<T: PartialEq + Debug>(&mut self, call: impl Fn(&mut BroadPhase) -> T) -> T {
        let mut results: Vec<T> = self.0.iter_mut().map(call).collect();
        for (one, other) in self.0.iter().zip(&results) {
            let plan = &one.report().plan;
            assert_eq!(other, &results[0], "{plan}, {:?}", one.config().engine);
        }
        results.swap_remove(0)
    }

    /// Compares the snapshots, and goes on with a restored broad phase in place of the first one.
    pub(super) fn save_and_restore(&mut self) {
        let save = |one: &BroadPhase| postcard::to_stdvec(one).expect("a snapshot");
        let bytes = self.ask(save);
        self.0[0] = postcard::from_bytes(&bytes).expect("a restored broad phase");
        assert_eq!(save(&self.0[0]), bytes);
    }
}

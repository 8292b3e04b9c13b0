//! Random operations on small worlds: each call of the broad phase is compared with rapier's own and with brute force. A
//! failure shrinks to a few operations.
//!
//! The suite plays about 110,000 operations on the CPU and 25,000 more on its engines one by one. With `PBIG_RUNS=6400` it plays more:
//! about 10^6 on the CPU, and 1.5 x 10^6 on its engines.

mod ops;
mod subject;

use crate::checked::{on_cpu, on_gpu, pbig};
use crate::queries::compare_with_tree;
use ops::{Act, Op, any_ops};
use pbig_harness::runner::Timed;
use pbig_harness::world::World;
use pbig_tests::{Way, engines, needs_gpu};
use rand::RngExt;
use rapier_pbig::shadow::Watcher;
use rapier3d::prelude::*;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use subject::Subject;

/// Sums over all runs.
#[derive(Clone, Copy, Debug, Default)]
struct OperationCounts {
    runs: u64,
    ops: u64,
    steps: u64,
    /// Steps after which rapier's broad phase was still compared with: see `Watcher::has_stock`.
    beside_stock: u64,
    oracle_pairs: u64,
    contacts: u64,
    /// Rays that hit, of one a step.
    hits: u64,
    restores: u64,
    /// Runs that a panic of rapier's outside its broad phase has cut short.
    cut_short: u64,
}

impl OperationCounts {
    fn plus(self, other: Self) -> Self {
        Self {
            runs: self.runs + other.runs,
            ops: self.ops + other.ops,
            steps: self.steps + other.steps,
            beside_stock: self.beside_stock + other.beside_stock,
            oracle_pairs: self.oracle_pairs + other.oracle_pairs,
            contacts: self.contacts + other.contacts,
            hits: self.hits + other.hits,
            restores: self.restores + other.restores,
            cut_short: self.cut_short + other.cut_short,
        }
    }

    /// A few runs by hand may well have nothing of something.
    fn assert_that_much_happened(&self) {
        println!("{self:?}");
        let few = self.runs < 20;
        assert!(few || self.oracle_pairs > self.steps, "hardly any pairs: {self:?}");
        assert!(few || self.contacts > self.steps / 10, "hardly any contacts: {self:?}");
        assert!(few || self.hits > self.steps / 10, "hardly any rays hit: {self:?}");
        assert!(few || self.beside_stock > self.steps / 2, "hardly compared with stock: {self:?}");
        assert!(few || self.restores > self.runs / 2, "hardly ever restored: {self:?}");
        assert!(few || self.cut_short < self.runs / 20, "rapier panics often: {self:?}");
    }
}

/// The reason for which a run ends before its last operation.
enum End {
    Wrong(String),
    /// Rapier's own bugs are not the matter here, but they must be few.
    RapierPanicked,
}

/// The state in which a run ended; no poses and no pairs when it was cut short.
#[derive(Default)]
struct Outcome {
    tally: OperationCounts,
    poses: Vec<u32>,
    pairs: Vec<[(u32, u32); 2]>,
}

impl Outcome {
    /// Returns an error if another run ended in another state.
    fn compare(&self, other: &Self) -> Result<(), String> {
        if self.tally.contacts != other.tally.contacts || self.poses != other.poses {
            return Err("the bodies have gone other ways".into());
        }
        if self.pairs == other.pairs { Ok(()) } else { Err("the broad phase has other pairs".into()) }
    }
}

/// The world, and the broad phase with its checker around it.
struct RandomScene {
    world: World,
    broad_phase: Timed<Subject>,
    way: Way,
    tally: OperationCounts,
}

impl RandomScene {
    fn new(way: Way, has_room_for_two: bool) -> Self {
        let mut world = World::with_gravity(glam::Vec3::ZERO);
        // With CCD, calls between the two of a step, for a part of it.
        world.params.max_ccd_substeps = 3;
        let broad_phase = Timed::new(Subject::new(way, has_room_for_two)).checked(way.margin, 1);
        Self { world, broad_phase, way, tally: OperationCounts { runs: 1, ..OperationCounts::default() } }
    }

    fn play(&mut self, op: Op) -> Result<(), End> {
        self.tally.ops += 1;
        match op.act {
            Act::Step => return (0..op.rng().random_range(1..=3)).try_for_each(|_| self.step()),
            Act::Snapshot => {
                self.restore_world();
                self.broad_phase.inner.restore(self.way);
            }
            Act::Fresh => {
                self.restore_world();
                let (mut fresh, adopts) = (pbig(self.way), op.rng().random());
                if adopts {
                    fresh.adopt(&self.world.narrow_phase);
                }
                // Else it adds all pairs again, which does rapier no harm.
                let known = if adopts { self.world.pairs().collect() } else { vec![] };
                self.watcher().start_over_with(known);
                self.broad_phase.inner.pbig = fresh;
            }
            _ => op.apply(&mut self.world),
        }
        Ok(())
    }

    fn restore_world(&mut self) {
        self.tally.restores += 1;
        self.world = World::from_bytes(&self.world.to_bytes()).expect("these are the bytes of a world");
    }

    fn step(&mut self) -> Result<(), End> {
        let step = AssertUnwindSafe(|| self.world.step(&mut self.broad_phase));
        let whole = catch_unwind(step).is_ok();
        if let Some(first) = self.broad_phase.first_difference() {
            return Err(End::Wrong(first.to_string()));
        }
        match (whole, self.broad_phase.inner.busy) {
            (true, _) => self.count_step()?,
            (false, true) => return Err(End::Wrong("the broad phase has panicked".into())),
            (false, false) => return Err(End::RapierPanicked),
        }
        match &self.broad_phase.inner.pbig.stats().report.fallback {
            Some(why) => Err(End::Wrong(format!("the CPU has done a GPU's work: {why}"))),
            None => Ok(()),
        }
    }

    fn count_step(&mut self) -> Result<(), End> {
        let touching = self.world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact);
        self.tally.contacts += touching.count() as u64;
        self.tally.steps += 1;
        self.tally.beside_stock += u64::from(self.watcher().has_stock());
        self.tally.oracle_pairs = self.watcher().checker.oracle_pairs;
        // Right after a step each box holds its collider.
        let answers = compare_with_tree(&self.world, &self.broad_phase.inner.pbig, self.tally.steps);
        self.tally.hits += answers.map_err(End::Wrong)?;
        Ok(())
    }

    fn watcher(&mut self) -> &mut Watcher {
        self.broad_phase.watcher.as_mut().expect("it is checked")
    }

    fn outcome(&self) -> Outcome {
        let parts = |pair: ColliderPair| [pair.collider1, pair.collider2].map(ColliderHandle::into_raw_parts);
        let mut pairs: Vec<_> = self.broad_phase.inner.pbig.pairs().map(parts).collect();
        pairs.sort_unstable();
        Outcome { tally: self.tally, poses: self.world.pose_bits(), pairs }
    }
}

/// Plays the operations and another step, so that the last one is seen too; or says what was wrong.
fn run(ops: &[Op], way: impl Into<Way>) -> Result<Outcome, String> {
    run_with(ops, way.into(), false)
}

fn run_with(ops: &[Op], way: Way, has_room_for_two: bool) -> Result<Outcome, String> {
    let mut scene = RandomScene::new(way, has_room_for_two);
    match ops.iter().try_for_each(|op| scene.play(*op)).and_then(|()| scene.step()) {
        Ok(()) => Ok(scene.outcome()),
        Err(End::Wrong(what)) => Err(what),
        Err(End::RapierPanicked) => {
            Ok(Outcome { tally: OperationCounts { cut_short: 1, ..scene.tally }, ..Outcome::default() })
        }
    }
}

/// Why a list of operations fails a test, and the list.
type Failure = (String, Vec<Op>);

/// Returns the number of runs that the environment asks for.
fn given() -> Option<u64> {
    std::env::var("PBIG_RUNS").ok().map(|runs| runs.parse().expect("PBIG_RUNS is a number of runs"))
}

/// Tests random lists of operations until one fails, and makes that one small.
fn try_random_ops(runs: u64, test: &impl Fn(&[Op]) -> Result<(), String>) -> Result<(), Failure> {
    for run in 0..given().unwrap_or(runs) {
        let ops = any_ops(run);
        test(&ops).map_err(|why| smallest((why, ops), test))?;
    }
    Ok(())
}

/// Leaves out operations while the rest fails: many at once, then each alone until none can go.
fn smallest((mut why, mut ops): Failure, test: &impl Fn(&[Op]) -> Result<(), String>) -> Failure {
    let mut size = ops.len();
    while size > 0 {
        let (before, mut at) = (ops.len(), 0);
        while at < ops.len() {
            let rest = [&ops[..at], &ops[(at + size).min(ops.len())..]].concat();
            match test(&rest) {
                Err(other) => (why, ops) = (other, rest),
                Ok(()) => at += size,
            }
        }
        if size > 1 || ops.len() == before {
            size /= 2;
        }
    }
    (why, ops)
}

fn listed(ops: &[Op]) -> String {
    ops.iter().map(|op| format!("{op:?}\n")).collect()
}

/// Runs a test on random lists of operations and sums up what happened in the runs that it returns.
fn on_random_ops(runs: u64, test: impl Fn(&[Op]) -> Result<Outcome, String>) -> OperationCounts {
    let sum = Cell::new(OperationCounts::default());
    let counted = |ops: &[Op]| -> Result<(), String> {
        sum.set(sum.get().plus(test(ops)?.tally));
        Ok(())
    };
    if let Err((why, ops)) = try_random_ops(runs, &counted) {
        panic!("{why}\nafter these operations and a step:\n{}", listed(&ops));
    }
    sum.get()
}

#[test]
fn random_worlds_agree_with_stock_and_the_oracle() {
    let [cpu, grid] = on_cpu();
    let [on_cpu, on_grid] = [cpu, grid].map(|config| on_random_ops(700, |ops| run(ops, config)));
    let tally = on_cpu.plus(on_grid);
    tally.assert_that_much_happened();
    assert!(tally.ops >= 100_000 || given().is_some(), "{tally:?}");
    for (_, way) in engines() {
        let way = way.with(|it| it.margin = cpu.margin);
        on_random_ops(100, |ops| run(ops, way)).assert_that_much_happened();
    }
}

#[test]
fn random_worlds_on_a_gpu_have_the_bits_of_the_cpu() {
    needs_gpu!();
    let tally = on_random_ops(20, |ops| {
        let found = run(ops, on_gpu())?;
        found.compare(&run(ops, on_cpu()[0])?)?;
        Ok(found)
    });
    tally.assert_that_much_happened();
}

#[test]
fn a_snapshot_anywhere_continues_bit_identically() {
    let config = on_cpu()[0];
    let tally = on_random_ops(20, |ops| {
        // A fresh broad phase has other fat boxes than one that was there all along, so other pairs.
        let saved =
            |op: &Op| if matches!(op.act, Act::Fresh) { Op { act: Act::Snapshot, ..*op } } else { *op };
        let ops: Vec<Op> = ops.iter().map(saved).collect();
        let kept: Vec<Op> = ops.iter().copied().filter(|op| !matches!(op.act, Act::Snapshot)).collect();
        let with = run(&ops, config)?;
        with.compare(&run(&kept, config)?)?;
        Ok(with)
    });
    tally.assert_that_much_happened();
}

#[test]
fn a_planted_fault_is_noticed_and_shrinks_to_a_few_operations() {
    let failing = |ops: &[Op]| run_with(ops, on_cpu()[0].into(), true).map(|_| ());
    let (why, ops) = try_random_ops(100, &failing).expect_err("the fault is noticed");
    assert!(ops.len() <= 6, "{why}: {} operations:\n{}", ops.len(), listed(&ops));
}

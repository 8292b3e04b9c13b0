//! A call through rapier, ours and stock's, in which all or few colliders move; and the stages of the
//! finder's update, each on its own.
//!
//! `cargo bench -p pbig-benches --bench update`; for ratios `pbig bench update` is better, which measures both
//! in turn.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use pbig_core::{BroadPhase as Incremental, Config, ProxyFilter};
use pbig_harness::boxes::{BoxSet, Movers, Wander};
use pbig_harness::field::Field;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;
use std::time::{Duration, Instant};

fn boxes(set: &str, n: usize) -> Vec<pbig_core::Aabb> {
    BoxSet::named(set).expect("the set exists").boxes(n, 1)
}

/// The broad phase's part of a step; moving the bodies is not counted.
fn through_rapier(c: &mut Criterion) {
    let mut group = c.benchmark_group("through rapier, uniform");
    group.sample_size(10);
    for (n, share) in [(1_000, 1.0), (10_000, 1.0), (100_000, 1.0), (100_000, 0.01)] {
        let mut field = Field::new(&boxes("uniform", n));
        let movers = Movers::new(n, share);
        let sides: [(&str, Box<dyn BroadPhase>); 2] =
            [("pbig", Box::new(PbigBroadPhase::new())), ("stock", Box::new(DefaultBroadPhase::new()))];
        for (name, mut broad_phase) in sides {
            field.call(&mut *broad_phase, &field.colliders, &mut Vec::new());
            let mut frame = 0;
            let id = BenchmarkId::new(name, format!("{n}, {}% moved", share * 100.0));
            group.bench_function(id, |b| {
                b.iter_custom(|rounds| {
                    let mut sum = Duration::ZERO;
                    for _ in 0..rounds {
                        frame += 1;
                        let (modified, mut events) = (field.shift(&movers.of(frame), 1.0), Vec::new());
                        let clock = Instant::now();
                        field.call(&mut *broad_phase, &modified, &mut events);
                        sum += clock.elapsed();
                    }
                    sum
                });
            });
        }
    }
}

/// As the finder itself measures them.
fn stages(c: &mut Criterion) {
    let mut group = c.benchmark_group("stages, unit 100000, all moved");
    group.sample_size(10);
    let mut wander = Wander::new(boxes("unit", 100_000), 1.0, 0.1);
    let mut broad_phase = Incremental::new(Config::DEFAULT).expect("a good margin");
    let mut frame = 0;
    for (stage, (name, _)) in broad_phase.report().stages.named().into_iter().enumerate() {
        group.bench_function(name, |b| {
            b.iter_custom(|rounds| {
                let mut sum = Duration::ZERO;
                for _ in 0..rounds {
                    frame += 1;
                    for id in wander.step(frame) {
                        let aabb = wander.boxes[id as usize];
                        broad_phase.set(id, aabb, ProxyFilter::ALL).expect("a small id");
                    }
                    broad_phase.update().expect("few pairs");
                    sum += broad_phase.report().stages.named()[stage].1;
                }
                sum
            });
        });
    }
}

criterion_group!(benches, through_rapier, stages);
criterion_main!(benches);

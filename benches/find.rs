//! The finder alone, set by set and size by size; updates in which all or few boxes move;
//! and the first update of a rapier world beside stock's.
//!
//! `cargo bench -p pbig-benches`

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use pbig_core::{BroadPhase as Incremental, Config, Finder, Order, ProxyFilter};
use pbig_harness::boxes::{BoxSet, moved};
use pbig_harness::scenes::Scene;
use rapier_pbig::PbigBroadPhase;
use rapier3d::prelude::*;
use std::hint::black_box;

const CONFIG: Config = Config { order: Order::Unspecified, ..Config::DEFAULT };

fn find(c: &mut Criterion) {
    let mut group = c.benchmark_group("find");
    group.sample_size(20);
    // Not `degenerate`: its huge boxes all overlap each other, and their pairs are all one measures.
    for set in BoxSet::ALL.into_iter().filter(|set| set.name != "degenerate") {
        for n in [100, 1_000, 10_000, 100_000] {
            let boxes = set.boxes(n, 1);
            let mut finder = Finder::new(CONFIG);
            group.throughput(Throughput::Elements(n as u64));
            group.bench_function(BenchmarkId::new(set.name, n), |b| {
                b.iter(|| finder.find(black_box(&boxes)).map(<[_]>::len));
            });
        }
    }
}

fn update(c: &mut Criterion) {
    let mut group = c.benchmark_group("update");
    group.sample_size(20);
    for (name, share) in [("all moved", 1), ("1 in 100 moved", 100)] {
        let frames = [0, 1].map(|seed| moved(&unit(100_000), 0.1, seed));
        let mut broad_phase = Incremental::new(Config::DEFAULT).expect("a good margin");
        let mut frame = 0;
        group.bench_function(name, |b| {
            b.iter(|| {
                frame += 1;
                for (id, aabb) in frames[frame % 2].iter().enumerate().step_by(share) {
                    broad_phase.set(id as u32, *aabb, ProxyFilter::ALL).expect("a small id");
                }
                broad_phase.update().map(|events| events.added.len())
            });
        });
    }
}

fn unit(n: usize) -> Vec<pbig_core::Aabb> {
    BoxSet::named("unit").expect("the set exists").boxes(n, 1)
}

/// One update of a world that no broad phase has seen.
fn first_update(c: &mut Criterion) {
    let world = Scene::named("column").expect("the scene exists").build(10_000, 1);
    let handles: Vec<ColliderHandle> = world.colliders.iter().map(|(handle, _)| handle).collect();
    let run = |broad_phase: &mut dyn BroadPhase| {
        let mut events = Vec::new();
        broad_phase.update(&world.params, &world.colliders, &world.bodies, &handles, &[], &mut events);
        events.len()
    };
    let mut group = c.benchmark_group("first update, column 10000");
    group.bench_function("pbig", |b| b.iter(|| run(&mut PbigBroadPhase::new())));
    group.bench_function("stock", |b| b.iter(|| run(&mut DefaultBroadPhase::new())));
}

criterion_group!(benches, find, update, first_update);
criterion_main!(benches);

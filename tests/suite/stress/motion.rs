//! Worlds that move for long or far: free fall, explosions.

use super::{memory, through_updates};
use crate::follower::Follower;
use pbig_core::{Aabb, Algorithm, Backend, BroadPhase, Config, Engine, ProxyFilter};
use pbig_tests::{on_threads, set, shifted};

/// A column of cubes after a number of steps of 1/60 s under 9.81 m/s^2, computed as it would be: in f32.
struct Falling {
    boxes: Vec<Aabb>,
    speed: f32,
}

impl Falling {
    fn new(n: usize) -> Self {
        Self { boxes: set("pile", n, 3), speed: 0.0 }
    }

    fn step(&mut self, acceleration: f32) {
        self.speed -= acceleration / 60.0;
        let by = self.speed / 60.0;
        self.boxes.iter_mut().for_each(|b| (b.min[1], b.max[1]) = (b.min[1] + by, b.max[1] + by));
    }
}

fn small_and_grid() -> [Config; 2] {
    let base = Config { backend: Backend::Cpu, margin: 0.01, ..Config::DEFAULT };
    [base, Config { engine: Some(Engine::Grid), ..base }]
}

#[test]
fn free_fall_for_a_million_steps_at_the_same_cost_and_memory() {
    let steps = if std::env::var_os("PBIG_STRESS").is_some() { 1_000_000 } else { 6000 };
    // This depth in fewer steps.
    let acceleration = 9.81 * (1e6 / steps as f32).powi(2);
    for config in small_and_grid() {
        let (cost, depth) = on_threads(1, || fall(config, steps, acceleration));
        println!("{:?}: {steps} steps to {depth:e}, at most {cost:?} checks", config.engine);
        assert!(depth < -1e9, "fell to {depth}");
        assert!(cost.late <= cost.early * 5 / 4, "{cost:?}: deep down it costs more");
        assert!(cost.early > 0 && cost.late > 0, "{cost:?}");
        // Brute force tests each of 200 boxes against all, wherever they are.
        let most = if config.engine.is_none() { 200 * 200 } else { 30 * 200 };
        assert!(cost.most <= most, "{cost:?} in an update of 200 boxes");
    }
}

/// The most tests of an update: of all, of the first quarter and of the last.
#[derive(Debug, Default)]
struct Cost {
    most: u64,
    early: u64,
    late: u64,
}

impl Cost {
    fn note(&mut self, made: u64, step: usize, steps: usize) {
        self.most = made.max(self.most);
        // When all come, there is no update before to begin with.
        if (1..steps / 4).contains(&step) {
            self.early = made.max(self.early);
        } else if step >= steps - steps / 4 {
            self.late = made.max(self.late);
        }
    }
}

/// Returns the cost of a fall, and its depth. A sample of the updates is compared with the oracle.
fn fall(config: Config, steps: usize, acceleration: f32) -> (Cost, f32) {
    let (mut falling, mut world) = (Falling::new(200), Follower::new(config, 200));
    let (mut cost, mut early) = (Cost::default(), 0);
    for step in 0..steps {
        falling.step(acceleration);
        for (id, aabb) in falling.boxes.iter().enumerate() {
            world.set(id as u32, *aabb, ProxyFilter::ALL);
        }
        if step % (steps / 500) == 0 {
            world.update(&format!("step {step}"));
        } else {
            world.update_unchecked();
        }
        let report = world.broad_phase.report();
        // In a slow fall few boxes leave their margins in a step, or none does.
        let algorithm = report.plan.algorithm;
        let is_small = matches!(algorithm, Algorithm::Brute | Algorithm::LookUp);
        assert!(algorithm == Algorithm::Nothing || is_small == config.engine.is_none(), "step {step}");
        cost.note(report.checks.made, step, steps);
        let held = memory::held();
        if step < steps / 4 {
            early = held.max(early);
        }
        assert!(held <= early * 5 / 4 + 100_000, "step {step}: {held} bytes are held, at first {early}");
    }
    (cost, falling.boxes[0].min[1])
}

/// Ever faster, until the coordinates are infinite and then no numbers, and from the beginning again.
#[test]
fn a_fall_beyond_the_range_of_f32_and_back() {
    let start = Falling::new(150).boxes;
    let mut frames = vec![start.clone()];
    for decade in 0..40 {
        // From 10^39 on this is infinite.
        let depth = 10f64.powi(decade) as f32;
        frames.push(frames[frames.len() - 1].iter().map(|b| shifted(b, [0.0, -depth, 0.0])).collect());
    }
    assert!(frames[40].iter().all(|b| b.max[1] == f32::NEG_INFINITY));
    frames.push(vec![Aabb::NOWHERE; 150]);
    frames.push(start);
    through_updates("beyond the range", &frames);
}

/// A heap at rest flies apart, each box its own way and faster each frame, out of the range of f32; then another one.
#[test]
fn explosions_from_a_heap_to_infinity() {
    for n in [150, 1100] {
        let heap = set("pile", n, 8);
        let middle = heap[n / 2].min;
        let blown = |b: &Aabb, factor: f32| {
            let by: [f32; 3] = std::array::from_fn(|k| (b.min[k] - middle[k]) * factor);
            shifted(b, by)
        };
        let frame = |factor: f32| heap.iter().map(|b| blown(b, factor)).collect::<Vec<_>>();
        let factors = [0.0, 0.01, 0.3, 10.0, 1e4, 1e9, 1e20, 1e37, f32::MAX, 0.0, 1e6, 0.0];
        through_updates("explosion", &factors.map(frame));
    }
}

/// One of many flies off each frame, and the others stay: no resolution is lost to those that have gone.
#[test]
fn debris_that_leaves_for_ever_does_not_cost_those_that_stay() {
    let heap = set("pile", 3000, 9);
    let mut broad_phase =
        BroadPhase::new(Config { backend: Backend::Cpu, ..Config::DEFAULT }).expect("a margin");
    let mut most = 0;
    for frame in 0..300 {
        for (id, aabb) in heap.iter().enumerate() {
            let flown = if id % 50 == 0 && id / 10 < frame { 10f32.powi((frame / 8) as i32) } else { 0.0 };
            let there = shifted(aabb, [flown, -flown * 0.5, flown * (id as f32 / 3000.0)]);
            broad_phase.set(id as u32, there, ProxyFilter::ALL).expect("a small id");
        }
        broad_phase.update().expect("few pairs");
        most = if frame > 0 { broad_phase.report().checks.made.max(most) } else { 0 };
    }
    assert!(most > 0 && most < 60 * 3000, "{most} checks in an update");
}

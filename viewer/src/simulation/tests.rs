//! Tests of steps, swaps and errors.

use super::*;

fn column(choice: Choice) -> Simulation {
    let scene = Scene::named("column").unwrap();
    Simulation::new(Setting { scene, bodies: 300, seed: 1 }, choice)
}

fn sleeping(simulation: &Simulation) -> usize {
    simulation.world.bodies.iter().filter(|(_, body)| body.is_sleeping()).count()
}

/// The pairs whose boxes overlap without a margin, by brute force. Every broad phase must report each of them.
fn touching(world: &World) -> Vec<(ColliderHandle, ColliderHandle)> {
    let dynamic = |collider: &Collider| collider.parent().is_some_and(|body| world.bodies[body].is_dynamic());
    let boxes: Vec<_> =
        world.colliders.iter().map(|(handle, c)| (handle, c.compute_aabb(), dynamic(c))).collect();
    let mut pairs = Vec::new();
    for (i, (a, box_a, dynamic_a)) in boxes.iter().enumerate() {
        for (b, box_b, dynamic_b) in &boxes[i + 1..] {
            if (*dynamic_a || *dynamic_b) && box_a.intersects(box_b) {
                pairs.push((*a, *b));
            }
        }
    }
    pairs
}

/// Makes a step, and returns how many pairs that touched at its start and touch at its end are unknown. Rapier 0.36 looks for
/// pairs at the start of a step, rapier 0.27 at its end as well.
fn missed_in_a_step(simulation: &mut Simulation) -> usize {
    let before = touching(&simulation.world);
    simulation.step();
    let (after, narrow_phase) = (touching(&simulation.world), &simulation.world.narrow_phase);
    let is_missed =
        |pair: &&(_, _)| after.contains(pair) && narrow_phase.contact_pair(pair.0, pair.1).is_none();
    before.iter().filter(is_missed).count()
}

#[test]
fn the_world_goes_on_through_every_swap_and_no_pair_is_lost() {
    let mut simulation = column(Choice::Stock);
    let mut choice = Choice::Stock;
    for swaps in 0..7 {
        for step in 0..16 {
            let missed = missed_in_a_step(&mut simulation);
            assert_eq!((simulation.steps, missed), (16 * swaps + step + 1, 0), "with {choice:?}");
        }
        assert!(!touching(&simulation.world).is_empty());
        choice = choice.next();
        simulation.swap(choice);
        assert_eq!(simulation.engine.choice(), choice);
    }
}

/// A new broad phase that nobody shows the world misses sleeping colliders: so the check above can fail.
#[test]
fn without_showing_the_world_pairs_are_lost() {
    let mut simulation = column(Choice::Cpu);
    (0..60).for_each(|_| simulation.step());
    simulation.world.narrow_phase = NarrowPhase::new();
    simulation.engine = Engine::new(Choice::Stock);
    assert!(missed_in_a_step(&mut simulation) > 0);
}

#[test]
fn a_swap_wakes_nobody() {
    let scene = Scene::named("pile").unwrap();
    let mut simulation = Simulation::new(Setting { scene, bodies: 64, seed: 1 }, Choice::Cpu);
    (0..400).for_each(|_| simulation.step());
    let before = sleeping(&simulation);
    assert!(before > 0, "the pile is asleep");
    for choice in [Choice::Stock, Choice::Cpu, Choice::Stock] {
        simulation.swap(choice);
        simulation.step();
        assert_eq!(sleeping(&simulation), before, "after the swap to {choice:?}");
    }
}

#[test]
fn the_same_setting_gives_the_same_world_after_a_reset() {
    let mut simulation = column(Choice::Cpu);
    let start = simulation.world.pose_bits();
    simulation.step();
    let one_step = simulation.world.pose_bits();
    assert_ne!(start, one_step);
    simulation.reset();
    assert_eq!((simulation.steps, simulation.world.pose_bits()), (0, start));
    simulation.step();
    assert_eq!(simulation.world.pose_bits(), one_step);
}

#[test]
fn every_scene_comes_in_turn() {
    let mut simulation = column(Choice::Cpu);
    let first = simulation.setting.scene.name;
    for _ in Scene::ALL {
        simulation.setting = simulation.setting.next_scene();
    }
    assert_eq!(simulation.setting.scene.name, first);
    simulation.next_scene();
    assert!(simulation.setting.scene.name != first && simulation.steps == 0);
}

#[test]
fn a_thrown_ball_flies() {
    let mut simulation = column(Choice::Cpu);
    let before = simulation.world.bodies.len();
    simulation.throw(Ball { from: [-50.0, 3.0, 0.0], velocity: [60.0, 0.0, 0.0], radius: 1.0 });
    assert_eq!(simulation.world.bodies.len(), before + 1);
    simulation.step();
    let farthest =
        simulation.world.bodies.iter().map(|(_, body)| body.translation().x).fold(f32::MAX, f32::min);
    assert!((farthest + 49.0).abs() < 0.01, "{farthest}");
}

#[test]
fn figures_after_a_swap_are_of_the_new_broad_phase_alone() {
    let mut simulation = column(Choice::Stock);
    for (i, choice) in [Choice::Cpu, Choice::Stock, Choice::Cpu].into_iter().enumerate() {
        (0..3).for_each(|_| simulation.step());
        simulation.swap(choice);
        assert_eq!(simulation.history.last(), None);
        simulation.step();
        assert_eq!(simulation.history.last(), None, "the first step sets up");
        simulation.step();
        let last = simulation.history.last().unwrap();
        assert_eq!((last.choice, last.swaps as usize), (choice, i + 1));
        assert_eq!(simulation.history.summary(|step| step.step_ms).p99, last.step_ms, "of one step");
    }
}

#[test]
fn a_swap_to_the_broad_phase_in_use_changes_nothing() {
    for choice in [Choice::Stock, Choice::Cpu] {
        let mut simulation = column(choice);
        simulation.step();
        let before = (simulation.engine.events(), simulation.history.last().copied());
        assert!(before.1.is_some());
        simulation.swap(choice);
        assert_eq!((simulation.engine.events(), simulation.history.last().copied()), before, "{choice:?}");
        simulation.step();
        assert_eq!((simulation.history.steps().len(), simulation.history.swaps()), (2, 0));
    }
}

#[test]
fn an_error_of_the_broad_phase_is_that_of_the_step() {
    let mut simulation = column(Choice::Auto);
    simulation.step();
    assert_eq!(simulation.check(), Ok(()));
    simulation.engine = Engine::with_max_pairs(10);
    simulation.step();
    let error = simulation.check().unwrap_err().to_string();
    assert!(error.starts_with("step 2: ") && error.contains("10"), "{error}");
}

//! Tests of steps, swaps and errors.

use super::*;

fn column(choice: Choice) -> Simulation {
    let scene = Scene::named("column").unwrap();
    Simulation::new(Setting { scene, bodies: 300, seed: 1 }, choice)
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
        let before = (simulation.broad_phase.events(), simulation.history.last().copied());
        assert!(before.1.is_some());
        simulation.swap(choice);
        assert_eq!(
            (simulation.broad_phase.events(), simulation.history.last().copied()),
            before,
            "{choice:?}"
        );
        simulation.step();
        assert_eq!((simulation.history.steps().len(), simulation.history.swaps()), (2, 0));
    }
}

#[test]
fn an_error_of_the_broad_phase_is_that_of_the_step() {
    let mut simulation = column(Choice::Auto);
    simulation.step();
    assert_eq!(simulation.check(), Ok(()));
    simulation.broad_phase = with_max_pairs(10);
    simulation.step();
    let error = simulation.check().unwrap_err();
    assert!(error.starts_with("step 2: ") && error.contains("10"), "{error}");
}

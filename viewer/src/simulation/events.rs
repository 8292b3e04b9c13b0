//! Rapier's collision events, of contacts and of sensors, go on through swaps of the broad phase.

use super::*;
use crate::rapier::is_touching;
use std::collections::BTreeSet;

type Pair = [(u32, u32); 2];

/// The broad phases to swap to, in turn: from stock to pbig, from pbig to pbig, and from pbig to stock.
const SWAPS: [Choice; 4] = [Choice::Stock, Choice::Cpu, Choice::Brute, Choice::Cpu];

fn sorted(a: ColliderHandle, b: ColliderHandle) -> Pair {
    let mut pair = [a, b].map(ColliderHandle::into_raw_parts);
    pair.sort_unstable();
    pair
}

/// A world whose collision events are followed.
struct Followed {
    world: World,
    engine: Engine,
    /// Pairs that have started to touch and have not stopped.
    open: BTreeSet<Pair>,
}

impl Followed {
    fn new(world: World, choice: Choice) -> Self {
        Self { world, engine: Engine::new(choice), open: BTreeSet::new() }
    }

    /// Makes one step, and returns its events: the pair, and whether it has started. Fails if a pair starts twice, or stops
    /// without a start.
    fn step(&mut self) -> Result<BTreeSet<(Pair, bool)>, String> {
        let mut events = BTreeSet::new();
        for event in self.engine.step_with_events(&mut self.world) {
            let pair = sorted(event.collider1(), event.collider2());
            let is_new = events.insert((pair, event.started()));
            let is_due = if event.started() { self.open.insert(pair) } else { self.open.remove(&pair) };
            if !is_new || !is_due {
                return Err(format!("{event:?}"));
            }
        }
        Ok(events)
    }

    /// Returns the pairs that touch according to the narrow phase.
    fn touching(&self) -> BTreeSet<Pair> {
        let narrow_phase = &self.world.narrow_phase;
        let contacts = narrow_phase.contact_pairs().filter(|pair| is_touching(pair));
        let contacts = contacts.map(|pair| sorted(pair.collider1, pair.collider2));
        let sensors = narrow_phase.intersection_pairs().filter(|(.., is_touching)| *is_touching);
        contacts.chain(sensors.map(|(a, b, _)| sorted(a, b))).collect()
    }
}

/// Balls that pass through rows of fixed cubes, every other one a sensor. Nothing pushes a ball, so that events depend neither
/// on the order of pairs nor on the broad phase. In each row the balls have another velocity; those of the first stand still.
fn rows() -> World {
    let report = |collider: ColliderBuilder| {
        collider
            .active_collision_types(ActiveCollisionTypes::all())
            .active_events(ActiveEvents::COLLISION_EVENTS)
    };
    let mut world = World::default();
    for row in 0..8 {
        for place in 0..12 {
            let at = [1.5 * place as f32, 0.0, 2.0 * row as f32];
            let cube = ColliderBuilder::cuboid(0.4, 0.4, 0.4).sensor(place % 2 == 0);
            world.colliders.insert(report(cube).translation(at.into()));
        }
        for start in [0.0, -1.5, -3.3] {
            let body = RigidBodyBuilder::kinematic_velocity_based();
            let body = body.translation([start, 0.1, 2.0 * row as f32].into());
            world.add(body.linvel([1.3 * row as f32, 0.0, 0.0].into()), report(ColliderBuilder::ball(0.3)));
        }
    }
    world
}

/// Compares each step's events with those of a world that keeps its broad phase. `swap` is called every seventh step.
fn compare(kept: Choice, swap: impl Fn(&mut Followed, Choice)) -> Result<usize, String> {
    let mut swapped = Followed::new(rows(), Choice::Cpu);
    let mut other = Followed::new(rows(), kept);
    let (mut count, mut turns) = (0, SWAPS.iter().cycle());
    for step in 1..=150 {
        let (found, expected) = (swapped.step()?, other.step()?);
        if found != expected || swapped.touching() != other.touching() || swapped.open != swapped.touching() {
            return Err(format!("step {step}: {found:?}, not {expected:?}"));
        }
        count += found.len();
        if step % 7 == 0 {
            swap(&mut swapped, *turns.next().unwrap());
        }
    }
    Ok(count)
}

#[test]
fn contacts_and_sensors_have_the_events_of_an_unswapped_world() {
    for kept in [Choice::Stock, Choice::Cpu] {
        let count = compare(kept, |it, choice| it.engine.swap(choice, &it.world)).unwrap();
        assert!(count > 200, "{count} events with {kept:?}");
    }
}

/// A broad phase to which nobody shows the world knows neither the fixed cubes nor what touches already.
#[test]
fn the_comparison_notices_a_broad_phase_that_starts_empty() {
    assert!(compare(Choice::Stock, |it, choice| it.engine = Engine::new(choice)).is_err());
}

/// Bodies that fall and are pushed take another way with another order of pairs. Still, no event comes twice, and none is lost.
#[test]
fn no_pair_of_a_scene_starts_twice_or_stops_without_a_start() {
    for scene in ["column", "sensors", "conveyor"] {
        let mut world = Scene::named(scene).unwrap().build(200, 1);
        for (_, collider) in world.colliders.iter_mut() {
            collider.set_active_events(ActiveEvents::COLLISION_EVENTS);
        }
        let mut followed = Followed::new(world, Choice::Cpu);
        for choice in SWAPS.into_iter().cycle().take(12) {
            for step in 1..=10 {
                followed.step().unwrap_or_else(|event| panic!("{scene}, {choice:?}, step {step}: {event}"));
                assert_eq!(followed.open, followed.touching(), "{scene}, {choice:?}, step {step}");
            }
            followed.engine.swap(choice, &followed.world);
        }
        assert!(followed.open.len() > 50, "{scene}: {}", followed.open.len());
    }
}

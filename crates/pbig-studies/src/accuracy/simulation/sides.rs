//! Worlds of one scene, side by side: with rapier's own broad phase, with pbig's, and with bodies or events in another
//! order.

use crate::mechanics::Mechanics;
use crate::numbered::{Apart, Numbered};
use crate::reported::Reported;
use crate::sorted::{LowerFirst, Sorted};
use glam::Vec3;
use pbig_harness::bench::timed;
use pbig_harness::output::Failure;
use pbig_harness::scenes::Scene;
use pbig_harness::world::{World, to_vector};
use rapier_pbig::{PbigBroadPhase, PbigConfig};
use rapier3d::prelude::*;
use std::hash::{DefaultHasher, Hash, Hasher};

/// The things whose order differs from rapier's own broad phase in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Order {
    /// Bodies, as they are inserted; of a seed.
    Permuted(u64),
    /// Events, as rapier is told of them: as ours has them.
    Sorted,
    /// The two colliders of each of our pairs: as rapier's own broad phase has them.
    LowerFirst,
}

/// One way to run a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Way {
    pub(super) name: &'static str,
    /// Of pbig's broad phase; none: rapier's own.
    margin: Option<f32>,
    order: Option<Order>,
    /// The way before it once more.
    is_again: bool,
}

const fn stock(name: &'static str, order: Option<Order>) -> Way {
    Way { name, margin: None, order, is_again: false }
}

const fn pbig(name: &'static str, margin: f32) -> Way {
    Way { name, margin: Some(margin), order: None, is_again: false }
}

const fn again(name: &'static str, way: Way) -> Way {
    Way { name, is_again: true, ..way }
}

const STOCK: Way = stock("stock", None);
/// The control that shows which part of a difference is due to the order of events.
const SORTED: Way = stock("stock sorted", Some(Order::Sorted));
const PBIG: Way = pbig("pbig", PbigConfig::DEFAULT.margin);

/// So many orders of insertion beside the scene's: a run that is one more of them is farther than all these once in 20 times.
pub(super) const PERMUTED: usize = 19;

/// All ways, what the others are held against first.
pub(super) static WAYS: [Way; PERMUTED + 8] = ways();

const fn ways() -> [Way; PERMUTED + 8] {
    let mut ways = [STOCK; PERMUTED + 8];
    ways[1] = again("stock again", STOCK);
    let mut order = 1;
    while order <= PERMUTED {
        ways[1 + order] = stock("stock permuted", Some(Order::Permuted(order as u64)));
        order += 1;
    }
    ways[PERMUTED + 2] = SORTED;
    ways[PERMUTED + 3] = again("stock sorted again", SORTED);
    ways[PERMUTED + 4] = Way { name: "pbig lower first", order: Some(Order::LowerFirst), ..PBIG };
    ways[PERMUTED + 5] = PBIG;
    ways[PERMUTED + 6] = again("pbig again", PBIG);
    ways[PERMUTED + 7] = pbig("pbig without margin", 0.0);
    ways
}

impl Way {
    pub(super) fn is_pbig(&self) -> bool {
        self.margin.is_some()
    }

    /// Pbig's, or stock in our order of events; for the first time.
    pub(super) fn is_held_against_stock(&self) -> bool {
        (self.is_pbig() || self.order == Some(Order::Sorted)) && !self.is_again
    }

    /// Rapier's own broad phase, and another order of bodies.
    pub(super) fn is_permuted(&self) -> bool {
        matches!(self.order, Some(Order::Permuted(_)))
    }

    fn broad_phase(&self) -> Box<dyn BroadPhase> {
        let stock = DefaultBroadPhase::new();
        let config = |margin| PbigConfig { margin, ..PbigConfig::DEFAULT };
        let ours = |margin| PbigBroadPhase::with_config(config(margin)).expect("a length");
        match (self.margin, self.order) {
            (Some(margin), Some(Order::LowerFirst)) => Box::new(LowerFirst(ours(margin))),
            (Some(margin), _) => Box::new(ours(margin)),
            (None, Some(Order::Sorted)) => Box::new(Sorted(stock)),
            (None, _) => Box::new(stock),
        }
    }

    fn inserted(&self, scene: &Numbered) -> Numbered {
        match self.order {
            Some(Order::Permuted(seed)) => scene.permuted(seed),
            _ => scene.inserted(&(0..scene.bodies.len()).collect::<Vec<_>>()),
        }
    }
}

/// A scene, how large, and for how long.
#[derive(Clone, Copy)]
pub(super) struct Case {
    pub(super) scene: &'static str,
    bodies: usize,
    pub(super) steps: usize,
}

pub(super) const fn case(scene: &'static str, bodies: usize, steps: usize) -> Case {
    Case { scene, bodies, steps }
}

/// The one scene that the harness does not have: see [`cloud`].
pub(super) const CLOUD: &str = "cloud";

impl Case {
    fn world(&self) -> Result<World, Failure> {
        if self.scene == CLOUD {
            return Ok(cloud(self.bodies));
        }
        Ok(Scene::named(self.scene)?.build(self.bodies, 1))
    }
}

/// Balls and cubes that fly at a common centre and through each other's ways, without gravity, ground or sleep: what
/// they have of momentum they must keep.
fn cloud(bodies: usize) -> World {
    let mut world = World::with_gravity(Vec3::ZERO);
    let side = (bodies as f32).cbrt().ceil() as usize;
    for i in 0..bodies {
        let place = [i % side, i / side % side, i / side / side].map(|k| k as f32 - side as f32 / 2.0);
        let at = Vec3::from_array(place) * 1.5;
        // The lattice is not symmetric, or momenta would add up to nothing that could be lost.
        let velocity = -at + Vec3::new(0.5, 0.2 * (i % 7) as f32, -0.3);
        let shape =
            if i % 2 == 0 { ColliderBuilder::ball(0.5) } else { ColliderBuilder::cuboid(0.4, 0.4, 0.4) };
        world.add(World::dynamic(at).linvel(to_vector(velocity)).can_sleep(false), shape);
    }
    world
}

/// The state of one way after a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sample {
    pub(super) mechanics: Mechanics,
    /// From the first way's bodies.
    pub(super) apart: Apart,
    /// Of every number of every pose: the same exactly where two worlds with one order of bodies are.
    pub(super) poses: u64,
    /// Dynamic bodies that do not sleep, %.
    pub(super) awake: f64,
}

/// One way under way.
pub(super) struct Side {
    pub(super) way: Way,
    numbered: Numbered,
    broad_phase: Box<dyn BroadPhase>,
    /// After each step.
    pub(super) samples: Vec<Sample>,
    /// Of each step.
    pub(super) ms: Vec<f64>,
    /// Of the steps in which pairs were compared with brute force.
    pub(super) reported: Reported,
    /// Those steps.
    pub(super) compared: u64,
    /// Pairs that ended while their colliders touched.
    pub(super) parted: u64,
}

impl Side {
    fn new(way: Way, scene: &Numbered) -> Self {
        let (numbered, broad_phase) = (way.inserted(scene), way.broad_phase());
        let (reported, compared, parted) = (Reported::default(), 0, 0);
        Self { way, numbered, broad_phase, samples: vec![], ms: vec![], reported, compared, parted }
    }

    fn step(&mut self) {
        let world = &mut self.numbered.world;
        let touching = touching(world);
        let ((), ms) = timed(|| world.step(&mut *self.broad_phase));
        self.ms.push(ms);
        let is_there =
            |pair: &&[ColliderHandle; 2]| world.narrow_phase.contact_pair(pair[0], pair[1]).is_some();
        self.parted += (touching.len() - touching.iter().filter(is_there).count()) as u64;
    }

    fn look(&mut self, apart: Apart) {
        let world = &self.numbered.world;
        let mut poses = DefaultHasher::new();
        world.pose_bits().hash(&mut poses);
        let (mechanics, poses, awake) = (Mechanics::of(world), poses.finish(), awake(world));
        self.samples.push(Sample { mechanics, apart, poses, awake });
        if self.samples.len().is_multiple_of(COMPARED) {
            self.reported += Reported::of(world);
            self.compared += 1;
        }
    }
}

/// Pairs of colliders that rapier holds to be in contact.
fn touching(world: &World) -> Vec<[ColliderHandle; 2]> {
    let pairs = world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact);
    pairs.map(|pair| [pair.collider1, pair.collider2]).collect()
}

/// Of the dynamic bodies, in percent.
fn awake(world: &World) -> f64 {
    let bodies = || world.bodies.iter().filter(|(_, body)| body.is_dynamic());
    let awake = bodies().filter(|(_, body)| !body.is_sleeping()).count();
    awake as f64 / bodies().count().max(1) as f64 * 100.0
}

/// Bodies that keep a world from coming to rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Moving {
    /// Those with more than a kinetic energy for each kilogram.
    pub(super) moving: usize,
    /// Of these, those with a shape that rolls.
    pub(super) round: usize,
}

impl Side {
    /// At the end, by the limit for a world at rest.
    pub(super) fn moving(&self, rest: f64) -> Moving {
        let world = &self.numbered.world;
        let mut found = Moving::default();
        for (_, body) in world.bodies.iter().filter(|(_, body)| body.is_dynamic()) {
            let is_moving = f64::from(body.kinetic_energy()) > rest * f64::from(body.mass());
            let is_round = body.colliders().iter().any(|&one| rolls(world.colliders[one].shape()));
            found.moving += usize::from(is_moving);
            found.round += usize::from(is_moving && is_round);
        }
        found
    }
}

/// Rapier has no rolling friction.
fn rolls(shape: &dyn Shape) -> bool {
    use ShapeType::{Ball, Capsule, Cone, Cylinder};
    let is_round = |shape: &dyn Shape| matches!(shape.shape_type(), Ball | Capsule | Cone | Cylinder);
    match shape.as_compound() {
        Some(compound) => compound.shapes().iter().any(|(_, part)| is_round(&**part)),
        None => is_round(shape),
    }
}

/// Each way that was run twice: its name, and the first step after which the two differ.
pub(super) fn repeats(sides: &[Side]) -> Vec<(&'static str, Option<usize>)> {
    let repeat = |two: &[Side]| {
        let poses = |side: &Side| side.samples.iter().map(|sample| sample.poses).collect::<Vec<_>>();
        let same = poses(&two[0]).iter().zip(&poses(&two[1])).position(|(one, again)| one != again);
        (two[0].way.name, same.map(|step| step + 1))
    };
    sides.windows(2).filter(|two| two[1].way.is_again).map(repeat).collect()
}

/// Pairs are compared with brute force in one of so many steps.
const COMPARED: usize = 20;

/// All ways through a scene, in turn step by step.
pub(super) fn simulated(case: Case) -> Result<Vec<Side>, Failure> {
    let scene = Numbered::new(case.world()?);
    let mut sides: Vec<Side> = WAYS.iter().map(|way| Side::new(*way, &scene)).collect();
    for step in 0..case.steps {
        for place in 0..sides.len() {
            sides[(step + place) % WAYS.len()].step();
        }
        let apart: Vec<Apart> = sides.iter().map(|side| sides[0].numbered.apart(&side.numbered)).collect();
        sides.iter_mut().zip(apart).for_each(|(side, apart)| side.look(apart));
    }
    Ok(sides)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_that_sleep_are_counted_and_pairs_that_end_while_they_touch() {
        let scene = Numbered::new(case("pile", 8, 0).world().expect("a scene"));
        let mut side = Side::new(PBIG, &scene);
        for _ in 0..200 {
            side.step();
            side.look(Apart::default());
        }
        let awake: Vec<f64> = side.samples.iter().map(|sample| sample.awake).collect();
        assert_eq!((awake[0], awake[199], side.parted), (100.0, 0.0, 0), "{awake:?}");
        let touched = touching(&side.numbered.world).len();
        let top = &mut side.numbered.world.bodies[side.numbered.bodies[7]];
        top.set_translation(vector![0.0, 90.0, 0.0], true);
        side.step();
        side.look(Apart::default());
        let parted = touched - touching(&side.numbered.world).len();
        assert_eq!((side.parted, parted > 0), (parted as u64, true), "{touched} touched");
        assert!(side.samples[200].awake > 0.0);
    }
}

//! Worlds of one scene, side by side: with rapier's own broad phase, with pbig's, and with bodies or events in another
//! order.

use super::{Mechanics, percent};
use crate::reordered::KINDS;
use crate::reported::Reported;
use glam::Vec3;
use pbig_harness::bench::timed;
use pbig_harness::output::Failure;
use pbig_harness::scenes::Scene;
use pbig_harness::world::{World, to_vector};
use rand::SeedableRng;
use rand::rngs::StdRng;
use rand::seq::SliceRandom;
use rapier_pbig::{PbigBroadPhase, PbigConfig};
use rapier3d::prelude::*;
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

/// A world, and the handle of each body by its number. The number does not depend on the order of insertion.
struct Numbered {
    world: World,
    bodies: Vec<RigidBodyHandle>,
}

impl Numbered {
    /// Numbers bodies in the order in which they were inserted.
    fn new(world: World) -> Self {
        let bodies = world.bodies.iter().map(|(handle, _)| handle).collect();
        Self { world, bodies }
    }

    /// Returns this world before its first step, with bodies inserted in an order drawn from the seed; without one, in their
    /// own. Their colliders are in that order too, after those without a body. No scene has articulations.
    fn inserted(&self, seed: Option<u64>) -> Self {
        let mut order: Vec<usize> = (0..self.bodies.len()).collect();
        if let Some(seed) = seed {
            order.shuffle(&mut StdRng::seed_from_u64(seed));
        }
        let from = &self.world;
        let mut world = World::with_gravity(from.gravity);
        world.params = from.params;
        let mut bodies = vec![RigidBodyHandle::invalid(); self.bodies.len()];
        for (_, collider) in from.colliders.iter().filter(|(_, collider)| collider.parent().is_none()) {
            world.colliders.insert(collider.clone());
        }
        for number in order {
            let body = &from.bodies[self.bodies[number]];
            bodies[number] = world.bodies.insert(body.clone());
            for &collider in body.colliders() {
                let collider = from.colliders[collider].clone();
                world.colliders.insert_with_parent(collider, bodies[number], &mut world.bodies);
            }
        }
        let there: HashMap<_, _> = self.bodies.iter().zip(&bodies).collect();
        for (_, joint) in from.impulse_joints.iter() {
            world.impulse_joints.insert(*there[&joint.body1], *there[&joint.body2], joint.data, true);
        }
        Self { world, bodies }
    }

    /// Returns the mean and the largest distance between the positions of bodies of one number.
    fn apart(&self, other: &Self) -> [f64; 2] {
        let place = |of: &Self, body: RigidBodyHandle| of.world.bodies[body].translation().map(f64::from);
        let pairs = self.bodies.iter().zip(&other.bodies);
        let distances = pairs.map(|(&one, &two)| (place(self, one) - place(other, two)).norm());
        let [sum, most] = distances.fold([0.0, 0.0], |[sum, most]: [f64; 2], by| [sum + by, most.max(by)]);
        [sum / self.bodies.len().max(1) as f64, most]
    }
}

/// One way to run a scene.
#[derive(Clone, Copy)]
pub(super) struct Variant {
    pub(super) name: &'static str,
    /// The seed of the order in which bodies are inserted; none: as the scene has them.
    seed: Option<u64>,
    /// True for the way before it once more.
    pub(super) is_again: bool,
    broad_phase: fn() -> Box<dyn BroadPhase>,
}

/// The number of orders of insertion beside the scene's: a run that is one more of them is farther than all these once in 20 times.
pub(super) const PERMUTED: usize = 19;

/// Returns all ways, the one that the others are held against first.
fn ways() -> Vec<Variant> {
    let way = |(name, broad_phase)| Variant { name, seed: None, is_again: false, broad_phase };
    let again = |name, way| Variant { name, is_again: true, ..way };
    let [pbig, lower_first, stock, sorted] = KINDS.map(way);
    let permuted = |seed| Variant { name: "stock permuted", seed: Some(seed), ..stock };
    let mut ways = vec![stock, again("stock again", stock)];
    ways.extend((1..=PERMUTED as u64).map(permuted));
    ways.extend([sorted, again("stock sorted again", sorted), lower_first, pbig, again("pbig again", pbig)]);
    ways.push(way(("pbig without margin", || {
        let config = PbigConfig { margin: 0.0, ..PbigConfig::DEFAULT };
        Box::new(PbigBroadPhase::with_config(config).expect("a length"))
    })));
    ways
}

impl Variant {
    pub(super) fn is_pbig(&self) -> bool {
        self.name.starts_with("pbig")
    }
}

/// A scene, its bodies, and its steps.
pub(super) type SceneCase = (&'static str, usize, usize);

/// The one scene that the harness does not have: see [`cloud`].
pub(super) const CLOUD: &str = "cloud";

fn world((scene, bodies, _): SceneCase) -> Result<World, Failure> {
    Ok(if scene == CLOUD { cloud(bodies) } else { Scene::named(scene)?.build(bodies, 1) })
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
pub(super) struct Sample {
    pub(super) mechanics: Mechanics,
    /// Mean and largest distance from the first way's bodies.
    pub(super) apart: [f64; 2],
    /// A hash of every number of every pose: the same exactly where two worlds with one order of bodies are.
    pub(super) poses: u64,
    /// Dynamic bodies that do not sleep, in percent.
    pub(super) awake: f64,
}

/// One way under way.
pub(super) struct VariantRun {
    pub(super) way: Variant,
    numbered: Numbered,
    broad_phase: Box<dyn BroadPhase>,
    /// After each step.
    pub(super) samples: Vec<Sample>,
    /// Milliseconds of each step.
    pub(super) ms: Vec<f64>,
    /// Sums over the steps in which pairs were compared with brute force.
    pub(super) reported: Reported,
    /// Pairs that ended while their colliders touched.
    pub(super) parted: u64,
}

impl VariantRun {
    fn new(way: Variant, scene: &Numbered) -> Self {
        let (numbered, broad_phase) = (scene.inserted(way.seed), (way.broad_phase)());
        let (reported, parted) = (Reported::default(), 0);
        Self { way, numbered, broad_phase, samples: vec![], ms: vec![], reported, parted }
    }

    fn step(&mut self) {
        let world = &mut self.numbered.world;
        let touching = touching(world);
        let ((), ms) = timed(|| world.step(&mut *self.broad_phase));
        self.ms.push(ms);
        let has_ended =
            |pair: &&[ColliderHandle; 2]| world.narrow_phase.contact_pair(pair[0], pair[1]).is_none();
        self.parted += touching.iter().filter(has_ended).count() as u64;
    }

    fn look(&mut self, apart: [f64; 2]) {
        let world = &self.numbered.world;
        let mut poses = DefaultHasher::new();
        world.pose_bits().hash(&mut poses);
        let (mechanics, poses, awake) = (Mechanics::of(world), poses.finish(), awake(world));
        self.samples.push(Sample { mechanics, apart, poses, awake });
        if self.samples.len().is_multiple_of(COMPARED) {
            self.reported += Reported::of(world);
        }
    }
}

/// Returns the pairs of colliders that rapier holds to be in contact.
fn touching(world: &World) -> Vec<[ColliderHandle; 2]> {
    let pairs = world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact);
    pairs.map(|pair| [pair.collider1, pair.collider2]).collect()
}

fn awake(world: &World) -> f64 {
    let dynamic = || world.bodies.iter().filter(|(_, body)| body.is_dynamic());
    let awake = dynamic().filter(|(_, body)| !body.is_sleeping()).count();
    percent(awake as u64, dynamic().count() as u64)
}

/// Steps from one comparison with brute force to the next.
const COMPARED: usize = 20;

/// Runs all ways through a scene, in turn step by step.
pub(super) fn simulated(case: SceneCase) -> Result<Vec<VariantRun>, Failure> {
    let scene = Numbered::new(world(case)?);
    let mut sides: Vec<VariantRun> = ways().into_iter().map(|way| VariantRun::new(way, &scene)).collect();
    for step in 0..case.2 {
        let count = sides.len();
        (0..count).for_each(|place| sides[(step + place) % count].step());
        let apart: Vec<_> = sides.iter().map(|side| sides[0].numbered.apart(&side.numbered)).collect();
        sides.iter_mut().zip(apart).for_each(|(side, apart)| side.look(apart));
    }
    Ok(sides)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sleeping_bodies_and_touching_pairs_that_end_are_counted() {
        let pbig = ways().into_iter().find(Variant::is_pbig).expect("a way");
        let mut side = VariantRun::new(pbig, &Numbered::new(world(("pile", 8, 0)).expect("a scene")));
        for _ in 0..200 {
            side.step();
            side.look([0.0; 2]);
        }
        assert_eq!((side.samples[0].awake, side.samples[199].awake, side.parted), (100.0, 0.0, 0));
        let touched = touching(&side.numbered.world).len();
        let top = &mut side.numbered.world.bodies[side.numbered.bodies[7]];
        top.set_translation(vector![0.0, 90.0, 0.0], true);
        side.step();
        side.look([0.0; 2]);
        let parted = touched - touching(&side.numbered.world).len();
        assert_eq!((side.parted, parted > 0), (parted as u64, true), "{touched} touched");
        assert!(side.samples[200].awake > 0.0);
    }

    /// With rapier's own broad phase no two runs are the same.
    fn stepped(mut one: Numbered) -> Numbered {
        let mut broad_phase = PbigBroadPhase::new();
        (0..90).for_each(|_| one.world.step(&mut broad_phase));
        one
    }

    #[test]
    fn the_old_order_gives_the_same_world_and_another_does_not() {
        for name in ["column", "ragdolls", "compounds"] {
            let scene = || Numbered::new(Scene::named(name).expect("a scene").build(40, 1));
            let (original, other) = (scene(), scene().inserted(Some(1)));
            assert_eq!(other.world.impulse_joints.len(), original.world.impulse_joints.len());
            assert_eq!(other.apart(&original), [0.0; 2]);
            assert_ne!(other.world.pose_bits(), original.world.pose_bits(), "the order of handles");
            let (copy, original) = (stepped(original.inserted(None)), stepped(original));
            assert_eq!(copy.world.pose_bits(), original.world.pose_bits(), "{name}");
            assert!(stepped(other).apart(&original)[1] > 0.0, "{name}");
        }
    }
}

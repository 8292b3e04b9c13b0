//! Random operations on small worlds: each update is compared with rapier's own broad phase and with brute force.
//!
//! Each run is named by its seed. `PBIG_RUNS=20000` plays more runs (about 10^6 operations).

mod ask;
mod planted;

use glam::Vec3;
use pbig_harness_036::build::world_of;
use pbig_harness_036::dimension::{cuboid, joint, soft_cube};
use pbig_harness_036::world::{from_bytes, ground, groups_that_meet, real, to_bytes, to_vector, turned};
use pbig_scenes::plan::JointKind;
use pbig_scenes::scenes::Scene;
use planted::{BUSY, Plant, Planted};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rapier::geometry::PairFinder;
use rapier::prelude::*;
use rapier_pbig::shadow::{Shadow, Shadowed};
use rapier_pbig::{PbigConfig, PbigFinder};
use std::any::Any;
use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Operations in a run.
const OPS: usize = 60;

/// A world under random operations.
struct Player {
    world: PhysicsWorld,
    rng: StdRng,
    is_adaptive: bool,
    plant: Plant,
}

/// Counts of what happened.
#[derive(Default)]
struct Tally {
    steps: u64,
    compared: u64,
    oracle_pairs: u64,
    contacts: u64,
    queries: u64,
    /// Rays that hit, of those that were compared.
    hits: u64,
    restores: u64,
    soft: u64,
    /// Runs that a panic of rapier's has cut short: it panics at a joint between bodies of which none is dynamic any more.
    cut_short: u64,
}

type Subject = Shadowed<Planted>;

fn subject(plant: Plant) -> Subject {
    let planted = Planted { finder: PbigFinder::default(), plant, known: HashSet::new() };
    Shadowed::new(planted, PbigConfig::DEFAULT.margin).with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle)
}

fn subject_in(world: &PhysicsWorld) -> &Subject {
    let finder = world.broad_phase.pair_finder().expect("it is installed") as &dyn Any;
    finder.downcast_ref().expect("it is ours")
}

impl Player {
    fn new(seed: u64, plant: Plant) -> Self {
        let (mut world, mut rng) = (PhysicsWorld::new(), StdRng::seed_from_u64(seed));
        rapier_pbig::install_finder(&mut world.broad_phase, subject(plant));
        world.colliders.insert(ground());
        world.integration_parameters.max_ccd_substeps = rng.random_range(0..4);
        let is_adaptive = rng.random_range(0..4) == 0;
        world.broad_phase.adaptive_change_detection_margin = is_adaptive;
        Self { world, rng, is_adaptive, plant }
    }

    fn place(&mut self) -> Vec3 {
        let mut along = |low: f32, high: f32| self.rng.random_range(low..high);
        Vec3::new(along(-3.0, 3.0), along(0.3, 5.0), along(-3.0, 3.0))
    }

    fn collider(&mut self) -> ColliderBuilder {
        let half = self.rng.random_range(0.1..0.9);
        let shape = match self.rng.random_range(0..4) {
            0 => ColliderBuilder::ball(real(half)),
            1 => ColliderBuilder::new(cuboid(Vec3::new(half, 0.2, half))),
            2 => ColliderBuilder::capsule_y(real(half), 0.2),
            _ => ColliderBuilder::new(cuboid(Vec3::splat(half))),
        };
        let groups = self.groups();
        let types = [ActiveCollisionTypes::default(), ActiveCollisionTypes::all()];
        let types = types[self.rng.random_range(0..2)];
        let is_sensor = self.rng.random_range(0..6) == 0;
        shape.sensor(is_sensor).collision_groups(groups).active_collision_types(types)
    }

    fn groups(&mut self) -> InteractionGroups {
        let own = [Group::GROUP_1, Group::GROUP_2, Group::ALL][self.rng.random_range(0..3)];
        let mask = [Group::ALL, Group::GROUP_1][self.rng.random_range(0..2)];
        groups_that_meet(own, mask)
    }

    fn body(&mut self) -> RigidBodyBuilder {
        let at = self.place();
        let body = match self.rng.random_range(0..6) {
            0 => RigidBodyBuilder::fixed(),
            1 => RigidBodyBuilder::kinematic_velocity_based().linvel(to_vector(Vec3::X)),
            _ => RigidBodyBuilder::dynamic(),
        };
        let fast = Vec3::new(self.rng.random_range(-30.0..30.0), -20.0, 0.0);
        let speed = if self.rng.random_range(0..4) == 0 { fast } else { Vec3::ZERO };
        let soft_ccd = if self.rng.random_range(0..6) == 0 { 0.5 } else { 0.0 };
        let turn = glam::Quat::from_rotation_z(self.rng.random_range(-3.0..3.0));
        let body = body.pose(turned(at, turn)).linvel(to_vector(speed));
        body.soft_ccd_prediction(soft_ccd).ccd_enabled(self.rng.random_range(0..3) == 0)
    }

    fn any_body(&mut self) -> Option<RigidBodyHandle> {
        let bodies: Vec<_> = self.world.bodies.iter().filter(|(_, body)| !body.is_soft_frame()).collect();
        let count = bodies.len();
        (count > 0).then(|| bodies[self.rng.random_range(0..count)].0)
    }

    fn any_collider(&mut self) -> Option<ColliderHandle> {
        let handles: Vec<_> = self.world.colliders.iter().map(|(handle, _)| handle).collect();
        (!handles.is_empty()).then(|| handles[self.rng.random_range(0..handles.len())])
    }

    fn play(&mut self, tally: &mut Tally) {
        let op = self.rng.random_range(0..28);
        let (body, collider) = (self.any_body(), self.any_collider());
        let (Some(body), Some(collider)) = (body, collider) else { return self.add() };
        let is_soft = self.world.colliders[collider]
            .parent()
            .is_some_and(|parent| self.world.bodies.get(parent).is_some_and(RigidBody::is_soft_frame));
        match op {
            0..5 => self.add(),
            5 => _ = self.world.remove_body(body),
            6 if !is_soft => _ = self.world.remove_collider(collider),
            7 => self.world.bodies[body].set_enabled(false),
            8 => self.world.bodies[body].set_enabled(true),
            9 if !is_soft => self.world.colliders[collider].set_enabled(false),
            10 => self.world.colliders[collider].set_enabled(true),
            11 => {
                let at = to_vector(self.place());
                self.world.bodies[body].set_translation(at, true);
            }
            12 if !is_soft => {
                let PhysicsWorld { colliders, bodies, .. } = &mut self.world;
                colliders.set_parent(collider, Some(body), bodies);
            }
            // Rapier panics at a joint between bodies of which none is dynamic.
            13 if self.world.impulse_joints.attached_joints(body).next().is_none() => {
                let kinds =
                    [RigidBodyType::Fixed, RigidBodyType::Dynamic, RigidBodyType::KinematicPositionBased];
                let kind = kinds[self.rng.random_range(0..3)];
                self.world.bodies[body].set_body_type(kind, true);
            }
            14 => {
                let groups = self.groups();
                self.world.colliders[collider].set_collision_groups(groups);
            }
            15 => self.join(body),
            16 => self.query(tally),
            17 => self.restore(tally),
            18 if self.rng.random_range(0..8) == 0 => {
                let at = self.place();
                self.world.insert_soft_body(soft_cube(at, 0.5).particle_mass(0.2));
                tally.soft += 1;
            }
            19 => {
                let types = [ActiveCollisionTypes::empty(), ActiveCollisionTypes::all()];
                let types = types[self.rng.random_range(0..2)];
                self.world.colliders[collider].set_active_collision_types(types);
            }
            20 if !is_soft => self.reshape(collider),
            21 => {
                let is_sensor = self.rng.random_range(0..2) == 0;
                self.world.colliders[collider].set_sensor(is_sensor);
            }
            22 => _ = self.world.remove_body_with_colliders(body, false),
            23 => self.tell_aabb(collider),
            24 => self.replace_by_clone(),
            25 => self.change_margin(),
            26 if self.rng.random_range(0..4) == 0 => self.go_on_with_the_tree(),
            _ => self.quarantine_test(body),
        }
    }

    fn reshape(&mut self, collider: ColliderHandle) {
        let (size, skin) = (self.rng.random_range(0.1..1.5), self.rng.random_range(0.0..0.2));
        let collider = &mut self.world.colliders[collider];
        collider.set_shape(cuboid(Vec3::new(size, 0.3, size)));
        collider.set_contact_skin(real(skin));
    }

    fn add(&mut self) {
        let (body, collider) = (self.body(), self.collider());
        self.world.insert(body, collider);
    }

    fn join(&mut self, body: RigidBodyHandle) {
        let other = self.any_body().filter(|&other| other != body);
        if let Some(other) =
            other.filter(|&other| [body, other].iter().all(|&one| self.world.bodies[one].is_dynamic()))
        {
            self.world.impulse_joints.insert(body, other, joint(JointKind::Socket(1.0)), true);
        }
    }

    /// A query between steps finds each collider that the finder knows by its own AABB.
    fn query(&mut self, tally: &mut Tally) {
        let (queries, (boxes, _)) = (self.world.query_pipeline(), subject_in(&self.world).state());
        for (handle, aabb) in boxes {
            let found = queries.intersect_aabb_conservative(aabb).any(|(found, _)| found == handle);
            assert!(found || !self.world.colliders.contains(handle), "{handle:?} at {aabb:?}");
            tally.queries += 1;
        }
    }

    /// Right after a step all boxes hold their colliders; else, or with a planted fault, answers depend on the order of visits.
    fn ask(&mut self, tally: &mut Tally) {
        if self.plant == Plant::Nothing {
            BUSY.set(true);
            tally.hits += ask::compare(&self.world, &mut self.rng);
            BUSY.set(false);
        }
    }

    /// Saves and restores the world. Half the time its tree goes on for a step before pbig takes over again.
    fn restore(&mut self, tally: &mut Tally) {
        self.world = from_bytes(&to_bytes(&self.world));
        self.world.broad_phase.adaptive_change_detection_margin = self.is_adaptive;
        if self.rng.random_range(0..2) == 0 {
            self.world.step();
        }
        rapier_pbig::install_finder(&mut self.world.broad_phase, subject(self.plant));
        tally.restores += 1;
    }

    /// An app may tell the AABB of a collider before the step; a query must find it there.
    fn tell_aabb(&mut self, collider: ColliderHandle) {
        self.world.colliders[collider].set_enabled(true);
        let PhysicsWorld { integration_parameters: params, bodies, colliders, broad_phase, .. } =
            &mut self.world;
        let one = &colliders[collider];
        let aabb = one.compute_broad_phase_aabb(params, bodies);
        if !(one.is_enabled() && aabb.mins.is_finite() && aabb.maxs.is_finite()) {
            return;
        }
        broad_phase.set_aabb(params, collider, aabb);
        let queries = self.world.query_pipeline();
        assert!(
            queries.intersect_aabb_conservative(aabb).any(|(found, _)| found == collider),
            "{collider:?}"
        );
    }

    fn replace_by_clone(&mut self) {
        self.world.broad_phase = self.world.broad_phase.clone();
    }

    /// Changes what the margin depends on. Margins only grow: with a smaller one, older boxes would have pairs that it excludes.
    fn change_margin(&mut self) {
        if self.rng.random_range(0..2) == 0 {
            self.is_adaptive = true;
            self.world.broad_phase.adaptive_change_detection_margin = true;
        } else {
            self.world.integration_parameters.length_unit *= 1.25;
        }
    }

    /// Rapier's tree finds the pairs of a step, then pbig again.
    fn go_on_with_the_tree(&mut self) {
        rapier_pbig::uninstall(&mut self.world.broad_phase);
        self.world.step();
        rapier_pbig::install_finder(&mut self.world.broad_phase, subject(self.plant));
    }

    /// Gives a body a velocity of NaN. Rapier disables such a body.
    fn quarantine_test(&mut self, body: RigidBodyHandle) {
        if self.rng.random_range(0..10) == 0 {
            self.world.bodies[body].set_linvel(to_vector(Vec3::new(f32::NAN, 0.0, 0.0)), true);
        }
    }

    fn check(&self, seed: u64) -> Result<(), String> {
        let subject = subject_in(&self.world);
        match (&subject.checker.differences[..], subject.inner.finder.last_error()) {
            ([], None) => Ok(()),
            ([first, ..], _) => Err(format!("seed {seed}: {first}")),
            (_, Some(error)) => Err(format!("seed {seed}: {error}")),
        }
    }
}

fn run(seed: u64, plant: Plant, tally: &mut Tally) -> Result<(), String> {
    let mut player = Player::new(seed, plant);
    for _ in 0..OPS {
        let mut play = || {
            player.play(tally);
            if player.rng.random_range(0..2) == 0 {
                player.world.step();
                tally.steps += 1;
                player.ask(tally);
            }
        };
        if let Err(panic) = catch_unwind(AssertUnwindSafe(&mut play)) {
            if BUSY.get() {
                resume_unwind(panic);
            }
            tally.cut_short += 1;
            return Ok(());
        }
        player.check(seed)?;
    }
    let checker = &subject_in(&player.world).checker;
    tally.compared += checker.compared as u64;
    tally.oracle_pairs += checker.oracle_pairs;
    tally.contacts += player.world.narrow_phase.contact_pairs().count() as u64;
    Ok(())
}

#[test]
fn random_worlds_have_the_oracles_pairs_and_stocks_contacts() {
    let runs = std::env::var("PBIG_RUNS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(300);
    let mut tally = Tally::default();
    for seed in 0..runs {
        run(seed, Plant::Nothing, &mut tally).unwrap_or_else(|difference| panic!("{difference}"));
    }
    let Tally { steps, compared, oracle_pairs, contacts, queries, hits, restores, soft, cut_short } = tally;
    println!(
        "{steps} steps, {compared} compared, {oracle_pairs} pairs, {contacts} contacts, {queries} queries, {hits} hits, {restores} restores, {soft} soft, {cut_short} cut short"
    );
    assert!(compared > 5 * runs && oracle_pairs > 10 * runs && contacts > runs);
    assert!(
        queries > runs && hits > 10 * runs && restores > runs && soft > runs / 20 && cut_short < runs / 5
    );
}

#[test]
fn planted_faults_are_noticed() {
    for plant in [Plant::Unmoved, Plant::RoomForTwo, Plant::OnlyNew] {
        let noticed = (0..40).filter(|&seed| run(seed, plant, &mut Tally::default()).is_err()).count();
        assert!(noticed >= 10, "{plant:?}: {noticed} of 40");
    }
}

#[test]
fn every_scene_answers_in_each_frame_as_rapiers_tree_does() {
    let mut hits = 0;
    for scene in Scene::ALL {
        let mut world = world_of(&scene.plan(250, 1), rapier_pbig::broad_phase());
        let mut rng = StdRng::seed_from_u64(1);
        for _ in 0..60 {
            world.step();
            hits += ask::compare(&world, &mut rng);
        }
    }
    assert!(hits > 100, "{hits}");
}

//! An app that keeps its physics in a struct: the type of a field changes. Scene queries stay, a snapshot contains the broad
//! phase, and a new broad phase adopts a running world. `cargo run --release --example existing_app`

use rapier_pbig::PbigBroadPhase;
use rapier3d::parry::query::DefaultQueryDispatcher;
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

#[derive(Default, Serialize, Deserialize)]
struct Physics {
    broad_phase: PbigBroadPhase, // was: DefaultBroadPhase
    params: IntegrationParameters,
    islands: IslandManager,
    narrow_phase: NarrowPhase,
    bodies: RigidBodySet,
    colliders: ColliderSet,
    impulse_joints: ImpulseJointSet,
    multibody_joints: MultibodyJointSet,
    ccd_solver: CCDSolver,
    #[serde(skip)]
    pipeline: PhysicsPipeline,
}

impl Physics {
    fn step(&mut self) {
        self.pipeline.step(
            &vector![0.0, -9.81, 0.0],
            &self.params,
            &mut self.islands,
            &mut self.broad_phase,
            &mut self.narrow_phase,
            &mut self.bodies,
            &mut self.colliders,
            &mut self.impulse_joints,
            &mut self.multibody_joints,
            &mut self.ccd_solver,
            &(),
            &(),
        );
    }

    fn height_of_pile(&self) -> Option<f32> {
        let (bodies, colliders, filter) = (&self.bodies, &self.colliders, QueryFilter::default());
        let queries = self.broad_phase.as_query_pipeline(&DefaultQueryDispatcher, bodies, colliders, filter);
        let down = Ray::new(point![0.1, 100.0, 0.1], -Vector::y());
        queries.cast_ray(&down, 200.0, true).map(|(_, distance)| 100.0 - distance)
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut game = Physics::default();
    game.colliders.insert(ColliderBuilder::halfspace(Vector::y_axis()));
    let mut top = RigidBodyHandle::invalid();
    for i in 0..100 {
        let at = vector![(i % 5) as f32, 0.6 + (i / 25) as f32, (i / 5 % 5) as f32];
        top = game.bodies.insert(RigidBodyBuilder::dynamic().translation(at));
        game.colliders.insert_with_parent(ColliderBuilder::cuboid(0.4, 0.4, 0.4), top, &mut game.bodies);
    }
    (0..120).for_each(|_| game.step());
    let height = game.height_of_pile().ok_or("the ray misses the pile")?;
    assert!((height - 3.2).abs() < 0.05, "four layers of 0.8 are 3.2 high, but a ray says {height}");

    let saved = postcard::to_stdvec(&game)?;
    let mut restored: Physics = postcard::from_bytes(&saved)?;
    [&mut game, &mut restored].into_iter().for_each(|world| (0..60).for_each(|_| world.step()));
    assert_eq!(postcard::to_stdvec(&game.bodies)?, postcard::to_stdvec(&restored.bodies)?, "a second later");
    // As in an app that switches broad phases in mid-game, or reads a snapshot of a world that had another one.
    let pairs = |world: &Physics| world.narrow_phase.contact_pairs().count();
    let before = pairs(&game);
    game.broad_phase = PbigBroadPhase::new();
    game.broad_phase.adopt(&game.narrow_phase);
    for world in [&mut game, &mut restored] {
        world.bodies[top].set_translation(vector![0.0, 50.0, 0.0], true);
        world.step();
    }
    assert_eq!([&game, &restored].map(pairs), [before - 1; 2], "the pair of the cube that left has ended");
    println!("{height:.3} m high; {} bytes saved; {before} pairs, then {}", saved.len(), pairs(&game));
    Ok(())
}

//! Every scene beside rapier's own broad phase and the oracle. `PBIG_BODIES=80` makes smaller worlds.

use pbig_harness_036::build::world_of;
use pbig_scenes::scenes::Scene;
use rapier::prelude::BroadPhaseBvh;
use rapier_pbig::PbigFinder;
use rapier_pbig::shadow::{Shadow, checker};

#[test]
fn every_scene_has_the_oracles_pairs_and_stocks_contacts() {
    let bodies = std::env::var("PBIG_BODIES").ok().and_then(|bodies| bodies.parse().ok()).unwrap_or(250);
    for scene in Scene::ALL {
        let mut world = world_of(&scene.plan(bodies, 1), BroadPhaseBvh::new());
        let finder = PbigFinder::default().with_shadow(Shadow::Stock).with_shadow(Shadow::Oracle);
        rapier_pbig::install_finder(&mut world.broad_phase, finder.every(3));
        for _ in 0..150 {
            world.step();
        }
        let finder = rapier_pbig::finder(&world.broad_phase).expect("it is installed");
        let checker = checker(&world.broad_phase).expect("it was added");
        assert!(checker.differences.is_empty(), "{}: {}", scene.name, checker.differences[0]);
        assert!(checker.compared > 5, "{}: {}", scene.name, checker.compared);
        assert!(checker.oracle_pairs > 0 && checker.has_stock(), "{}", scene.name);
        assert!(finder.last_error().is_none());
    }
}

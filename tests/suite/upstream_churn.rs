//! More of rapier's old bugs (see `upstream`): colliders that come and go, the `CollisionPipeline`, positions that are none.

use crate::checked::{Checked, backends, everywhere, pbig};
use crate::upstream::{collide, loud, touching};
use rapier3d::prelude::*;

#[test]
fn upstream_342_343_removed_before_the_collision_pipeline_runs() {
    everywhere(|mut scene| {
        let gone = scene.world.colliders.insert(loud(0.0));
        for x in [0.9, 50.0, 60.0] {
            scene.world.colliders.insert(loud(x));
        }
        scene.world.remove_collider(gone);
        assert!(collide(&mut scene).is_empty());
        let gone = scene.world.colliders.insert(loud(0.0));
        scene.world.remove_collider(gone);
        let reusing = scene.world.colliders.insert(loud(0.1));
        assert_eq!(reusing.into_raw_parts().0, gone.into_raw_parts().0, "the index is reused");
        assert_eq!(collide(&mut scene), [true]);
    });
}

#[test]
fn the_collision_pipeline_sees_motion_between_its_calls() {
    everywhere(|mut scene| {
        let [moving, ..] = [0.0, 2.0, 4.0].map(|x| scene.world.colliders.insert(loud(x)));
        assert!(collide(&mut scene).is_empty());
        let path: [(f32, &[bool]); 5] =
            [(1.2, &[true]), (2.9, &[]), (3.2, &[false, true]), (50.0, &[false]), (1.2, &[true])];
        for (x, events) in path {
            scene.world.colliders[moving].set_translation(vector![x, 0.0, 0.0]);
            assert_eq!(collide(&mut scene), events, "at {x}");
        }
    });
}

#[test]
fn upstream_281_617_indices_and_pairs_stay_few_under_churn() {
    everywhere(|mut scene| {
        let mut row: Vec<_> = (0..40).map(|i| scene.ball(0.9 * i as f32)).collect();
        assert_eq!(scene.step(), 39);
        let bytes =
            |scene: &Checked| postcard::to_stdvec(&scene.broad_phase.inner).expect("a snapshot").len();
        let mut sizes = Vec::new();
        for round in 0..100 {
            // Every other ball is replaced by a new one in its place: 2000 in all.
            for i in (round % 2..40).step_by(2) {
                scene.world.remove(row[i].0);
                row[i] = scene.ball(0.9 * i as f32);
            }
            assert_eq!((scene.step(), touching(&scene)), (39, 39), "round {round}");
            sizes.push(bytes(&scene));
        }
        // Generations above 127 take another byte.
        assert!(sizes[50..].iter().all(|size| *size == sizes[50]), "{sizes:?}");
        assert!(row.iter().all(|(_, collider)| collider.into_raw_parts().0 < 40), "indices are reused");
        let colliders = &scene.world.colliders;
        let live =
            |pair: ColliderPair| colliders.contains(pair.collider1) && colliders.contains(pair.collider2);
        assert!(scene.broad_phase.inner.pairs().all(live), "pairs have the present generation");
    });
}

#[test]
fn upstream_865_all_are_removed_and_as_many_added_in_one_step() {
    let place = |scene: &mut Checked| -> Vec<_> { (0..300).map(|i| scene.ball(0.9 * i as f32).0).collect() };
    everywhere(|mut scene| {
        let mut row = place(&mut scene);
        assert_eq!(scene.step(), 299);
        for backwards in [false, true, false] {
            if backwards {
                row.reverse();
            }
            row.iter().for_each(|body| scene.world.remove(*body));
            row = place(&mut scene);
            assert_eq!((scene.step(), touching(&scene)), (299, 299));
        }
        row.iter().for_each(|body| scene.world.remove(*body));
        assert_eq!((scene.step(), scene.contacts()), (0, 0));
    });
}

#[test]
fn upstream_350_an_infinite_position_has_no_pairs_until_mended() {
    for (name, config) in backends() {
        let (params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
        let (mut broad_phase, mut colliders) = (pbig(config), ColliderSet::new());
        let handles = [0.0, 0.9, 1.8].map(|x| colliders.insert(loud(x)));
        // Without a narrow phase and without stock, which cannot bear it.
        let mut at = |x: f32| {
            colliders[handles[1]].set_translation(vector![x, 0.0, 0.0]);
            broad_phase.update(&params, &colliders, &bodies, &handles, &[], &mut Vec::new());
            (broad_phase.pair_count(), broad_phase.stats().report.invalid)
        };
        for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
            assert_eq!(at(0.9), (2, 0), "{name}, before {x}");
            assert_eq!(at(x), (0, u64::from(x.is_nan())), "{name}, at {x}");
            assert_eq!(at(x), (0, u64::from(x.is_nan())), "{name}, still at {x}");
        }
        assert_eq!(at(0.9), (2, 0), "{name}, mended");
    }
}

//! Each checker notices the faults it is for: a dropped, a doubled, a swapped and a spurious pair.

use pbig_core::{Aabb, Pair, ProxyFilter, oracle};
use pbig_harness::follower::Follower;
use pbig_harness::runner::{Run, Timed};
use pbig_harness::scenes::Scene;
use pbig_tests::{difference, set};
use rapier_pbig::shadow::Fault;
use rapier_pbig::{PbigBroadPhase, PbigConfig};
use rapier3d::prelude::BroadPhasePairEvent::{AddPair, DeletePair};
use rapier3d::prelude::*;

#[test]
fn the_comparison_with_the_oracle_notices_each_fault() {
    let boxes = set("unit", 200, 1);
    let right = oracle::pairs(&boxes);
    assert_eq!(difference(&right, &right), None);
    let noticed = |change: &dyn Fn(&mut Vec<Pair>)| {
        let mut wrong = right.clone();
        change(&mut wrong);
        difference(&wrong, &right).expect("the fault is noticed")
    };
    assert!(noticed(&|pairs| _ = pairs.remove(7)).starts_with("missing"));
    assert!(noticed(&|pairs| pairs.insert(7, pairs[7])).starts_with("twice"));
    assert!(noticed(&|pairs| pairs.swap(3, 4)).starts_with("out of order"));
    assert!(noticed(&|pairs| (pairs[5].a, pairs[5].b) = (pairs[5].b, pairs[5].a)).contains("not a < b"));
    assert!(noticed(&|pairs| pairs.push(Pair { a: 198, b: 5000 })).starts_with("spurious"));
}

#[test]
fn the_follower_notices_an_event_that_it_never_got() {
    // A pair that began unseen, and one that ended unseen.
    for path in [[5.0, 0.3], [0.3, 5.0]] {
        let mut world = Follower::new(pbig_core::BroadPhase::default(), 2);
        let put = |world: &mut Follower, id, x| {
            world.set(id, Aabb::from_center([x, 0.0, 0.0], [0.2; 3]), ProxyFilter::ALL).expect("a small id");
        };
        put(&mut world, 0, 0.0);
        put(&mut world, 1, path[0]);
        assert_eq!(world.update(), Ok(()));
        put(&mut world, 1, path[1]);
        world.broad_phase.update().expect("few pairs");
        assert!(world.update().is_err_and(|why| why.contains("against the oracle")), "{path:?}");
    }
}

/// Returns what is sent instead of an event of a pair. The other pair is far from the first.
type Falsify = fn(ColliderPair, ColliderPair) -> Vec<BroadPhasePairEvent>;

/// Ours, with a fault in the hundredth added or deleted pair.
struct Faulty {
    inner: PbigBroadPhase,
    is_add: bool,
    falsify: Falsify,
    seen: usize,
}

impl BroadPhase for Faulty {
    fn update(
        &mut self,
        params: &IntegrationParameters,
        colliders: &ColliderSet,
        bodies: &RigidBodySet,
        modified: &[ColliderHandle],
        removed: &[ColliderHandle],
        events: &mut Vec<BroadPhasePairEvent>,
    ) {
        let mut right = Vec::new();
        self.inner.update(params, colliders, bodies, modified, removed, &mut right);
        // The first and the last object of a column never meet.
        let handle = |index: usize| ColliderHandle::from_raw_parts(index as u32, 0);
        let far = ColliderPair::new(handle(1), handle(colliders.len() - 1));
        for event in right {
            let (is_add, pair) = match event {
                AddPair(pair) => (true, pair),
                DeletePair(pair) => (false, pair),
            };
            self.seen += usize::from(is_add == self.is_add);
            let is_hundredth = is_add == self.is_add && self.seen == 100;
            events.extend(if is_hundredth { (self.falsify)(pair, far) } else { vec![event] });
        }
    }
}

#[test]
fn the_shadow_checker_notices_each_fault_and_writes_the_frames() {
    let folder = tempfile::tempdir().expect("a folder");
    let plants: [(&str, bool, Falsify, Fault); 8] = [
        ("not added", true, |_, _| vec![], Fault::Missing),
        ("added twice", true, |pair, _| vec![AddPair(pair), AddPair(pair)], Fault::AddedTwice),
        ("added both ways", true, |pair, _| vec![AddPair(pair), AddPair(pair.swap())], Fault::AddedTwice),
        ("not deleted", false, |_, _| vec![], Fault::Spurious),
        ("deleted at once", true, |pair, _| vec![AddPair(pair), DeletePair(pair)], Fault::Missing),
        ("flickers", true, |pair, _| vec![AddPair(pair), DeletePair(pair), AddPair(pair)], Fault::Flickered),
        ("deleted unknown", true, |pair, far| vec![DeletePair(far), AddPair(pair)], Fault::DeletedUnknown),
        ("far apart", true, |pair, far| vec![AddPair(pair), AddPair(far)], Fault::Spurious),
    ];
    for (what, is_add, falsify, fault) in plants {
        let scene = Scene::named("column").expect("the scene exists");
        let faulty = Faulty { inner: PbigBroadPhase::new(), is_add, falsify, seen: 0 };
        let mut run = Run::new(scene, 300, 1, faulty).checked(PbigConfig::DEFAULT.margin, 1);
        run.steps(300, || ());
        let first = run.broad_phase.first_difference().unwrap_or_else(|| panic!("{what}: not noticed"));
        assert_eq!(first.fault, fault, "{what}: {first}");
        let file = run.write_failure("column", folder.path()).expect("it failed").expect("a writable folder");
        let frames = pbig_harness::files::read_frames(&file).expect("a replayable file");
        assert_eq!(frames.boxes, 301, "one box for each collider");
    }
}

#[test]
fn the_shadow_checker_notices_a_collider_paired_with_itself() {
    let world = Scene::named("column").expect("the scene exists").build(300, 1);
    let handles: Vec<ColliderHandle> = world.colliders.iter().map(|(handle, _)| handle).collect();
    let falsify: Falsify = |pair, _| vec![AddPair(ColliderPair::new(pair.collider1, pair.collider1))];
    let faulty = Faulty { inner: PbigBroadPhase::new(), is_add: true, falsify, seen: 99 };
    let mut shadow = Timed::new(faulty).checked(PbigConfig::DEFAULT.margin, 1);
    // Without a narrow phase, which would panic. Large boxes, so that there are pairs at once.
    let params = IntegrationParameters { normalized_prediction_distance: 1.0, ..world.params };
    shadow.update(&params, &world.colliders, &world.bodies, &handles, &[], &mut Vec::new());
    assert_eq!(shadow.first_difference().map(|d| d.fault), Some(Fault::WithItself));
}

#[test]
fn the_oracle_itself_is_checked_by_hand() {
    let boxes = [[0.0, 1.0], [1.0, 2.0], [2.5, 3.0]].map(|[low, high]| Aabb::new([low; 3], [high; 3]));
    assert_eq!(oracle::pairs(&boxes), [Pair::new(0, 1)]);
    let filters = |count| vec![ProxyFilter::ALL; count];
    assert_eq!(oracle::pairs_filtered(&boxes, &filters(2)), [Pair::new(0, 1)]);
    assert_eq!(oracle::pairs_filtered(&boxes, &filters(1)), [], "a box without a filter pairs with nothing");
}

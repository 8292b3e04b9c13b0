//! Each checker notices the faults it is for: a dropped, a doubled, a swapped and a spurious pair.

use pbig_core::{Aabb, Pair, oracle};
use pbig_harness::runner::{Run, Timed};
use pbig_harness::scenes::Scene;
use pbig_tests::{difference, set};
use rapier_pbig::shadow::Fault;
use rapier_pbig::{PbigBroadPhase, PbigConfig};
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

/// The fault of a broad phase in one of its events.
#[derive(Clone, Copy, Debug)]
enum Plant {
    DropAdd,
    DoubleAdd,
    SwappedDoubleAdd,
    DropDelete,
    DeleteLive,
    Flicker,
    DeleteUnknown,
    AddFar,
    WithItself,
}

/// Ours, with a fault in the hundredth event of a kind.
struct Faulty {
    inner: PbigBroadPhase,
    plant: Plant,
    seen: usize,
}

fn copy(event: &BroadPhasePairEvent) -> BroadPhasePairEvent {
    match event {
        BroadPhasePairEvent::AddPair(pair) => BroadPhasePairEvent::AddPair(*pair),
        BroadPhasePairEvent::DeletePair(pair) => BroadPhasePairEvent::DeletePair(*pair),
    }
}

impl Faulty {
    fn falsify(&mut self, event: &BroadPhasePairEvent, far: ColliderPair, to: &mut Vec<BroadPhasePairEvent>) {
        use BroadPhasePairEvent::{AddPair, DeletePair};
        let of_kind = match (self.plant, event) {
            (Plant::DropDelete, DeletePair(pair)) => Some(*pair),
            (Plant::DropDelete, AddPair(_)) | (_, DeletePair(_)) => None,
            (_, AddPair(pair)) => Some(*pair),
        };
        self.seen += usize::from(of_kind.is_some());
        let Some(pair) = of_kind.filter(|_| self.seen == 100) else {
            return to.push(copy(event));
        };
        let kept = |more: BroadPhasePairEvent| vec![copy(event), more];
        to.extend(match self.plant {
            Plant::DropAdd | Plant::DropDelete => vec![],
            Plant::DoubleAdd => kept(AddPair(pair)),
            Plant::SwappedDoubleAdd => kept(AddPair(pair.swap())),
            Plant::DeleteLive => kept(DeletePair(pair)),
            Plant::Flicker => vec![copy(event), DeletePair(pair), AddPair(pair)],
            Plant::DeleteUnknown => vec![DeletePair(far), copy(event)],
            Plant::AddFar => kept(AddPair(far)),
            // Rapier's narrow phase panics when it is told such a pair: only without one, see below.
            Plant::WithItself => kept(AddPair(ColliderPair::new(pair.collider1, pair.collider1))),
        });
    }
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
        right.iter().for_each(|event| self.falsify(event, far, events));
    }
}

#[test]
fn the_shadow_checker_notices_each_fault_and_writes_the_frames() {
    let folder = tempfile::tempdir().expect("a folder");
    for (plant, faults) in [
        (Plant::DropAdd, &[Fault::Missing][..]),
        (Plant::DoubleAdd, &[Fault::AddedTwice]),
        (Plant::SwappedDoubleAdd, &[Fault::AddedTwice]),
        (Plant::DropDelete, &[Fault::Spurious]),
        (Plant::DeleteLive, &[Fault::Missing]),
        (Plant::Flicker, &[Fault::Flickered]),
        (Plant::DeleteUnknown, &[Fault::DeletedUnknown]),
        (Plant::AddFar, &[Fault::Spurious]),
    ] {
        let scene = Scene::named("column").expect("the scene exists");
        let faulty = Faulty { inner: PbigBroadPhase::new(), plant, seen: 0 };
        let mut run = Run::new(scene, 300, 1, faulty).checked(PbigConfig::DEFAULT.margin, 1);
        run.steps(300, || ());
        let first = run.broad_phase.first_difference();
        let first = first.unwrap_or_else(|| panic!("{plant:?} was not noticed"));
        assert!(faults.contains(&first.fault), "{plant:?}: {first}");
        let file = run.write_failure("column", folder.path()).expect("it failed").expect("a writable folder");
        let frames = pbig_harness::files::read_frames(&file).expect("a replayable file");
        assert_eq!(frames.boxes, 301, "one box for each collider");
    }
}

#[test]
fn the_shadow_checker_notices_a_collider_paired_with_itself() {
    let world = Scene::named("column").expect("the scene exists").build(300, 1);
    let handles: Vec<ColliderHandle> = world.colliders.iter().map(|(handle, _)| handle).collect();
    let faulty = Faulty { inner: PbigBroadPhase::new(), plant: Plant::WithItself, seen: 99 };
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
}

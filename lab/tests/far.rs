//! Far from the origin: the margin of a broad phase covers what rounding to f32 takes off a box, up to `margin x 2^22` away.

use parry3d_f64::bounding_volume::{Aabb as WideAabb, BoundingVolume};
use parry3d_f64::shape::SharedShape as WideShape;
use pbig_core::{Aabb, Backend, Config, Engine, Pair, oracle};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rapier_pbig::{PbigBroadPhase, PbigConfig};
use rapier3d::na::{Isometry3, UnitQuaternion, Vector3};
use rapier3d::prelude::*;

/// A crowd of shapes about 1 in size, as a set of colliders that all may pair.
#[derive(Default)]
struct Crowd {
    colliders: ColliderSet,
    handles: Vec<ColliderHandle>,
    /// The pairs of boxes in f64 at the poses in f32, in order, without those that touch as exactly as f64 tells.
    pairs: Vec<Pair>,
}

impl Crowd {
    fn new(offset: f64, count: usize) -> Self {
        let (mut crowd, mut rng) = (Self::default(), StdRng::seed_from_u64(5));
        let reach = IntegrationParameters::default().prediction_distance() / 2.0;
        let side = 0.5 * (count as f64).cbrt();
        let mut boxes = vec![];
        for i in 0..count {
            let (shape, wide) = shape(i, &mut rng);
            let mut random = |most: f64| Vector3::from_fn(|_, _| rng.random_range(-most..=most));
            let pose = rounded(&Isometry3::new(random(side).add_scalar(offset), random(2.0)));
            boxes.push(wide.compute_aabb(&in_f64(&pose)).loosened(reach.into()));
            let built = ColliderBuilder::new(shape).position(pose);
            let built = built.active_collision_types(ActiveCollisionTypes::all());
            crowd.handles.push(crowd.colliders.insert(built));
        }
        crowd.pairs = pairs(&boxes, (offset + 100.0) * 64.0 * f64::EPSILON);
        crowd
    }

    /// Returns the number of pairs that an update does not report. Ids are in the order of insertion.
    fn missed(&self, broad_phase: &mut PbigBroadPhase) -> usize {
        let (params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
        broad_phase.update(&params, &self.colliders, &bodies, &self.handles, &[], &mut Vec::new());
        let id = |handle: ColliderHandle| handle.into_raw_parts().0;
        let found = broad_phase.pairs().map(|pair| [id(pair.collider1), id(pair.collider2)]);
        let mut found: Vec<Pair> = found.map(|[a, b]| Pair::new(a.min(b), a.max(b))).collect();
        found.sort_unstable();
        self.pairs.iter().filter(|pair| found.binary_search(pair).is_err()).count()
    }
}

/// Returns the `i`-th shape in f32, and the same in f64.
fn shape(i: usize, rng: &mut StdRng) -> (SharedShape, WideShape) {
    let sizes = [0.0; 3].map(|_: f32| rng.random_range(0.2..0.6f32));
    let ([a, b, c], [x, y, z]) = (sizes, sizes.map(f64::from));
    match i % 5 {
        0 => (SharedShape::ball(a), WideShape::ball(x)),
        1 => (SharedShape::cuboid(a, b, c), WideShape::cuboid(x, y, z)),
        2 => (SharedShape::capsule_y(a, b), WideShape::capsule_y(x, y)),
        3 => (SharedShape::cylinder(a, b), WideShape::cylinder(x, y)),
        _ => (SharedShape::cone(a, b), WideShape::cone(x, y)),
    }
}

/// Returns a pose as rapier holds it: every number rounded to the nearest f32.
fn rounded(pose: &Isometry3<f64>) -> Isometry<Real> {
    let rotation = UnitQuaternion::new_unchecked(pose.rotation.into_inner().cast());
    Isometry::from_parts(pose.translation.cast(), rotation)
}

/// Returns a pose as f64 has it: the same position, and a rotation whose norm is 1 in f64 too.
fn in_f64(pose: &Isometry<Real>) -> Isometry3<f64> {
    let rotation = UnitQuaternion::new_normalize(pose.rotation.into_inner().cast());
    Isometry3::from_parts(pose.translation.cast(), rotation)
}

/// Returns the pairs of boxes that overlap by more than `doubt`.
fn pairs(boxes: &[WideAabb], doubt: f64) -> Vec<Pair> {
    let outward = boxes.iter().map(|one| Aabb::from_f64(one.mins.into(), one.maxs.into()));
    let overlap = |pair: &Pair| {
        let [one, other] = [pair.a, pair.b].map(|id| &boxes[id as usize]);
        (one.maxs.inf(&other.maxs) - one.mins.sup(&other.mins)).min()
    };
    let pairs = oracle::pairs(&outward.collect::<Vec<_>>());
    pairs.into_iter().filter(|pair| overlap(pair) > doubt).collect()
}

/// Floats at a distance `x` are at most `x / 2^23` apart, and two of these distances cover what rounding takes off a box.
#[test]
fn far_away_two_ulps_of_margin_miss_nothing_the_default_does() {
    let (mut without, mut pairs) = (0, 0);
    for offset in [1e5, 1e6, 1e7] {
        let crowd = Crowd::new(offset, 3000);
        pairs += crowd.pairs.len();
        without += crowd.missed(&mut PbigBroadPhase::new());
        for engine in [None, Some(Engine::Grid)] {
            let margin = 1.01 * offset as f32 / (1 << 22) as f32;
            let config = Config { backend: Backend::Cpu, engine, margin, ..PbigConfig::DEFAULT.into() };
            let mut ours = PbigBroadPhase::with_core_config(config).expect("a length");
            assert_eq!(crowd.missed(&mut ours), 0, "{engine:?}, {offset} away");
        }
    }
    assert!(without > 10 && pairs > 10_000, "{without} of {pairs}");
}

#[test]
fn up_to_40_km_the_margin_does() {
    for offset in [0.0, 1e3, 1e4, 4.1e4] {
        let crowd = Crowd::new(offset, 3000);
        assert!(crowd.pairs.len() > 5000, "{} pairs", crowd.pairs.len());
        assert_eq!(crowd.missed(&mut PbigBroadPhase::new()), 0, "{offset} away");
    }
}

//! Far from the origin: boxes widened by 2 ulps reach as far as the exact boxes of the shapes at their poses, by 3 as far as
//! those at poses before they were rounded to f32. The margin of a broad phase covers 2 ulps up to `margin x 2^22` away.

use pbig_core::{Aabb, Backend, Config, Engine, Pair};
use pbig_studies::wide::{Layout, Pose, Truth, Wide, doubt, to_f32, to_f64, widened_by_ulps};
use proptest::prelude::*;
use rapier_pbig::{PbigBroadPhase, PbigConfig, collision_aabb};
use rapier3d::prelude::*;

/// Half the prediction distance, as f64 has it.
fn reach(params: &IntegrationParameters) -> f64 {
    f64::from(params.prediction_distance() / 2.0)
}

/// Returns the number of boxes in f64 at these poses that reach beyond the widened boxes in f32 and the next float.
fn beyond(layout: &Layout, poses: &[Pose], colliders: &[Collider], ulps: u32) -> usize {
    let (params, none) = (IntegrationParameters::default(), RigidBodySet::new());
    let exact = layout.boxes(poses, reach(&params));
    let widened = colliders.iter().map(|one| {
        let wide = widened_by_ulps(&collision_aabb(&params, &none, one), one.position(), ulps);
        Aabb::new(wide.min.map(f32::next_down), wide.max.map(f32::next_up))
    });
    let doubt = |wide: &Wide| doubt(wide.max.iter().chain(&wide.min).fold(0.0, |far, x| far.max(x.abs())));
    let is_short =
        |(wide, aabb): &(&Wide, Aabb)| wide.shortfall(aabb).into_iter().any(|short| short > doubt(wide));
    exact.iter().zip(widened).filter(is_short).count()
}

/// As rapier holds a pose whose rotation has become a little too small, as they may.
fn shrunk(pose: &Pose) -> Isometry<f32> {
    let pose = to_f32(pose);
    let rotation = Rotation::new_unchecked(pose.rotation.into_inner() * (1.0 - 1.5 * f32::EPSILON));
    Isometry::from_parts(pose.translation, rotation)
}

/// Shapes of seven kinds, from a thousandth to a thousand in size, anywhere from the origin to 10^8 on each axis.
#[test]
fn two_ulps_cover_poses_in_f32_and_three_those_in_f64() {
    let mut without = 0;
    for (seed, size) in [1e-3, 0.1, 1.0, 30.0, 1e3].into_iter().enumerate() {
        let layout = Layout::crowd(700, size, seed as u64);
        for power in -1..=8 {
            let far = 10f64.powi(power) * (1.0 + 0.37 * seed as f64);
            for offset in [[far; 3], [-far, 0.0, far], [0.0, far, 1.0]] {
                let poses = layout.poses(offset);
                let narrow: Vec<_> = poses.iter().map(shrunk).collect();
                let held: Vec<Pose> = narrow.iter().map(to_f64).collect();
                let colliders = layout.colliders(&narrow);
                let at = format!("size {size}, {offset:?}");
                assert_eq!(beyond(&layout, &held, &colliders, 2), 0, "{at}");
                assert_eq!(beyond(&layout, &poses, &colliders, 3), 0, "{at}, in f64");
                without += beyond(&layout, &held, &colliders, 0);
            }
        }
    }
    assert!(without > 100, "{without}: a box that is short is seen");
}

/// Every magnitude as likely.
fn float() -> impl Strategy<Value = f32> {
    (-1f32..=1.0, -40i32..60).prop_map(|(x, power)| x * 2f32.powi(power))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, ..ProptestConfig::default() })]

    /// Bounds move outward by at least this number of ulps of the bound, and by at most this number of ulps of all that is counted.
    #[test]
    fn bounds_move_outward_by_ulps(
        at in prop::array::uniform3(float()),
        near in prop::array::uniform2(prop::array::uniform3(float())),
        ulps in 0u32..9,
    ) {
        let corner = |pick: fn(f32, f32) -> f32| std::array::from_fn(|k| at[k] + pick(near[0][k], near[1][k]));
        let aabb = Aabb::new(corner(f32::min), corner(f32::max));
        let pose = Isometry::translation(at[0], at[1], at[2]);
        let wide = widened_by_ulps(&aabb, &pose, ulps);
        let size = (0..3).map(|k| (aabb.max[k] - at[k]).abs().max((aabb.min[k] - at[k]).abs())).fold(0.0, f32::max);
        let ulp = |x: f32| f64::from(x.abs()) - f64::from(x.abs().next_down());
        for (k, at) in at.into_iter().enumerate() {
            let least = |bound: f32, sign: f64| (f64::from(bound) + sign * f64::from(ulps) * ulp(bound)) as f32;
            prop_assert!(wide.min[k] <= least(aabb.min[k], -1.0), "{:?} {:?}", aabb, wide);
            prop_assert!(wide.max[k] >= least(aabb.max[k], 1.0), "{:?} {:?}", aabb, wide);
            let counted = f64::from(at.abs()) + 2.0 * f64::from(size);
            let most = f64::from(ulps + 1) * f64::from(f32::EPSILON) * counted + f64::from(ulps) * f64::from(size) / 131_072.0;
            prop_assert!(f64::from(aabb.min[k]) - f64::from(wide.min[k]) <= most);
            prop_assert!(f64::from(wide.max[k]) - f64::from(aabb.max[k]) <= most);
        }
    }
}

/// A crowd of shapes about 1 in size, as a set of colliders that all may pair.
struct Crowd {
    colliders: ColliderSet,
    handles: Vec<ColliderHandle>,
    /// Boxes in f64 at the poses in f32.
    truth: Truth,
}

impl Crowd {
    fn new(offset: f64, count: usize) -> Self {
        let layout = Layout::crowd(count, 1.0, 5);
        let narrow: Vec<_> = layout.poses([offset; 3]).iter().map(to_f32).collect();
        let held: Vec<Pose> = narrow.iter().map(to_f64).collect();
        let boxes = layout.boxes(&held, reach(&IntegrationParameters::default()));
        let mut colliders = ColliderSet::new();
        let all = layout.colliders(&narrow).into_iter();
        let handles = all.map(|mut one| {
            one.set_active_collision_types(ActiveCollisionTypes::all());
            colliders.insert(one)
        });
        Self { handles: handles.collect(), colliders, truth: Truth::of(boxes, doubt(offset + 100.0)) }
    }

    /// Pairs in f64 that an update does not report. Ids are in the order of insertion.
    fn missed(&self, broad_phase: &mut PbigBroadPhase) -> u64 {
        let (params, bodies) = (IntegrationParameters::default(), RigidBodySet::new());
        broad_phase.update(&params, &self.colliders, &bodies, &self.handles, &[], &mut Vec::new());
        let id = |handle: ColliderHandle| handle.into_raw_parts().0;
        let pairs = broad_phase.pairs().map(|pair| [id(pair.collider1), id(pair.collider2)]);
        let mut pairs: Vec<Pair> = pairs.map(|[a, b]| Pair::new(a.min(b), a.max(b))).collect();
        pairs.sort_unstable();
        self.truth.differences(&pairs, 0.0).missed
    }
}

/// Floats at a distance `x` are at most `x / 2^23` apart, and two of these distances cover what rounding takes off a box.
#[test]
fn far_away_two_ulps_of_margin_miss_nothing_the_default_does() {
    let (mut without, mut pairs) = (0, 0);
    for offset in [1e5, 1e6, 1e7] {
        let crowd = Crowd::new(offset, 3000);
        pairs += crowd.truth.pairs.len();
        without += crowd.missed(&mut PbigBroadPhase::new());
        for engine in [None, Some(Engine::Rebuild)] {
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
        assert!(crowd.truth.pairs.len() > 5000, "{} pairs", crowd.truth.pairs.len());
        assert_eq!(crowd.missed(&mut PbigBroadPhase::new()), 0, "{offset} away");
    }
}

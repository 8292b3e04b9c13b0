//! Far from the origin: the margin of a broad phase covers what rounding to f32 takes off a box, up to `margin x 2^22` away.

use pbig_core::{Backend, Config, Engine, Pair};
use pbig_studies::wide::{Layout, Pose, Truth, doubt, to_f32, to_f64};
use rapier_pbig::{PbigBroadPhase, PbigConfig};
use rapier3d::prelude::*;

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
        let reach = IntegrationParameters::default().prediction_distance() / 2.0;
        let boxes = layout.boxes(&held, reach.into());
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

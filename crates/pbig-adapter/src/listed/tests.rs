//! The margin of new colliders of fixed and of sleeping bodies: in f32 and f64, read by one thread and by several, and after a rescan.

use super::*;
use crate::{Groups, Margins, WideAabb, filter_of};
use pbig_core::{Aabb, BroadPhase, Config, TestMode};
use std::marker::PhantomData;

const MARGIN: f32 = 0.1;

/// Colliders on a lattice: in turns fixed, dynamic and asleep, and all listed.
struct Lattice<A> {
    count: usize,
    of: fn([f32; 3]) -> A,
}

impl<A: Bounds> Lattice<A> {
    fn aabb(&self, i: usize) -> A {
        (self.of)([i % 30, i / 30 % 30, i / 900].map(|x| x as f32))
    }

    fn proxy(&self, i: usize) -> (Handle, Proxy<A>) {
        let kind = if i.is_multiple_of(3) { BodyKind::Fixed } else { BodyKind::Dynamic };
        let groups = Groups { memberships: 1, mask: 1, mode: TestMode::And };
        let (aabb, filter) = (self.aabb(i), filter_of(None, kind, 0, groups));
        ((i as u32, 0).into(), Proxy::Enabled { aabb, filter, is_asleep: i % 3 == 2 })
    }
}

impl<A: Bounds> Scene for Lattice<A> {
    type Aabb = A;

    fn collider_count(&self) -> usize {
        self.count
    }

    fn listed_count(&self) -> usize {
        self.count
    }

    fn for_each_listed(&self, range: Range<usize>, mut take: impl FnMut(Handle, Proxy<A>)) {
        range.map(|i| self.proxy(i)).for_each(|(handle, proxy)| take(handle, proxy));
    }

    fn for_each_collider(&self, take: impl FnMut(Handle, Proxy<A>)) {
        self.for_each_listed(0..self.count, take);
    }

    fn removed(&self) -> impl Iterator<Item = (Handle, bool)> {
        std::iter::empty()
    }

    fn size(&self, _: Handle) -> u8 {
        0
    }
}

/// A tree that nobody asks.
struct NoTree<A>(PhantomData<A>);

impl<A> Default for NoTree<A> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<A: Bounds> Tree for NoTree<A> {
    type Aabb = A;

    fn build(_: impl Iterator<Item = (u32, A)> + Clone) -> Self {
        Self(PhantomData)
    }

    fn remove(&mut self, _: &[u32]) {}

    fn update(&mut self, _: impl Iterator<Item = (u32, A)>) {}
}

/// Returns the least and the largest margin of the fixed, of the dynamic and of the sleeping colliders.
fn margins<A: Bounds>(colliders: &Colliders<NoTree<A>>, scene: &Lattice<A>) -> [[f32; 2]; 3] {
    let mut margins = [[f32::MAX, 0.0]; 3];
    for (handle, fat) in colliders.boxes() {
        let i = handle.index as usize;
        let margin = fat.to_f32().max[0] - scene.aabb(i).to_f32().max[0];
        let [least, most] = &mut margins[i % 3];
        (*least, *most) = (least.min(margin), most.max(margin));
    }
    margins
}

fn check<A: Bounds>(of: fn([f32; 3]) -> A, count: usize) {
    let mut scene = Lattice { count, of };
    let core = BroadPhase::new(Config { margin: MARGIN, ..Config::DEFAULT }).expect("a length");
    let mut colliders = Colliders::<NoTree<A>>::new(core);
    let is_common = |[least, most]: [f32; 2]| least > 0.999 * MARGIN && most < 1.001 * MARGIN;
    let margins_of_update = Margins { usual: MARGIN, ..Margins::default() };
    for call in 0..2 {
        colliders.update(&scene, &margins_of_update, |_| panic!("no pair"));
        let all = margins(&colliders, &scene);
        let is_rounding = |[_, most]: [f32; 2]| most < 0.001 * MARGIN;
        assert!(is_rounding(all[0]) && is_common(all[1]) && is_rounding(all[2]), "call {call}: {all:?}");
    }
    // A world with fewer colliders is another one, which is read as a whole.
    scene.count -= 1;
    colliders.update(&scene, &margins_of_update, |_| panic!("no pair"));
    let all = margins(&colliders, &scene);
    assert_eq!(colliders.counts.totals.rescans, 1);
    assert!(all.into_iter().all(is_common), "after a rescan: {all:?}");
}

#[test]
fn new_colliders_that_stay_have_the_margin_of_rounding() {
    let wide = |at: [f32; 3]| {
        let at = at.map(f64::from);
        WideAabb { min: at, max: at.map(|x| x + 0.5) }
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("a pool");
    for count in [100, policy::PROXIES_PER_BATCH + 500] {
        pool.install(|| check(|at| Aabb::new(at, at.map(|x| x + 0.5)), count));
        pool.install(|| check(wide, count));
    }
}

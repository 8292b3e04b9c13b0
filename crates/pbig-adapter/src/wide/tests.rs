//! Worlds in f64 beside brute force in f64.

use super::*;
use pbig_core::Config;
use std::collections::HashSet;

const MARGIN: f32 = 0.04;

/// Boxes in f64, and the pairs according to the events.
struct World {
    core: BroadPhase,
    boxes: WideBoxes,
    pairs: HashSet<Pair>,
    random: u64,
}

impl World {
    fn new() -> Self {
        let core =
            BroadPhase::new(Config { margin: MARGIN, ..Config::DEFAULT }).expect("the margin is a length");
        let mut world = Self { core, boxes: WideBoxes::default(), pairs: HashSet::new(), random: 1 };
        world.boxes.set_margin(&mut world.core, MARGIN).expect("the margin is a length");
        world
    }

    /// Returns a number from 0 up to 1.
    fn random(&mut self) -> f64 {
        self.random =
            self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 11) as f64 / (1u64 << 53) as f64
    }

    fn set(&mut self, id: u32, at: [f64; 3]) {
        let aabb = WideAabb { min: at, max: at.map(|x| x + 1.0) };
        self.boxes.set(&mut self.core, id, aabb, ProxyFilter::ALL).expect("the id is small");
    }

    /// Sets a box at a random place of a cube.
    fn place(&mut self, id: u32, corner: f64, edge: f64) {
        let at = [0.0; 3].map(|_: f64| corner + edge * self.random());
        self.set(id, at);
    }

    fn remove(&mut self, id: u32) {
        self.boxes.remove(&mut self.core, id);
        self.pairs.retain(|pair| pair.a != id && pair.b != id);
    }

    /// Updates, and returns the numbers of added and of removed pairs.
    fn update(&mut self) -> [usize; 2] {
        self.boxes.settle(&mut self.core);
        let found = self.boxes.update(&mut self.core).expect("the pairs are few");
        assert!([&found.added, &found.removed].iter().all(|pairs| is_list(pairs)));
        for pair in &found.removed {
            assert!(self.pairs.remove(pair), "{pair:?} ends unknown");
        }
        for pair in &found.added {
            assert!(self.pairs.insert(*pair), "{pair:?} begins twice");
        }
        [found.added.len(), found.removed.len()]
    }

    fn check(&self) {
        let fat: Vec<_> = (0..self.core.id_count()).map(|id| self.boxes.get(id)).collect();
        let partners = |a: usize| (a + 1..fat.len()).filter(move |&b| (a, b) != (b, a));
        let all = (0..fat.len()).flat_map(|a| partners(a).map(move |b| (a, b)));
        let wanted: HashSet<_> = all
            .filter(|&(a, b)| fat[a].overlaps(&fat[b]))
            .map(|(a, b)| Pair::new(a as u32, b as u32))
            .collect();
        assert_eq!(self.pairs, wanted);
        assert_eq!(self.boxes.pair_count(&self.core), wanted.len());
    }
}

/// Returns true if pairs are sorted, each once.
fn is_list(pairs: &[Pair]) -> bool {
    pairs.is_sorted_by(|one, next| one < next)
}

#[test]
fn pairs_are_those_whose_f64_boxes_overlap() {
    // In the last world f32 is exact to 64 m: most candidates are apart, and meet without an event of the core.
    for (corner, edge, far) in [(0.0, 12.0, 0.0), (1e7, 12.0, 0.0), (-3e11, 12.0, 0.0), (0.0, 12.0, 1e9)] {
        let (mut world, mut most_apart) = (World::new(), 0);
        for round in 0..200u32 {
            for _ in 0..20 {
                let id = (world.random() * 150.0) as u32;
                // Every other cluster is far from the median.
                let shift = if id.is_multiple_of(3) { far } else { 0.0 };
                if world.random() < 0.1 { world.remove(id) } else { world.place(id, corner + shift, edge) }
            }
            // A third of the updates have few changes.
            if round.is_multiple_of(3) {
                world.update();
                let id = (world.random() * 150.0) as u32;
                world.place(id, corner, edge);
            }
            world.update();
            world.check();
            most_apart = most_apart.max(world.boxes.apart.len());
        }
        assert_eq!(most_apart > 100, far > 0.0, "{most_apart} at {corner}");
    }
}

#[test]
fn boxes_that_meet_without_an_event_of_the_core_are_a_pair() {
    let mut world = World::new();
    // The boxes near the origin keep the centre there; a step of f32 is 64 m at 10^9.
    (0..9).for_each(|id| world.set(id, [10.0 * f64::from(id), 0.0, 0.0]));
    world.set(9, [1e9, 0.0, 0.0]);
    world.set(10, [1e9 + 3.0, 0.0, 0.0]);
    assert_eq!(world.update(), [0, 0]);
    assert_eq!((world.core.pair_count(), world.boxes.pair_count(&world.core)), (1, 0));
    world.set(10, [1e9 + 1.05, 0.0, 0.0]);
    assert_eq!(world.update(), [1, 0]);
    assert!(world.core.events().added.is_empty());
    world.set(10, [1e9 + 3.0, 0.0, 0.0]);
    assert_eq!(world.update(), [0, 1]);
    assert_eq!(world.update(), [0, 0]);
}

/// Returns the number of candidates of the same world at a distance from the origin.
fn candidates(corner: f64) -> usize {
    let mut world = World::new();
    (0..3000).for_each(|id| world.place(id, corner, 20.0));
    world.update();
    world.core.pair_count()
}

#[test]
fn a_far_world_has_as_many_candidates_as_one_at_the_origin() {
    let near = candidates(0.0);
    assert!(near > 1000);
    for corner in [1e7, -6.4e6, 1.5e11] {
        let far = candidates(corner);
        assert!(far.abs_diff(near) * 100 <= near, "{near} at the origin, {far} at {corner}");
    }
}

#[test]
fn a_world_that_moves_away_takes_its_centre_along() {
    let mut world = World::new();
    for step in 0..60 {
        (0..50).for_each(|id| world.place(id, 1e5 * f64::from(step), 10.0));
        world.update();
        world.check();
    }
    assert!(world.boxes.centre.iter().all(|x| (x - 5.9e6).abs() < 1e6), "{:?}", world.boxes.centre);
    let before = world.boxes.centre;
    // A world that is wide keeps its centre, because no other is better.
    for _ in 0..20 {
        (0..50).for_each(|id| world.place(id, 5.5e6, 1e6));
        world.update();
    }
    assert!((0..3).all(|k| (before[k] - world.boxes.centre[k]).abs() < 1e6), "{:?}", world.boxes.centre);
}

#[test]
fn narrow_queries_meet_what_the_wide_ones_meet() {
    let mut world = World::new();
    (0..500).for_each(|id| world.place(id, 1e7, 30.0));
    world.update();
    let mut hits = 0;
    for _ in 0..400 {
        let [at, along] = [[0.0; 3], [0.0; 3]].map(|zero| zero.map(|_: f64| world.random()));
        let (at, along) = (at.map(|x| 1e7 + 30.0 * x), along.map(|x| x - 0.5));
        // A point on the way touches a box's corner exactly, or nearly.
        let (start, velocity) = world.boxes.narrow_motion(&WideAabb { min: at, max: at }, &along);
        let time = world.boxes.narrow_bound(1e3);
        for id in 0..500 {
            let fat = world.boxes.get(id);
            let [enter, leave] = (0..3).fold([0.0, 1e3], |[enter, leave], k| {
                let [one, other] = [fat.min[k], fat.max[k]].map(|x| (x - at[k]) / along[k]);
                [f64::max(enter, one.min(other)), f64::min(leave, one.max(other))]
            });
            if enter <= leave {
                let place = |corner: f32, k: usize| f64::from(corner) + f64::from(velocity[k]) * enter;
                let core = world.core.fat_aabb(id).expect("it is valid");
                let touches = |k: usize| {
                    place(start.min[k], k) <= core.max[k].into()
                        && place(start.max[k], k) >= core.min[k].into()
                };
                assert!((0..3).all(touches) && enter <= time.into(), "{id}");
                hits += 1;
            }
        }
    }
    assert!(hits > 100, "{hits}");
}

/// Speeds and places that f32 has not.
#[test]
fn queries_beyond_f32_meet_all_boxes() {
    let mut world = World::new();
    (0..100).for_each(|id| world.place(id, 0.0, 30.0));
    world.update();
    let everywhere = Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]);
    let from = |x: f64| WideAabb { min: [x, 0.0, 0.0], max: [x, 0.0, 0.0] };
    for (start, speed) in [(0.0, 1e-50), (0.0, 1e-44), (0.0, 1e39), (1e39, 1.0), (1e39, -1e38)] {
        assert_eq!(world.boxes.narrow_motion(&from(start), &[speed, 0.0, 0.0]), (everywhere, [0.0; 3]));
    }
    // A tiny component beside another one, as rotations leave it.
    let (start, velocity) = world.boxes.narrow_motion(&from(0.0), &[1.0, 1e-48, 0.0]);
    assert!(start != everywhere && velocity == [1.0, 0.0, 0.0]);
    let point = world.boxes.narrow_point(&[1e39, -1e300, f64::NAN]);
    assert!(point[0] == f32::MAX && point[1] == f32::MIN && point[2].is_nan(), "{point:?}");
}

/// The centre of such a world, rounded to a multiple of its margin, is infinite.
#[test]
fn a_world_at_the_end_of_the_numbers_keeps_its_pairs() {
    let mut world = World::new();
    world.boxes.set_margin(&mut world.core, 1e-30).expect("a length");
    let (at, half) = ([1e300; 3], [1e300, 1e300, f64::INFINITY]);
    for (id, min, max) in [(0, at, at), (1, half.map(|x| if x == 1e300 { x } else { -x }), half), (2, at, at)]
    {
        world.boxes.set(&mut world.core, id, WideAabb { min, max }, ProxyFilter::ALL).expect("a small id");
    }
    world.update();
    world.check();
}

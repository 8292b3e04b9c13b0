//! The list against a naive one.

use super::*;
use std::collections::BTreeSet;

const BOXES: u32 = 40;

/// Boxes that move little, their reaches, and what the list should know.
struct World {
    seed: u64,
    boxes: Vec<Aabb>,
    reach: Vec<Aabb>,
    list: NearPairs,
    wanted: BTreeSet<Pair>,
}

impl World {
    fn new() -> Self {
        let (boxes, reach) = (vec![Aabb::NOWHERE; BOXES as usize], vec![Aabb::NOWHERE; BOXES as usize]);
        let mut world = Self { seed: 3, boxes, reach, list: NearPairs::default(), wanted: BTreeSet::new() };
        (0..BOXES).for_each(|id| world.place(id));
        world
    }

    /// With a list of all that are near, and the pairs that it tells of.
    fn with_list() -> (Self, Vec<Pair>) {
        let (mut world, mut added) = (Self::new(), vec![]);
        let near = world.near(|_| true);
        world.list.all().extend(near.iter().flatten());
        world.list.begin_all(&world.boxes, &Was(BTreeSet::new()), |_| {}, &mut added);
        (world, added)
    }

    fn random(&mut self) -> f32 {
        self.seed = self.seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.seed >> 40) as f32 / 16_777_216.0
    }

    /// Anywhere, with a new reach.
    fn place(&mut self, id: u32) {
        let center = [self.random(), self.random(), self.random()].map(|x| 4.0 * x);
        self.boxes[id as usize] = Aabb::from_center(center, [0.5; 3]);
        self.reach[id as usize] = self.boxes[id as usize].inflated(0.3);
    }

    /// Within the reach.
    fn tremble(&mut self, id: u32) {
        let by = [self.random(), self.random(), self.random()].map(|x| 0.6 * x - 0.3);
        let reach = self.reach[id as usize].inflated(-0.3);
        let add = |corner: [f32; 3]| std::array::from_fn(|k| corner[k] + by[k]);
        self.boxes[id as usize] = Aabb::new(add(reach.min), add(reach.max));
    }

    /// Pairs of reaches that have one of the boxes.
    fn near(&self, of: impl Fn(u32) -> bool) -> Vec<Vec<Pair>> {
        let all = (0..BOXES).flat_map(|a| (a + 1..BOXES).map(move |b| Pair::new(a, b)));
        let is_near = |pair: &Pair| self.reach[pair.a as usize].overlaps(&self.reach[pair.b as usize]);
        let mut found = vec![vec![], vec![]];
        all.filter(|pair| (of(pair.a) || of(pair.b)) && is_near(pair)).for_each(|pair| found[1].push(pair));
        found
    }

    fn now(&self) -> BTreeSet<Pair> {
        let all = (0..BOXES).flat_map(|a| (a + 1..BOXES).map(move |b| Pair::new(a, b)));
        all.filter(|pair| self.boxes[pair.a as usize].overlaps(&self.boxes[pair.b as usize])).collect()
    }

    /// What was told turns the pairs there were into those there are, and these are kept.
    fn validate(&mut self, added: &[Pair], removed: &[Pair]) {
        for pair in removed {
            assert!(self.wanted.remove(pair), "{pair:?} is removed and was not there");
        }
        for pair in added {
            assert!(self.wanted.insert(*pair), "{pair:?} is added and was there");
        }
        assert_eq!(self.wanted, self.now());
        assert_eq!(self.list.iter().collect::<BTreeSet<_>>(), self.wanted);
        assert_eq!(self.list.overlapping(), self.wanted.len());
        for id in 0..BOXES {
            let own: BTreeSet<Pair> =
                self.wanted.iter().copied().filter(|p| p.a == id || p.b == id).collect();
            assert_eq!(self.list.of(id).count(), own.len(), "those of {id} repeat");
            assert_eq!(self.list.of(id).collect::<BTreeSet<_>>(), own, "those of {id}");
        }
    }

    fn update(&mut self, changed: &[u32]) {
        let (mut added, mut removed) = (vec![], vec![]);
        let Self { list, boxes, .. } = self;
        if changed.len() as u32 == BOXES {
            list.update(boxes, &mut added, &mut removed);
        } else {
            list.update_few(changed, boxes, &mut added, &mut removed);
        }
        self.validate(&added, &removed);
    }

    /// Some boxes go elsewhere.
    fn jump(&mut self, ids: &[u32]) {
        let (mut added, mut removed) = (vec![], vec![]);
        self.list.remove_of(ids, |id| ids.contains(&id), &mut removed);
        ids.iter().for_each(|id| self.place(*id));
        let found = self.near(|id| ids.contains(&id));
        self.list.extend(&found, &self.boxes, &mut added);
        self.validate(&added, &removed);
    }
}

/// What was a pair before.
struct Was(BTreeSet<Pair>);

impl Judgement for Was {
    fn holds(&self, pair: Pair) -> bool {
        self.0.contains(&pair)
    }
}

#[test]
fn pairs_come_and_go_as_boxes_tremble_and_jump() {
    let mut world = World::new();
    let mut indexed = 0;
    for round in 0..600 {
        if round % 150 == 0 {
            (0..BOXES).for_each(|id| world.tremble(id));
            let (near, now) = (world.near(|_| true), world.now());
            let removed: Vec<Pair> = world.wanted.difference(&now).copied().collect();
            let World { list, wanted, boxes, .. } = &mut world;
            list.all().extend(near.iter().flatten());
            let (mut added, mut overlapping) = (vec![], 0);
            list.begin_all(boxes, &Was(wanted.clone()), |pairs| overlapping += pairs.len(), &mut added);
            assert_eq!(overlapping, list.overlapping());
            world.validate(&added, &removed);
        }
        let first = (world.random() * BOXES as f32) as u32;
        let some = [first, (first + 7) % BOXES, (first + 8) % BOXES];
        if round % 10 == 5 {
            world.jump(&some[..1 + round % 3]);
        }
        // Now and then all, so that walks are due for an index again.
        let changed: Vec<u32> = if round % 50 == 0 { (0..BOXES).collect() } else { some.to_vec() };
        changed.iter().for_each(|id| world.tremble(*id));
        world.update(&changed);
        indexed += u32::from(world.list.index.known > 0);
    }
    assert!((300..600).contains(&indexed), "{indexed} rounds with an index");
}

impl NearPairs {
    pub(crate) fn has_index(&self) -> bool {
        self.index.known > 0
    }
}

#[test]
fn pairs_are_looked_up_where_few_are_of_boxes_that_have_changed() {
    let mut list = NearPairs::default();
    list.begin(|pairs| *pairs = (0..999).map(|a| Pair::new(a, a + 1)).collect());
    assert!(list.is_rarely_of(|id| id < 50) && !list.is_rarely_of(|id| id < 200));
    // One that is near all others is of as many pairs as they are.
    list.begin(|pairs| *pairs = (1..1000).map(|b| Pair::new(0, b)).collect());
    assert!(list.is_rarely_of(|id| id == 1) && !list.is_rarely_of(|id| id == 0));
    list.states.fill(GONE);
    assert!(!list.is_rarely_of(|_| false), "none is left to be rare");
}

#[test]
fn pairs_that_come_take_no_more_memory_than_an_eighth_beyond_them() {
    let mut list = NearPairs::default();
    list.begin(|pairs| *pairs = vec![Pair::new(0, 1); 8000]);
    list.extend(&[vec![Pair::new(0, 2); 900], vec![Pair::new(1, 2); 100]], &[Aabb::NOWHERE; 3], &mut vec![]);
    assert_eq!((list.len(), list.overlapping()), (9000, 8000));
    assert!(list.pairs.capacity() <= 10_000 && list.states.capacity() <= 10_000);
}

#[test]
fn an_index_that_was_of_use_is_made_again_for_narrower_reaches() {
    let (mut world, _) = World::with_list();
    world.list.make_index(BOXES as usize);
    world.list.retain_near(&world.boxes);
    assert!(!world.list.has_index());
    world.list.update_few(&[BOXES - 1], &world.boxes, &mut vec![], &mut vec![]);
    assert!(world.list.has_index());
}

#[test]
fn what_is_apart_and_no_longer_near_is_forgotten() {
    let (mut world, added) = World::with_list();
    world.validate(&added, &[]);
    let before = world.list.len();
    // Odd boxes are near nothing any more.
    let reach = |(id, reach): (usize, &Aabb)| if id % 2 == 1 { Aabb::NOWHERE } else { *reach };
    let reach: Vec<Aabb> = world.reach.iter().enumerate().map(reach).collect();
    world.list.retain_near(&reach);
    assert!(world.list.len() < before && world.list.len() > added.len());
    (0..BOXES).for_each(|id| world.tremble(id));
    let odd = |pair: &&Pair| (pair.a % 2 == 1 || pair.b % 2 == 1) && !world.wanted.contains(pair);
    let missed: Vec<Pair> = world.now().iter().filter(odd).copied().collect();
    let mut now = vec![];
    world.list.update(&world.boxes, &mut now, &mut vec![]);
    assert!(!missed.is_empty() && missed.iter().all(|pair| !now.contains(pair)));
    assert!(!now.is_empty());
}

/// More near pairs than are tested before those that overlap are told.
#[test]
fn a_long_list_is_begun_portion_by_portion() {
    const MANY: u32 = 1600;
    let at = |id: u32| Aabb::from_center([0.5 * id as f32, 0.0, 0.0], [1.0; 3]);
    let boxes: Vec<Aabb> = (0..MANY).map(at).collect();
    let all = || (0..MANY).flat_map(|a| (a + 1..MANY).map(move |b| Pair::new(a, b)));
    let wanted: BTreeSet<Pair> = all().filter(|pair| pair.b - pair.a <= 4).collect();
    let before: BTreeSet<Pair> = wanted.iter().copied().filter(|pair| pair.a % 3 == 0).collect();
    let (mut list, mut told, mut added) = (NearPairs::default(), vec![], vec![]);
    list.all().extend(all());
    assert!(list.pairs.len() > PORTION);
    list.begin_all(&boxes, &Was(before.clone()), |pairs| told.extend_from_slice(pairs), &mut added);
    assert!(told.len() == wanted.len() && told.into_iter().collect::<BTreeSet<_>>() == wanted);
    assert!(added.into_iter().eq(wanted.difference(&before).copied()));
    assert!(list.overlapping() == wanted.len() && list.iter().eq(wanted));
}

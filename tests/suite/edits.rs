//! Few boxes of many change: edits, shared by threads, against a search of all.

use pbig_core::{
    Aabb, Algorithm, BroadPhase, Config, Engine, Error, Events, Finder, Limits, Pair, ProxyFilter, oracle,
};
use pbig_harness::boxes::BoxSet;
use rayon::ThreadPoolBuilder;

const BOXES: usize = 20_000;

/// Boxes that change in a round: enough for threads to share edits.
const CHANGED: usize = 1500;

/// A limit below the pairs of all boxes in one place.
const LIMIT: u64 = 300_000;

/// Pairs with nothing.
const LONE: ProxyFilter = ProxyFilter { memberships: 0, mask: 0, ..ProxyFilter::ALL };

/// The boxes given to a broad phase, and the pairs that it should report.
struct EditedWorld {
    boxes: Vec<Aabb>,
    filters: Vec<ProxyFilter>,
    /// The pairs at the last update that succeeded.
    pairs: Vec<Pair>,
    /// Removed since.
    gone: Vec<u32>,
    finder: Finder,
    tested: BroadPhase,
    edits: usize,
    /// Pairs that ended although the boxes overlap.
    parted: usize,
}

impl EditedWorld {
    fn new() -> Self {
        let boxes = BoxSet::named("pile").expect("the set exists").boxes(BOXES, 3);
        let limits = Limits { max_pairs: LIMIT, ..Limits::DEFAULT };
        let config = Config { engine: Some(Engine::Edit), limits, ..Config::DEFAULT };
        Self {
            boxes,
            filters: vec![ProxyFilter::ALL; BOXES],
            pairs: vec![],
            gone: vec![],
            finder: Finder::new(Config::DEFAULT),
            tested: BroadPhase::new(config).expect("a margin"),
            edits: 0,
            parted: 0,
        }
    }

    fn set(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) {
        (self.boxes[id as usize], self.filters[id as usize]) = (aabb, filter);
        self.tested.set(id, aabb, filter).expect("a small id");
    }

    fn remove(&mut self, id: u32) {
        self.boxes[id as usize] = Aabb::NOWHERE;
        self.gone.push(id);
        self.tested.remove(id);
    }

    /// An update, whose events are held against two searches of all.
    fn check(&mut self, what: &str) {
        let now = self.finder.find_filtered(&self.boxes, &self.filters).expect("few pairs").to_vec();
        let is_there = |pair: &Pair| !self.gone.contains(&pair.a) && !self.gone.contains(&pair.b);
        let old: Vec<Pair> = self.pairs.iter().copied().filter(is_there).collect();
        let mut wanted = Events::default();
        (wanted.added, wanted.removed) = (without(&now, &old), without(&old, &now));
        let overlap = |pair: &&Pair| self.boxes[pair.a as usize].overlaps(&self.boxes[pair.b as usize]);
        self.parted += wanted.removed.iter().filter(overlap).count();
        let events = self.tested.update().expect("few pairs");
        assert!(events == &wanted, "{what}: {} of {} added", events.added.len(), wanted.added.len());
        assert_eq!(self.tested.pair_count(), now.len(), "{what}");
        self.edits += usize::from(self.tested.report().plan.algorithm == Algorithm::Edit);
        (self.pairs, self.gone) = (now, vec![]);
    }

    /// In each round some boxes move to and fro, and some come, go, or get another filter.
    fn change(&mut self, round: usize) {
        let first = round * CHANGED * 3 / 5;
        for k in 0..CHANGED {
            let id = ((first + k * 19) % BOXES) as u32;
            let by = if round.is_multiple_of(2) { 0.03 } else { -0.03 };
            match (self.boxes[id as usize].is_valid(), k % 100) {
                (true, 0) => self.remove(id),
                (true, 1) => self.set(id, Aabb::NOWHERE, ProxyFilter::ALL),
                (true, 2) => self.set(id, self.boxes[id as usize], LONE),
                (true, _) => self.set(id, moved(&self.boxes[id as usize], by), self.filters[id as usize]),
                (false, _) => {
                    self.set(id, Aabb::from_center([k as f32 % 20.0; 3], [0.5; 3]), ProxyFilter::ALL)
                }
            }
        }
    }

    /// Too many boxes in one place, which is an error; later elsewhere, some of them gone or with another filter.
    fn crowd_and_part(&mut self) {
        let places = self.boxes.clone();
        for id in (0..CHANGED as u32).filter(|&id| places[id as usize].is_valid()) {
            self.set(id, Aabb::from_center([10.0; 3], [0.5; 3]), ProxyFilter::ALL);
        }
        let error = self.tested.update().expect_err("half a million pairs");
        assert!(matches!(error, Error::TooManyPairs { limit: LIMIT }), "{error}");
        for id in (0..CHANGED as u32).filter(|&id| places[id as usize].is_valid()) {
            self.set(id, moved(&places[id as usize], 0.4), ProxyFilter::ALL);
        }
        self.remove(5);
        self.set(6, self.boxes[6], LONE);
    }
}

fn moved(aabb: &Aabb, by: f32) -> Aabb {
    Aabb::new(aabb.min.map(|x| x + by), aabb.max.map(|x| x + by))
}

/// Those of one sorted list that are not in another.
fn without(pairs: &[Pair], others: &[Pair]) -> Vec<Pair> {
    pairs.iter().copied().filter(|pair| others.binary_search(pair).is_err()).collect()
}

fn rounds() {
    let mut world = EditedWorld::new();
    for (id, aabb) in (0..).zip(world.boxes.clone()) {
        world.set(id, aabb, ProxyFilter::ALL);
    }
    world.check("the first");
    for round in 0..12 {
        world.change(round);
        world.check(&format!("round {round}"));
    }
    world.crowd_and_part();
    world.check("after an error");
    assert_eq!(world.tested.report().plan.algorithm, Algorithm::Grid, "all are searched again");
    assert!(!world.tested.events().removed.is_empty());
    world.change(13);
    world.check("the last");
    assert!(world.edits >= 12 && world.parted > 100, "{} edits, {} parted", world.edits, world.parted);
    assert_eq!(world.pairs, oracle::pairs_filtered(&world.boxes, &world.filters));
}

#[test]
fn edits_make_the_events_of_a_full_search_on_any_threads() {
    rounds();
    for threads in [1, 2, 3] {
        ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(rounds);
    }
}

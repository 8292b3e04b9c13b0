//! The pairs of a set, and of two, are the oracle's, also in a second call, with filters and keys, and without a list.

use super::input::Input;
use pbig_core::{Aabb, Backend, Boxes, Config, Engine, Finder, Keys, NO_KEY, Order, ProxyFilter, oracle};
use std::fmt::Debug;
use std::sync::Mutex;

/// One byte of settings, then boxes, each after a byte with its set and keys; a filter follows if the settings ask for filters.
pub fn finder_against_oracle(data: &[u8]) {
    let mut input = Input(data);
    let Some(settings) = input.byte() else { return };
    let config = config(settings);
    let mut finder = Finder::new(config);
    let [mut a, mut b] = read(&mut input, settings);
    check_one(&mut finder, config.order, &a);
    check_two(&mut finder, config.order, &a, &b);
    // Half of the boxes in exchanged sets: nothing of the first calls may be left.
    [&mut a, &mut b].into_iter().for_each(Set::halve);
    check_one(&mut finder, config.order, &b);
    check_two(&mut finder, config.order, &b, &a);
}

/// Returns the settings of the finder. A forced engine takes a grid even for few boxes.
fn config(settings: u8) -> Config {
    let base = Config { backend: Backend::Cpu, ..Config::DEFAULT };
    let grid = Config { engine: Some(Engine::Grid), ..base };
    match settings & 3 {
        0 => base,
        1 => grid,
        2 => Config { order: Order::Unspecified, engine: Some(Engine::Tree), ..base },
        _ => Config { backend: Backend::Brute, ..base },
    }
}

/// A set of boxes, and their filters and keys if the settings ask for them.
struct Set {
    boxes: Vec<Aabb>,
    filters: Option<Vec<ProxyFilter>>,
    keys: Option<Vec<Keys>>,
}

impl Set {
    fn new(settings: u8) -> Self {
        let has = |bit: u8| settings & bit != 0;
        Self { boxes: vec![], filters: has(16).then(Vec::new), keys: has(32).then(Vec::new) }
    }

    fn halve(&mut self) {
        let half = self.boxes.len() / 2;
        self.boxes.truncate(half);
        self.filters.iter_mut().for_each(|filters| filters.truncate(half));
        self.keys.iter_mut().for_each(|keys| keys.truncate(half));
    }

    fn all(&self) -> Boxes<'_> {
        let boxes = Boxes::new(&self.boxes);
        let boxes = self.filters.as_ref().map_or(boxes, |filters| boxes.with_filters(filters));
        self.keys.as_ref().map_or(boxes, |keys| boxes.with_keys(keys))
    }

    fn filter(&self, id: u32) -> ProxyFilter {
        self.filters.as_ref().map_or(ProxyFilter::ALL, |filters| filters[id as usize])
    }

    fn keys(&self, id: u32) -> impl Iterator<Item = u32> {
        let keys = self.keys.as_ref().map_or([NO_KEY; 4], |keys| keys[id as usize]);
        keys.into_iter().filter(|key| *key != NO_KEY)
    }

    /// Returns whether a box may pair with one of `others`.
    fn allows(&self, id: u32, others: &Self, other: u32) -> bool {
        let shares = || self.keys(id).any(|key| others.keys(other).any(|it| it == key));
        self.filter(id).allows(&others.filter(other)) && !shares()
    }
}

fn read(input: &mut Input, settings: u8) -> [Set; 2] {
    let (mut sets, mut given) = ([Set::new(settings), Set::new(settings)], Vec::new());
    while let Some(about) = input.byte()
        && let Some(aabb) = input.aabb(&given)
    {
        given.push(aabb);
        let set = &mut sets[usize::from(about & 1)];
        set.boxes.push(aabb);
        set.filters.iter_mut().for_each(|filters| filters.push(input.filter().unwrap_or_default()));
        set.keys.iter_mut().for_each(|keys| keys.push([about >> 1 & 7, about >> 4, 0, 0].map(key)));
    }
    sets
}

fn key(number: u8) -> u32 {
    if number == 0 { NO_KEY } else { number.into() }
}

fn check_one(finder: &mut Finder, order: Order, set: &Set) {
    let wanted = oracle::pairs_where(&set.boxes, |a, b| set.allows(a, set, b));
    let found = match (&set.filters, &set.keys) {
        (None, None) => Some(finder.find(&set.boxes)),
        (Some(filters), None) => Some(finder.find_filtered(&set.boxes, filters)),
        (None, Some(keys)) => Some(finder.find_without_shared(&set.boxes, keys)),
        // Without a list only.
        (Some(_), Some(_)) => None,
    };
    if let Some(found) = found {
        assert_listed(found.expect("few boxes").to_vec(), &wanted, order);
    }
    let visited = Mutex::new(Vec::new());
    let count = finder.for_each_pair(set.all(), |pair| visited.lock().expect("no panic").push(pair));
    assert_eq!(count, Ok(wanted.len() as u64));
    assert_listed(visited.into_inner().expect("no panic"), &wanted, Order::Unspecified);
}

fn check_two(finder: &mut Finder, order: Order, a: &Set, b: &Set) {
    let mut wanted = oracle::pairs_between(&a.boxes, &b.boxes);
    wanted.retain(|pair| a.allows(pair.a, b, pair.b));
    let found = finder.find_between(a.all(), b.all()).expect("few boxes").to_vec();
    assert_listed(found, &wanted, order);
    let visited = Mutex::new(Vec::new());
    let visit = |pair| visited.lock().expect("no panic").push(pair);
    assert_eq!(finder.for_each_pair_between(a.all(), b.all(), visit), Ok(wanted.len() as u64));
    assert_listed(visited.into_inner().expect("no panic"), &wanted, Order::Unspecified);
}

fn assert_listed<P: Ord + Debug>(mut found: Vec<P>, wanted: &[P], order: Order) {
    if order == Order::Unspecified {
        found.sort_unstable();
    }
    assert_eq!(found, wanted);
}

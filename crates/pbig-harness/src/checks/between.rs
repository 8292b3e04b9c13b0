//! The pairs of two sets are the oracle's, also in a second call, with filters and keys, and without a list.

use super::finder::config;
use super::input::Input;
use pbig_core::{Aabb, Boxes, CrossPair, Finder, Keys, NO_KEY, Order, ProxyFilter, oracle};
use std::sync::Mutex;

/// One byte of settings, then boxes, each after a byte with its set and keys; a filter follows if the settings ask for filters.
pub fn between_against_oracle(data: &[u8]) {
    let mut input = Input(data);
    let Some(settings) = input.byte() else { return };
    let config = config(settings);
    let mut finder = Finder::new(config);
    let [mut a, mut b] = read(&mut input, settings);
    check(&mut finder, config.order, &a, &b);
    // Half of the boxes in exchanged sets: nothing of the first call may be left.
    [&mut a, &mut b].into_iter().for_each(Set::halve);
    check(&mut finder, config.order, &b, &a);
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

fn check(finder: &mut Finder, order: Order, a: &Set, b: &Set) {
    let mut wanted = oracle::pairs_between(&a.boxes, &b.boxes);
    wanted.retain(|pair| allows(pair, a, b));
    let mut found = finder.find_between(a.all(), b.all()).expect("few boxes").to_vec();
    if order == Order::Unspecified {
        found.sort_unstable();
    }
    assert_eq!(found, wanted, "{}", finder.report().plan);
    let each = Mutex::new(Vec::new());
    let visit = |pair| each.lock().expect("no panic").push(pair);
    let count = finder.for_each_pair_between(a.all(), b.all(), visit);
    let mut visited = each.into_inner().expect("no panic");
    visited.sort_unstable();
    assert_eq!((count, visited), (Ok(wanted.len() as u64), wanted), "{}", finder.report().plan);
}

fn allows(pair: &CrossPair, a: &Set, b: &Set) -> bool {
    let shares = || a.keys(pair.a).any(|key| b.keys(pair.b).any(|other| other == key));
    a.filter(pair.a).allows(&b.filter(pair.b)) && !shares()
}

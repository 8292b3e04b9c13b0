//! Kept pairs through insertions, removals and walks, with links and without.

use super::*;
use std::collections::BTreeSet;

/// Pairs that hold.
struct Test<H>(H);

impl<H: Fn(Pair) -> bool + Sync> Judgement for Test<H> {
    fn holds(&self, pair: Pair) -> bool {
        self.0(pair)
    }
}

/// Boxes whose pairs come and go. Others have pairs that stay, so many that a list is worth having.
const SMALL: u32 = 12;

/// Every list holds exactly the pairs of its box, and the degrees agree.
fn validate(store: &PairStore, wanted: &BTreeSet<Pair>) {
    let all: BTreeSet<Pair> = store.iter().collect();
    assert_eq!(&all, wanted);
    assert!(!store.is_whole() || store.listed() == wanted.len());
    for id in 0..SMALL {
        let listed: BTreeSet<Pair> = store.of(id).collect();
        let own: BTreeSet<Pair> = wanted.iter().copied().filter(|p| p.a == id || p.b == id).collect();
        assert_eq!(listed, own, "list of {id}");
        assert_eq!(store.of(id).count(), own.len(), "list of {id} repeats");
        assert!(!store.is_whole() || store.counted(id) as usize == own.len(), "degree of {id}");
    }
}

#[test]
fn lists_stay_whole_through_insertions_and_removals_of_every_place_with_links_and_without() {
    let mut store = PairStore::default();
    store.reserve_ids(50);
    let staying = (SMALL..50).flat_map(|a| (a + 1..50).map(move |b| Pair::new(a, b)));
    let mut wanted: BTreeSet<Pair> = staying.collect();
    wanted.iter().for_each(|pair| store.insert(&[*pair]));
    let (mut random, mut linked) = (1u64, 0);
    for _ in 0..4000 {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let (i, j) = ((random >> 33) as u32 % 12, (random >> 50) as u32 % 12);
        let mut removed = Vec::new();
        let before = wanted.clone();
        if random >> 20 & 3 == 0 {
            wanted.retain(|pair| pair.a != i && pair.b != i);
            store.remove_of(i);
            validate(&store, &wanted);
            // Several boxes are removed before the list is put right.
            if random >> 30 & 1 == 0 {
                continue;
            }
        }
        store.drop_removed();
        if i != j && wanted.insert(Pair::new(i, j)) {
            store.insert(&[Pair::new(i, j)]);
        } else if random >> 22 & 63 == 0 {
            let holds = |pair: Pair| pair.a >= SMALL || !pair.a.is_multiple_of(3);
            wanted.retain(|&pair| holds(pair));
            store.end_many(&Test(holds), &mut removed);
        } else {
            let concerns = |pair: Pair| [pair.a, pair.b].iter().any(|id| *id == i || *id == j);
            wanted.retain(|&pair| !concerns(pair) || pair.b.is_multiple_of(2));
            store.end_few(&[i, j], &Test(|pair: Pair| pair.b.is_multiple_of(2)), &mut removed);
        }
        validate(&store, &wanted);
        let ended: BTreeSet<Pair> = removed.iter().copied().collect();
        assert_eq!(ended.len(), removed.len(), "twice");
        assert!(ended.iter().all(|pair| before.contains(pair) && !wanted.contains(pair)));
        linked += u32::from(store.links.are_there());
    }
    assert!((500..3500).contains(&linked), "{linked} rounds with links");
}

#[test]
fn a_box_that_comes_when_pairs_are_linked_gets_a_list_of_its_own() {
    let mut store = PairStore::default();
    store.reserve_ids(SMALL as usize);
    let mut wanted: BTreeSet<Pair> = (1..SMALL).map(|b| Pair::new(0, b)).collect();
    wanted.iter().for_each(|pair| store.insert(&[*pair]));
    store.links.make(&store.pairs, SMALL as usize);
    store.reserve_ids(SMALL as usize + 8);
    let new = [Pair::new(0, SMALL), Pair::new(3, SMALL + 7)];
    store.insert(&new);
    wanted.extend(new);
    assert!(store.links.are_there());
    validate(&store, &wanted);
    assert!(store.of(SMALL).eq([new[0]]) && store.of(SMALL + 7).eq([new[1]]) && store.of(SMALL + 1).eq([]));
}

#[test]
fn a_walk_in_pieces_is_the_same_as_one() {
    let pairs: Vec<Pair> = (0..3 * PIECE as u32 + 77).map(|i| Pair::new(i, i + 1 + i % 7)).collect();
    let mut store = PairStore::default();
    store.reserve_ids(pairs.len() + 10);
    store.insert(&pairs);
    let holds = |pair: Pair| !(pair.a / 3).is_multiple_of(5);
    let mut removed = Vec::new();
    store.end_many(&Test(holds), &mut removed);
    let (kept, ended): (Vec<Pair>, Vec<Pair>) = pairs.into_iter().partition(|&pair| holds(pair));
    assert_eq!((store.pairs, removed), (kept, ended));
}

#[test]
fn a_walk_for_few_in_pieces_finds_the_same_beside_something_else() {
    let pairs: Vec<Pair> = (0..6 * PIECE as u32 + 77).map(|i| Pair::new(i, i + 1 + i % 7)).collect();
    let ids: Vec<u32> = (0..pairs.len() as u32 + 50).step_by(50).collect();
    let holds = |pair: Pair| !(pair.a / 3).is_multiple_of(5);
    let ends = |pair: Pair| (pair.a.is_multiple_of(50) || pair.b.is_multiple_of(50)) && !holds(pair);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("a pool");
    for is_shared in [false, true] {
        let (mut store, mut removed) = (PairStore::default(), Vec::new());
        store.reserve_ids(pairs.len() + 50);
        store.insert(&pairs);
        let done = pool.install(|| store.find_ended(&ids, &Test(holds), is_shared, || 7));
        assert_eq!((done, store.listed()), (7, pairs.len()), "none is removed yet");
        store.end_found(&mut removed);
        store.end_found(&mut removed);
        let (mut ended, mut kept): (Vec<Pair>, Vec<Pair>) = pairs.iter().partition(|&&pair| ends(pair));
        [&mut removed, &mut ended, &mut kept, &mut store.pairs]
            .into_iter()
            .for_each(|list| list.sort_unstable());
        assert!(ended.len() > 500 && removed == ended && store.pairs == kept, "{is_shared}");
    }
}

use super::*;
use crate::{Config, Limits};
use rand::rngs::StdRng;
use rand::{Rng, RngExt, SeedableRng};

const IDS: u32 = 20_000;

type Box = Option<(Aabb, ProxyFilter)>;

/// On so many threads, however many there are.
fn on<R: Send>(threads: usize, test: impl FnOnce() -> R + Send) -> R {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool").install(test)
}

fn new() -> BroadPhase {
    BroadPhase::new(Config { margin: 0.1, ..Config::DEFAULT }).expect("a margin")
}

/// A box somewhere in a cube that has room for them; some invalid or infinite, some of another filter, some not at all.
fn anything(rng: &mut impl Rng) -> Box {
    let center = std::array::from_fn(|_| rng.random_range(0.0..20.0));
    let aabb = Aabb::from_center(center, [0.5; 3]);
    match rng.random_range(0..4000) {
        0..100 => None,
        100..200 => Some((Aabb::NOWHERE, ProxyFilter::ALL)),
        200..300 => Some((aabb, ProxyFilter { mask: 1, ..ProxyFilter::ALL })),
        300 => Some((Aabb { min: [f32::NEG_INFINITY; 3], ..aabb }, ProxyFilter::ALL)),
        _ => Some((aabb, ProxyFilter::ALL)),
    }
}

fn sorted(ids: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut ids: Vec<u32> = ids.collect();
    ids.sort_unstable();
    ids
}

/// Two that are told the same, one of them many boxes at once.
struct Both {
    many: BroadPhase,
    each: BroadPhase,
    boxes: Vec<Box>,
    rng: StdRng,
}

impl Both {
    /// New places for some of the boxes from one to another. New ones are among them at first, and some are listed twice.
    fn set(&mut self) {
        let Self { many, each, boxes, rng } = self;
        let (first, end) = (rng.random_range(0..IDS / 2), rng.random_range(IDS / 2 + 1..=IDS));
        let ids: Vec<u32> = (0..IDS).map(|_| rng.random_range(first..end)).collect();
        let share = rng.random_range(0.0..1.0);
        for &id in &ids {
            if rng.random_bool(share) {
                boxes[id as usize] = anything(rng);
            }
        }
        many.set_many(&ids, |id| id, |id| boxes[id as usize]).expect("few ids");
        for &id in &ids {
            if let Some((aabb, filter)) = boxes[id as usize] {
                each.set(id, aabb, filter).expect("a small id");
            }
        }
    }

    fn remove_some(&mut self) {
        for _ in 0..50 {
            let id = self.rng.random_range(0..IDS);
            assert_eq!(self.many.remove(id), self.each.remove(id));
        }
    }

    fn compare(&mut self, update: u32) {
        let Self { many, each, .. } = self;
        assert_eq!(sorted(many.changes()), sorted(each.changes()), "update {update}");
        assert_eq!(many.update().expect("few pairs"), each.update().expect("few pairs"), "update {update}");
        assert!(many.flags.iter().all(|flags| flags & flag::LISTED == 0));
        assert_eq!((many.present_count, many.invalid_count), (each.present_count, each.invalid_count));
    }
}

#[test]
fn many_at_once_are_set_as_one_after_the_other() {
    let (many, each, rng) = (new(), new(), StdRng::seed_from_u64(5));
    let mut both = Both { many, each, boxes: vec![None; IDS as usize], rng };
    on(2, || {
        for update in 0..14 {
            both.remove_some();
            // In one update twice, and with another margin.
            for _ in 0..=update % 3 {
                both.set();
                let margin = if update == 5 { 0.3 } else { 0.1 };
                for of in [&mut both.many, &mut both.each] {
                    of.set_margin(margin).expect("a margin");
                }
            }
            both.remove_some();
            both.compare(update);
        }
    });
    assert!(both.many.pair_count() > 1000, "{}", both.many.pair_count());
}

#[test]
fn ids_beyond_the_limit_are_an_error_and_the_others_are_set() {
    let limits = Limits { max_boxes: 9000, ..Limits::DEFAULT };
    let mut broad_phase = BroadPhase::new(Config { limits, ..Config::DEFAULT }).expect("a margin");
    let ids: Vec<u32> = (0..9100).rev().collect();
    let cube = |id: u32| Some((Aabb::from_center([id as f32, 0.0, 0.0], [0.4; 3]), ProxyFilter::ALL));
    for threads in [1, 2] {
        let set = on(threads, || broad_phase.set_many(&ids, |id| id, cube));
        assert_eq!(set, Err(Error::TooManyBoxes { boxes: 9100, limit: 9000 }), "{threads} threads");
    }
    assert_eq!(broad_phase.id_count(), 9000);
    assert!((0..9000).all(|id| broad_phase.contains(id)));
}

#[test]
fn there_is_no_room_for_boxes_that_are_not_set() {
    let mut broad_phase = new();
    let ids: Vec<u32> = (0..IDS).chain([u32::MAX, u32::MAX - 1]).collect();
    let cube = |id: u32| Some((Aabb::from_center([id as f32, 0.0, 0.0], [0.4; 3]), ProxyFilter::ALL));
    let set = on(2, || broad_phase.set_many(&ids, |id| id, |id| if id < 15_000 { cube(id) } else { None }));
    assert_eq!((set, broad_phase.id_count()), (Ok(()), 15_000));
}

#[test]
fn after_a_panic_of_the_caller_changes_are_seen_and_nothing_is_listed_any_more() {
    let (mut many, ids) = (new(), (0..IDS).collect::<Vec<u32>>());
    let row = |x: f32| {
        move |id: u32| Some((Aabb::from_center([x + id as f32, 0.0, 0.0], [0.4; 3]), ProxyFilter::ALL))
    };
    on(2, || {
        many.set_many(&ids, |id| id, row(0.0)).expect("few ids");
        many.update().expect("few pairs");
        let next = row(0.5);
        let fails = |id: u32| if id == 9000 { panic!("as planned") } else { next(id) };
        let set = catch_unwind(AssertUnwindSafe(|| many.set_many(&ids, |id| id, fails)));
        assert!(set.is_err());
    });
    assert!(many.flags.iter().all(|flags| flags & flag::LISTED == 0));
    let changed = (0..IDS).filter(|id| many.flags[*id as usize] & flag::CHANGED != 0);
    assert_eq!(sorted(changed), sorted(many.changes()));
    assert!(many.changes().count() > 1000);
}

#[test]
fn the_next_listed_is_found_from_any_place() {
    for count in 0..40 {
        for listed in 0..=count {
            let mut flags = vec![!flag::LISTED; count];
            flags[listed..].iter_mut().step_by(9).for_each(|flags| *flags |= flag::LISTED);
            for from in 0..count {
                let wanted = (from..count).find(|&i| flags[i] & flag::LISTED != 0).unwrap_or(count);
                assert_eq!(next_listed(&flags, from), wanted, "{count} flags, {listed}, from {from}");
            }
        }
    }
}

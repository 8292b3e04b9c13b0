//! Boxes move, come and go: every engine gives the events that lead to the pairs of a search from nothing.

use super::engines::Engines;
use super::input::Input;
use crate::boxes::shifted;
use pbig_core::{Aabb, Backend, Config, Error, Limits, Order, Pair, ProxyFilter, oracle};
use std::collections::{BTreeMap, BTreeSet};

/// Most pairs, beyond which an input ends: a smaller set shows the same in less time.
const MOST_PAIRS: usize = 1000;

/// The low one of two limits of pairs, so that updates fail and are repeated.
const FEW_PAIRS: u64 = 24;

/// Two bytes of settings, then operations: see `Player::play`.
pub fn updates_against_scratch(data: &[u8]) {
    let mut input = Input(data);
    let (Some(settings), Some(spread)) = (input.byte(), input.byte()) else { return };
    let mut player = Player::new(config(settings), 1 + u32::from(spread & 3));
    while player.play(&mut input).is_some() {}
    _ = player.update();
}

fn config(settings: u8) -> Config {
    let max_pairs = if settings & 64 == 0 { Limits::DEFAULT.max_pairs } else { FEW_PAIRS };
    Config {
        backend: Backend::Cpu,
        order: if settings & 1 == 0 { Order::Sorted } else { Order::Unspecified },
        margin: [0.0, 0.01, 0.3, 1e30][usize::from(settings >> 4 & 3)],
        limits: Limits { max_pairs, ..Limits::DEFAULT },
        ..Config::DEFAULT
    }
}

/// A box as it was set last, and its filter.
#[derive(Clone, Copy)]
struct Proxy {
    aabb: Aabb,
    filter: ProxyFilter,
}

/// The engines, and what their caller knows.
struct Player {
    engines: Engines,
    max_pairs: u64,
    /// Ids are multiples of this: with gaps, and more of them than a byte can name.
    stride: u32,
    /// Boxes of the input, for those that are made from earlier ones.
    given: Vec<Aabb>,
    /// By id; absent boxes are missing.
    proxies: BTreeMap<u32, Proxy>,
    /// The pairs that the events so far have led to.
    pairs: BTreeSet<Pair>,
}

impl Player {
    fn new(config: Config, stride: u32) -> Self {
        let (given, proxies, pairs) = Default::default();
        let max_pairs = config.limits.max_pairs;
        Self { engines: Engines::new(config), max_pairs, stride, given, proxies, pairs }
    }

    /// Plays one operation; returns none when the input is used up.
    fn play(&mut self, input: &mut Input) -> Option<()> {
        match input.byte()? % 20 {
            op @ ..8 => self.set(input, op < 5)?,
            8 => self.set_filter(input)?,
            9 => self.tremble(input)?,
            10..=12 => self.update()?,
            13 => self.remove(input)?,
            14 => self.engines.save_and_restore(),
            15 => self.set_margin(f32::from(input.byte()?) / 64.0),
            16 => self.check_pairs_of(input)?,
            17 => self.check_overlapping(input)?,
            18 => self.clear_or_shrink(input.byte()?),
            _ => self.set_row(input)?,
        }
        Some(())
    }

    fn id(&self, input: &mut Input) -> Option<u32> {
        Some(u32::from(input.byte()?) * self.stride)
    }

    fn set(&mut self, input: &mut Input, open: bool) -> Option<()> {
        let id = self.id(input)?;
        let aabb = input.aabb(&self.given)?;
        let filter = if open { ProxyFilter::ALL } else { input.filter()? };
        self.engines.change(|one| one.set(id, aabb, filter)).expect("a small id");
        self.note(id, Proxy { aabb, filter });
        Some(())
    }

    fn set_filter(&mut self, input: &mut Input) -> Option<()> {
        let (id, filter) = (self.id(input)?, input.filter()?);
        let has_box = self.engines.change(|one| one.set_filter(id, filter));
        let proxy = self.proxies.get_mut(&id);
        assert_eq!(has_box, proxy.is_some(), "box {id}");
        if let Some(proxy) = proxy {
            proxy.filter = filter;
        }
        Some(())
    }

    fn set_margin(&mut self, margin: f32) {
        self.engines.change(|one| one.set_margin(margin)).expect("a good margin");
    }

    /// Sets a row of boxes next to each other: a few bytes for a set that needs a grid.
    fn set_row(&mut self, input: &mut Input) -> Option<()> {
        let (first, count, aabb) = (self.id(input)?, input.byte()?, input.aabb(&self.given)?);
        let edges = aabb.extents();
        let place = |i: u32| {
            let by = std::array::from_fn(|k| edges[k] * (i / [1, 8, 64][k] % 8) as f32);
            (first + i, Proxy { aabb: shifted(&aabb, by), filter: ProxyFilter::ALL })
        };
        self.set_many((0..u32::from(count)).map(place).collect());
        Some(())
    }

    /// Moves boxes a little, each in a direction of its own.
    fn tremble(&mut self, input: &mut Input) -> Option<()> {
        let (first, count, by) = (self.id(input)?, input.byte()?, f32::from(input.byte()? as i8) / 512.0);
        let moved = |(&id, proxy): (&u32, &Proxy)| {
            let sign = |k: u32| if id >> k & 1 == 0 { by } else { -by };
            (id, Proxy { aabb: shifted(&proxy.aabb, [0, 1, 2].map(sign)), ..*proxy })
        };
        let boxes = self.proxies.range(first..first + u32::from(count)).map(moved).collect();
        self.set_many(boxes);
        Some(())
    }

    /// Sets boxes in one call, among ids that are left as they are.
    fn set_many(&mut self, boxes: BTreeMap<u32, Proxy>) {
        let ids: Vec<u32> = boxes.keys().flat_map(|&id| [id, id + 3000]).collect();
        let of = |id: u32| boxes.get(&id).map(|proxy| (proxy.aabb, proxy.filter));
        self.engines.change(|one| one.set_many(&ids, of)).expect("small ids");
        boxes.into_iter().for_each(|(id, proxy)| self.note(id, proxy));
    }

    /// Notes what has been set, and checks what is stored.
    fn note(&mut self, id: u32, proxy: Proxy) {
        let aabb = proxy.aabb;
        self.given.push(aabb);
        self.proxies.insert(id, proxy);
        let stored = self.engines.ask(|one| one.get(id));
        assert_eq!(stored.is_some(), aabb.is_valid(), "{aabb:?}");
        if let Some((fat, filter)) = stored {
            assert!(fat.contains(&aabb), "{fat:?} around {aabb:?}");
            assert_eq!(filter, proxy.filter);
        }
    }

    fn remove(&mut self, input: &mut Input) -> Option<()> {
        let id = self.id(input)?;
        let had_box = self.engines.change(|one| one.remove(id));
        assert_eq!(had_box, self.proxies.remove(&id).is_some(), "box {id}");
        self.pairs.retain(|pair| pair.a != id && pair.b != id);
        Some(())
    }

    /// Removes all boxes, or gives back memory, which changes nothing.
    fn clear_or_shrink(&mut self, choice: u8) {
        if choice < 32 {
            self.engines.change(|one| one.clear());
            self.proxies.clear();
            self.pairs.clear();
        } else {
            self.engines.change(|one| one.shrink_to_fit());
        }
        self.check_pairs();
    }

    /// Returns the stored boxes that are valid.
    fn fat_aabbs(&self) -> BTreeMap<u32, Aabb> {
        let fat = |&id: &u32| Some((id, self.engines.ask(|one| one.fat_aabb(id))?));
        self.proxies.keys().filter_map(fat).collect()
    }

    /// Returns the oracle's pairs of the stored boxes.
    fn wanted_pairs(&self) -> BTreeSet<Pair> {
        let fat = self.fat_aabbs();
        let ids: Vec<u32> = fat.keys().copied().collect();
        let boxes: Vec<Aabb> = fat.into_values().collect();
        let filters: Vec<ProxyFilter> = ids.iter().map(|id| self.proxies[id].filter).collect();
        let by_id = |pair: Pair| Pair::new(ids[pair.a as usize], ids[pair.b as usize]);
        oracle::pairs_filtered(&boxes, &filters).into_iter().map(by_id).collect()
    }

    fn update(&mut self) -> Option<()> {
        self.check_pairs();
        let wanted = self.wanted_pairs();
        if wanted.len() > MOST_PAIRS {
            return None;
        }
        let updated = self.engines.change(|one| one.update().cloned());
        if wanted.len() as u64 > self.max_pairs {
            assert_eq!(updated, Err(Error::TooManyPairs { limit: self.max_pairs }));
        } else {
            let events = updated.expect("few pairs");
            assert!(events.added.iter().eq(wanted.difference(&self.pairs)), "{events:?}");
            assert!(events.removed.iter().eq(self.pairs.difference(&wanted)), "{events:?}");
            self.pairs = wanted;
        }
        self.check_pairs();
        Some(())
    }

    /// Compares the existing pairs with the pairs that the events add up to.
    fn check_pairs(&self) {
        let pairs: Vec<Pair> = self.engines.ask(|one| one.pairs().collect());
        assert!(pairs.iter().eq(&self.pairs), "{pairs:?}, but events led to {:?}", self.pairs);
        assert_eq!(self.engines.ask(|one| one.pair_count()), pairs.len());
        assert_eq!(self.engines.ask(|one| one.len()), self.proxies.len());
    }

    /// Compares the pairs of one box with the pairs that the events add up to.
    fn check_pairs_of(&self, input: &mut Input) -> Option<()> {
        let id = self.id(input)?;
        // Pairs sorted by (a, b) of one box are sorted by the other box.
        let wanted: Vec<Pair> =
            self.pairs.iter().copied().filter(|pair| pair.a == id || pair.b == id).collect();
        assert_eq!(self.engines.ask(|one| one.pairs_of(id).collect::<Vec<_>>()), wanted, "box {id}");
        assert_eq!(self.engines.ask(|one| one.degree(id)) as usize, wanted.len(), "box {id}");
        assert!(self.engines.ask(|one| wanted.iter().all(|pair| one.has_pair(*pair))), "box {id}");
        Some(())
    }

    /// Compares a query by box with a test of all stored boxes.
    fn check_overlapping(&self, input: &mut Input) -> Option<()> {
        let aabb = input.aabb(&self.given)?;
        let overlaps = |(id, fat): (u32, Aabb)| (aabb.is_valid() && fat.overlaps(&aabb)).then_some(id);
        let wanted: Vec<u32> = self.fat_aabbs().into_iter().filter_map(overlaps).collect();
        let found = self.engines.ask(|one| {
            let mut ids = one.overlapping(&aabb);
            ids.sort_unstable();
            ids
        });
        assert_eq!(found, wanted, "{aabb:?}");
        Some(())
    }
}

//! However boxes move, come and go: the kept pairs are those of a search from nothing, and the events lead there.

use super::input::{Input, config};
use pbig_core::{Aabb, BroadPhase, Config, Pair, ProxyFilter, oracle};
use std::collections::{BTreeMap, BTreeSet};

/// Pairs at which an input ends: what a set of thousands would show a smaller one shows in less time.
const MOST_PAIRS: usize = 1000;

/// Two bytes of settings, then operations: see [`Player::play`].
pub fn updates_against_scratch(data: &[u8]) {
    let mut input = Input(data);
    let (Some(settings), Some(spread)) = (input.byte(), input.byte()) else { return };
    let margin = [0.0, 0.01, 0.3, 1e30][usize::from(settings >> 4 & 3)];
    let mut player = Player::new(Config { margin, ..config(settings & 15) }, 1 + u32::from(spread & 3));
    while player.play(&mut input).is_some() {}
    _ = player.update();
}

/// A broad phase, and what its caller knows.
struct Player {
    broad_phase: BroadPhase,
    /// Ids are multiples of this: with gaps, and more of them than a byte can name.
    stride: u32,
    given: Vec<Aabb>,
    /// By id: what was set last.
    at: BTreeMap<u32, Aabb>,
    ids: u32,
    pairs: BTreeSet<Pair>,
}

impl Player {
    fn new(config: Config, stride: u32) -> Self {
        let broad_phase = BroadPhase::new(config).expect("a good margin");
        let (given, at, pairs) = Default::default();
        Self { broad_phase, stride, given, at, ids: 0, pairs }
    }

    /// One operation; none when the input is used up.
    fn play(&mut self, input: &mut Input) -> Option<()> {
        match input.byte()? % 16 {
            10 | 11 => self.update()?,
            12 => self.remove(input)?,
            13 => self.save_and_restore(),
            14 => self.broad_phase.set_margin(f32::from(input.byte()?) / 64.0).expect("a good margin"),
            15 => self.set_many(input)?,
            9 => self.tremble(input)?,
            op => self.set(input, op < 5)?,
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
        self.put(id, aabb, filter);
        Some(())
    }

    /// A row of boxes next to each other: a few bytes for a set that needs a grid.
    fn set_many(&mut self, input: &mut Input) -> Option<()> {
        let (first, count, aabb) = (self.id(input)?, input.byte()?, input.aabb(&self.given)?);
        let edges = aabb.extents();
        let place = |i: u32| {
            let by = std::array::from_fn(|k| edges[k] * (i / [1, 8, 64][k] % 8) as f32);
            (first + i, shifted(&aabb, by), ProxyFilter::ALL)
        };
        self.put_many((0..u32::from(count)).map(place).collect());
        Some(())
    }

    /// Boxes go on, each a little in a direction of its own, or return: what lists of near pairs are for.
    fn tremble(&mut self, input: &mut Input) -> Option<()> {
        let (first, count, by) = (self.id(input)?, input.byte()?, f32::from(input.byte()? as i8) / 512.0);
        let near = self.at.range(first..first.saturating_add(u32::from(count)));
        let moved = |(&id, aabb): (&u32, &Aabb)| {
            let sign = |k: u32| if id >> k & 1 == 0 { by } else { -by };
            let filter = self.broad_phase.filter(id).copied().unwrap_or_default();
            (id, shifted(aabb, [0, 1, 2].map(sign)), filter)
        };
        let boxes = near.map(moved).collect();
        self.put_many(boxes);
        Some(())
    }

    fn put_many(&mut self, boxes: Vec<(u32, Aabb, ProxyFilter)>) {
        let ids: Vec<u32> = boxes.iter().map(|one| one.0).collect();
        let by_id: BTreeMap<_, _> = boxes.iter().map(|&(id, aabb, filter)| (id, (aabb, filter))).collect();
        self.broad_phase.set_many(&ids, |id| id, |id| Some(by_id[&id])).expect("small ids");
        boxes.into_iter().for_each(|(id, aabb, _)| self.note(id, aabb));
    }

    fn put(&mut self, id: u32, aabb: Aabb, filter: ProxyFilter) {
        self.broad_phase.set(id, aabb, filter).expect("a small id");
        self.note(id, aabb);
    }

    /// What has been set.
    fn note(&mut self, id: u32, aabb: Aabb) {
        self.given.push(aabb);
        self.at.insert(id, aabb);
        self.ids = self.ids.max(id + 1);
        let fat = self.broad_phase.fat_aabb(id);
        assert_eq!(fat.is_some(), aabb.is_valid(), "{aabb:?}");
        assert!(fat.is_none_or(|fat| fat.contains(&aabb)), "{fat:?} around {aabb:?}");
    }

    fn remove(&mut self, input: &mut Input) -> Option<()> {
        let id = self.id(input)?;
        self.broad_phase.remove(id);
        self.at.remove(&id);
        self.pairs.retain(|pair| pair.a != id && pair.b != id);
        Some(())
    }

    fn save_and_restore(&mut self) {
        let bytes = postcard::to_stdvec(&self.broad_phase).expect("a snapshot");
        self.broad_phase = postcard::from_bytes(&bytes).expect("what was saved");
        assert_eq!(postcard::to_stdvec(&self.broad_phase).expect("a snapshot"), bytes);
    }

    /// Returns the oracle's pairs of the fat boxes.
    fn wanted_pairs(&self) -> BTreeSet<Pair> {
        let fat: Vec<Aabb> =
            (0..self.ids).map(|id| self.broad_phase.fat_aabb(id).unwrap_or(Aabb::NOWHERE)).collect();
        let filters: Vec<ProxyFilter> =
            (0..self.ids).map(|id| self.broad_phase.filter(id).copied().unwrap_or_default()).collect();
        oracle::pairs_filtered(&fat, &filters).into_iter().collect()
    }

    fn update(&mut self) -> Option<()> {
        let wanted = self.wanted_pairs();
        if wanted.len() > MOST_PAIRS {
            return None;
        }
        let events = self.broad_phase.update().expect("few boxes");
        assert!(events.added.is_sorted() && events.removed.is_sorted());
        for pair in &events.removed {
            assert!(self.pairs.remove(pair), "{pair:?} ended but was not there");
        }
        for pair in &events.added {
            assert!(self.pairs.insert(*pair), "{pair:?} was there already");
        }
        assert_eq!(self.pairs, wanted, "{}", self.broad_phase.report().plan);
        let kept: BTreeSet<Pair> = self.broad_phase.pairs().collect();
        assert_eq!(self.pairs, kept, "events lead elsewhere");
        Some(())
    }
}

fn shifted(aabb: &Aabb, by: [f32; 3]) -> Aabb {
    let add = |corner: [f32; 3]| std::array::from_fn(|k| corner[k] + by[k]);
    Aabb::new(add(aabb.min), add(aabb.max))
}

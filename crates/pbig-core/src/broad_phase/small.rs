//! An update of a small world: no plan and no grid, but a bitmap index that is kept up to date.

use super::turns::{Turn, Turns};
use super::update::{State, state};
use super::{BroadPhase, MEASURED_FROM, flag};
use crate::cpu::bitmap::{Bitmap, MOST, Search};
#[cfg(target_arch = "x86_64")]
use crate::cpu::codes::Simd;
use crate::cpu::judge::Accept;
use crate::plan::Chosen;
use crate::report::{Checks, Watch, stage};
use crate::{Aabb, Backend, Error, Pair, Strategy, Updates};
use std::time::{Duration, Instant};

/// Candidates and bands that a changed box may cost on average: about as much as a grid does.
const BUDGET: u64 = 48;

/// Updates after which a bitmap is worth building anew when it has cost more than that, and for which the world is left
/// to the grid when a new one has.
const PATIENCE: u32 = 256;

/// Boxes that are not worth an index: each changed one is tested against all. (2: 0.24 us an update rather than 0.30; 4: the same.)
const TINY: usize = 3;

/// The index, and whether it is any good here.
#[derive(Clone, Debug, Default)]
pub(super) struct Small {
    bitmap: Bitmap,
    /// Whether the bitmap holds the boxes of the last update.
    is_current: bool,
    /// Updates since it was built.
    age: u32,
    /// Boxes that it was built for.
    built_for: u32,
    /// Updates that are still left to the grid.
    pause: u32,
    /// Whether it is the bitmap's turn, where many boxes change.
    pub(super) turns: Turns,
}

impl Small {
    /// Another search has done the work.
    pub(super) fn pass(&mut self) {
        self.is_current = false;
        self.pause = self.pause.saturating_sub(1);
    }

    /// Leaves so many updates to another search.
    #[cfg(test)]
    pub(super) fn rest_for(&mut self, updates: u32) {
        self.pause = updates;
    }

    /// What an update has cost decides about the next.
    fn judge(&mut self, cost: Cost, changed: usize) {
        self.age += 1;
        if cost.tests + cost.bands <= BUDGET * (changed as u64 + 1) {
            return;
        }
        self.is_current = false;
        if self.age < PATIENCE {
            self.pause = PATIENCE;
        }
    }

    /// Brings the bitmap up to date, and begins a search.
    fn prepare(&mut self, boxes: &[Aabb], changed: &[u32], valid: u32) {
        if !self.is_current || !self.bitmap.holds(boxes.len()) || valid > 2 * self.built_for {
            self.bitmap.build(boxes);
            (self.is_current, self.age, self.built_for) = (true, 0, valid);
        } else {
            put(&mut self.bitmap, boxes, changed);
        }
    }
}

impl BroadPhase {
    /// Whether the bitmap does the next update.
    pub(super) fn is_small(&self) -> bool {
        self.may_be_small() && self.small.pause == 0 && self.small.turns.turn == Turn::Bitmap
    }

    pub(super) fn may_be_small(&self) -> bool {
        let on_cpu = matches!(self.config.backend, Backend::Auto | Backend::Cpu);
        let is_free = self.config.strategy == Strategy::Auto && self.config.study.updates == Updates::Auto;
        on_cpu && is_free && self.boxes.len() <= MOST
    }

    /// What an update has taken decides whose turn the next ones are. Not one that was left to the grid for another reason.
    pub(super) fn take_turns(&mut self, by: Turn, clock: Option<Instant>) {
        let (changed, before) = (self.report.changed as usize, self.small.turns.turn);
        if !self.may_be_small() || by != before {
            return;
        }
        let time = clock.map_or(Duration::ZERO, |clock| clock.elapsed());
        if changed >= MEASURED_FROM && 4 * changed >= self.present_count as usize {
            self.small.turns.note_many(changed, time);
        } else {
            self.small.turns.note_few(time);
        }
        if self.small.turns.turn == Turn::Grid && before == Turn::Bitmap {
            self.near.begin_anew();
        }
    }

    /// As [`BroadPhase::find_added`], by bitmap.
    pub(super) fn find_in_small(&mut self, watch: &mut Watch) -> Result<(), Error> {
        self.has_base = false;
        self.drop_near();
        self.pairs.drop_removed();
        let cost = if self.boxes.len() <= TINY { self.look_up_tiny() } else { self.look_up_small(watch) };
        self.report.checks =
            Checks { made: cost.tests, unnecessary: cost.tests - cost.overlaps, redundant: 0 };
        self.report.stages.check += watch.lap();
        let limit = self.config.limits.max_pairs;
        let found = self.events.added.len() as u64;
        if found > limit { Err(Error::TooManyPairs { limit }) } else { Ok(()) }
    }

    fn look_up_small(&mut self, watch: &mut Watch) -> Cost {
        self.report.plan.chosen = Chosen::Bitmap;
        {
            stage!("map");
            self.small.prepare(&self.boxes, &self.changed, self.valid_count());
        }
        self.report.stages.map += watch.lap();
        stage!("check");
        let state = state!(self);
        let cost = search(&mut self.small.bitmap, &state, &self.changed, &mut self.events.added);
        self.small.judge(cost, self.changed.len());
        cost
    }

    fn look_up_tiny(&mut self) -> Cost {
        stage!("check");
        let boxes = self.valid_count();
        let all: [u32; TINY] = std::array::from_fn(|id| id as u32);
        if boxes > 1 {
            (self.report.plan.chosen, self.report.plan.swept) = (Chosen::Brute, boxes);
        }
        self.small.is_current = false;
        let (mut cost, state) = (Cost::default(), state!(self));
        for &id in &self.changed {
            let counts = |other: u32| other != id && state.comes_first(id, other);
            cost.test(id, &all[..state.boxes.len()], &state, &mut self.events.added, counts);
        }
        cost
    }
}

/// What a search has cost.
#[derive(Clone, Copy, Debug, Default)]
struct Cost {
    tests: u64,
    overlaps: u64,
    /// Bands read beyond two on an axis.
    bands: u64,
}

/// Brings changed boxes up to date, as fast as the processor can.
fn put(bitmap: &mut Bitmap, boxes: &[Aabb], changed: &[u32]) {
    #[cfg(target_arch = "x86_64")]
    if Simd::detect() == Simd::Avx2 {
        // SAFETY: the processor has what it takes.
        return unsafe { put_avx2(bitmap, boxes, changed) };
    }
    put_with(bitmap, boxes, changed);
}

/// # Safety
/// The processor has AVX2 and BMI1.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1")]
unsafe fn put_avx2(bitmap: &mut Bitmap, boxes: &[Aabb], changed: &[u32]) {
    put_with(bitmap, boxes, changed);
}

#[inline(always)]
fn put_with(bitmap: &mut Bitmap, boxes: &[Aabb], changed: &[u32]) {
    // A loop: closures are not compiled for the same processor.
    for &id in changed {
        bitmap.put(id, &boxes[id as usize]);
    }
}

/// Looks up the changed boxes, as fast as the processor can.
fn search(bitmap: &mut Bitmap, state: &State<'_>, changed: &[u32], added: &mut Vec<Pair>) -> Cost {
    #[cfg(target_arch = "x86_64")]
    if Simd::detect() == Simd::Avx2 {
        // SAFETY: the processor has what it takes.
        return unsafe { search_avx2(bitmap, state, changed, added) };
    }
    search_with(bitmap, state, changed, added)
}

/// The same code for a processor whose registers take a block at once.
///
/// # Safety
/// The processor has AVX2 and BMI1.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1")]
unsafe fn search_avx2(
    bitmap: &mut Bitmap,
    state: &State<'_>,
    changed: &[u32],
    added: &mut Vec<Pair>,
) -> Cost {
    search_with(bitmap, state, changed, added)
}

#[inline(always)]
fn search_with(bitmap: &mut Bitmap, state: &State<'_>, changed: &[u32], added: &mut Vec<Pair>) -> Cost {
    match bitmap.blocks() {
        1 => look_up(bitmap.search::<1>(), state, changed, added),
        2 => look_up(bitmap.search::<2>(), state, changed, added),
        _ => look_up(bitmap.search::<4>(), state, changed, added),
    }
}

/// Where most boxes have changed all are looked up, each among those with higher ids.
#[inline(always)]
fn look_up<const B: usize>(
    mut search: Search<'_, B>,
    state: &State<'_>,
    changed: &[u32],
    added: &mut Vec<Pair>,
) -> Cost {
    let (mut cost, ids) = (Cost::default(), state.boxes.len());
    if changed.len() * 4 > ids * 3 {
        for id in 0..ids as u32 {
            cost.test(id, search.candidates(id, true), state, added, |_| true);
        }
    } else {
        for &id in changed {
            cost.test(id, search.candidates(id, false), state, added, |other| state.comes_first(id, other));
        }
    }
    cost.bands = search.extra as u64;
    cost
}

impl State<'_> {
    /// Whether a changed box is the one of the two that their pair is left to: changed boxes meet each other twice.
    #[inline(always)]
    pub(super) fn comes_first(&self, id: u32, other: u32) -> bool {
        (id < other) | (self.flags[other as usize] & flag::CHANGED == 0)
    }
}

impl Cost {
    /// Tests candidates of a box that `counts` takes, and keeps those that pair now and did not before.
    #[inline(always)]
    fn test(
        &mut self,
        id: u32,
        candidates: &[u32],
        state: &State<'_>,
        added: &mut Vec<Pair>,
        counts: impl Fn(u32) -> bool,
    ) {
        let (now, before) = (&state.boxes[id as usize], &state.before[id as usize]);
        for &other in candidates {
            let counts = counts(other);
            self.tests += u64::from(counts);
            let overlap = now.overlaps(&state.boxes[other as usize]) & counts;
            self.overlaps += u64::from(overlap);
            let is_new = overlap & !before.overlaps(&state.before[other as usize]);
            if is_new && state.fresh(Pair::new(id, other)) {
                added.push(Pair::new(id, other));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Config, Events, ProxyFilter};

    fn cube(x: f32, y: f32) -> Aabb {
        Aabb::from_center([x, y, 0.0], [0.5; 3])
    }

    fn new(strategy: Strategy) -> BroadPhase {
        let mut broad_phase = BroadPhase::new(Config { strategy, ..Config::DEFAULT }).expect("a margin");
        broad_phase.small.turns = Turns::none();
        broad_phase
    }

    /// Sets boxes and updates; what was chosen, and the events.
    fn step(
        broad_phase: &mut BroadPhase,
        ids: impl IntoIterator<Item = u32>,
        at: impl Fn(u32) -> Aabb,
    ) -> (Chosen, Events) {
        for id in ids {
            broad_phase.set(id, at(id), ProxyFilter::ALL).expect("a small id");
        }
        let events = broad_phase.update().expect("few pairs").clone();
        (broad_phase.report().plan.chosen, events)
    }

    #[test]
    fn a_world_that_grows_beyond_the_bitmap_gets_a_grid_and_the_same_events() {
        let (mut auto, mut grid) = (new(Strategy::Auto), new(Strategy::Grid));
        let mut chosen = Vec::new();
        for (frame, ids) in [40, 200, 300, 700, 1024, 1025, 1100].into_iter().enumerate() {
            let at = |id: u32| cube((id % 37) as f32 * 0.9 + frame as f32 * 0.01, (id / 37) as f32 * 1.05);
            let (by, events) = step(&mut auto, 0..ids, at);
            assert_eq!(events, step(&mut grid, 0..ids, at).1, "{ids} boxes");
            chosen.push(by);
        }
        assert_eq!(chosen[..5], [Chosen::Bitmap; 5]);
        assert!(chosen[5..].iter().all(|by| *by != Chosen::Bitmap), "{chosen:?}");
    }

    #[test]
    fn a_crowd_is_left_to_the_grid_and_tried_again_later() {
        let mut broad_phase = new(Strategy::Auto);
        let apart = ProxyFilter { memberships: 1, mask: 2, ..ProxyFilter::ALL };
        let mut chosen = Vec::new();
        for frame in 0..3 * PATIENCE {
            for id in 0..400 {
                // A heap of boxes that ignore each other disperses after a while.
                let step = if frame < 2 * PATIENCE { 1e-3 } else { 2.0 };
                let aabb = cube(id as f32 * step, frame as f32 * 0.1);
                broad_phase.set(id, aabb, apart).expect("a small id");
            }
            broad_phase.update().expect("no pairs");
            chosen.push(broad_phase.report().plan.chosen);
        }
        let by_bitmap = |frames: &[Chosen]| frames.iter().filter(|by| **by == Chosen::Bitmap).count();
        let (crowd, dispersed) = chosen.split_at(2 * PATIENCE as usize);
        assert_eq!(by_bitmap(crowd), 2, "the first update, and a trial");
        assert!(by_bitmap(dispersed) > PATIENCE as usize - 10, "{}", by_bitmap(dispersed));
    }

    #[test]
    fn bands_that_no_longer_suit_are_made_anew() {
        let mut broad_phase = new(Strategy::Auto);
        // Boxes that grow a thousandfold and move apart as much: in the bands of the first update each lies in all.
        for frame in 0..2 * PATIENCE {
            let scale = if frame < PATIENCE { 1.0 } else { 1000.0 };
            let at = |id: u32| {
                let [x, y] = [id % 30, id / 30].map(|i| (i as f32 * 3.0 + frame as f32 * 0.01) * scale);
                Aabb::from_center([x, y, 0.0], [scale; 3])
            };
            assert_eq!(step(&mut broad_phase, 0..900, at).0, Chosen::Bitmap, "frame {frame}");
        }
        let made = broad_phase.report().checks.made;
        assert!(made < 900 * 10, "{made} tests");
    }

    #[test]
    fn any_processor_finds_the_same() {
        let mut broad_phase = new(Strategy::Auto);
        let at = |shift: f32| {
            move |id: u32| cube((id % 23) as f32 * 0.8 + shift * (id % 3) as f32, id as f32 * 0.1)
        };
        for ids in [0..700, 0..700, 0..50] {
            step(&mut broad_phase, 0..700, at(0.4));
            for id in ids {
                broad_phase.set(id, at(0.0)(id), ProxyFilter::ALL).expect("a small id");
            }
            let mut other = broad_phase.small.bitmap.clone();
            put_with(&mut other, &broad_phase.boxes, &broad_phase.changed);
            put(&mut broad_phase.small.bitmap, &broad_phase.boxes, &broad_phase.changed);
            assert!(other.is_like(&broad_phase.small.bitmap), "what is put");
            let (state, mut found) = (state!(broad_phase), [vec![], vec![]]);
            let (bitmap, changed) = (&mut broad_phase.small.bitmap, &broad_phase.changed);
            let fast = search(bitmap, &state, changed, &mut found[0]);
            let portable = search_with(bitmap, &state, changed, &mut found[1]);
            assert_eq!((fast.tests, fast.overlaps), (portable.tests, portable.overlaps));
            assert!(found[0] == found[1] && !found[0].is_empty());
        }
    }

    #[test]
    fn few_changes_are_not_timed_and_many_are() {
        let mut broad_phase = new(Strategy::Auto);
        step(&mut broad_phase, 0..200, |id| cube(id as f32, 0.0));
        assert!(!broad_phase.report().stages.total().is_zero());
        step(&mut broad_phase, 0..63, |id| cube(id as f32, 5.0));
        assert!(broad_phase.report().stages.total().is_zero() && broad_phase.report().checks.made > 0);
    }
}

//! How wide the skin of reaches is.

use crate::Aabb;
use crate::broad_phase::BroadPhase;

/// Moves that a skin is wide at first, at least and at most. It finds its width by itself ([`Skin::learn`]): the first is near
/// what boxes that drift come to, the others only keep it from running away.
const MOVES: [f32; 3] = [4.0, 2.0, 64.0];

/// How much wider or narrower the next skin is, where this one was not as it should be.
const STEP: f32 = 1.4;

/// How much more one of two costs may be than the other for the skin to be as it should.
const UNEVEN: f32 = 1.5;

/// Tests of near pairs in the time that it takes to search for those of one box.
const SEARCH_OF_A_BOX: f32 = 24.0;

/// Boxes whose moves are looked at.
const SAMPLE: usize = 256;

/// Updates in which each box of a small world is looked at once, for how far it has come. Odd, for worlds in which
/// every other update is one of few.
const ROUND: usize = 5;

/// Boxes that have come no further than so many times what they had at half the age swing or tremble.
const NO_FURTHER: f32 = 1.2;

/// How far a skin reaches beyond where they have been, and of what it was for a narrower one to be worth its walk.
const ROOM: f32 = 1.25;
const WORTH: f32 = 0.75;

/// How far reaches go beyond boxes, and what is known of how far they should.
#[derive(Clone, Debug)]
pub(in crate::broad_phase) struct Skin {
    pub(super) width: f32,
    /// In usual moves: how wide the next one will be.
    pub(super) moves: f32,
    /// How many boxes move, and how often each of them has since the list was made.
    movers: f32,
    rounds: f32,
    /// How far boxes have been from where their reach was made, as far as samples show; and at half the age.
    farthest: f32,
    farthest_then: f32,
}

impl Default for Skin {
    fn default() -> Self {
        Self { moves: MOVES[0], width: 0.0, movers: 0.0, rounds: 0.0, farthest: 0.0, farthest_then: 0.0 }
    }
}

impl Skin {
    /// For a list that is made now, where so many boxes move.
    pub(super) fn begin(&mut self, width: f32, movers: usize) {
        *self = Self { width, moves: self.moves, movers: movers as f32, ..Self::default() };
    }

    /// A list of so many boxes has ended, with so many near pairs that are apart: searches, which come the more often the
    /// narrower the skin is, should cost as much as tests of those, which are the more the wider it is.
    pub(super) fn learn(&mut self, boxes: u32, age: u32, apart: usize) {
        let (search, tests) = (SEARCH_OF_A_BOX * boxes as f32 / age.max(1) as f32, apart as f32);
        let factor = if search > UNEVEN * tests {
            STEP
        } else if tests > UNEVEN * search {
            1.0 / STEP
        } else {
            1.0
        };
        self.moves = (factor * self.moves).clamp(MOVES[1], MOVES[2]);
    }

    /// A narrower width that is enough, after an update in which so many boxes have changed: for boxes that have come no
    /// farther for as long again. Asked ever more rarely.
    pub(super) fn enough(&mut self, changed: usize) -> Option<f32> {
        let before = self.rounds as u32;
        self.rounds += changed as f32 / self.movers.max(1.0);
        let rounds = self.rounds as u32;
        if rounds == before || !rounds.is_power_of_two() {
            return None;
        }
        let then = std::mem::replace(&mut self.farthest_then, self.farthest);
        let enough = ROOM * self.farthest;
        (self.farthest > 0.0 && self.farthest <= NO_FURTHER * then && enough <= WORTH * self.width)
            .then_some(enough)
    }
}

impl BroadPhase {
    /// How wide the next skin would be; nothing where too many of the boxes that have changed are new.
    pub(super) fn next_width(&self) -> Option<f32> {
        let width = self.near.skin.moves * self.usual_move()?;
        (width > 0.0 && width.is_finite()).then_some(width)
    }

    /// How far boxes move in an update: nine in ten of those that have changed no further.
    fn usual_move(&self) -> Option<f32> {
        let moved = |id: u32| {
            let (now, old) = (&self.boxes[id as usize], &self.before[id as usize]);
            let of = |k: usize| (now.min[k] - old.min[k]).abs().max((now.max[k] - old.max[k]).abs());
            // `max` would pass over a box that was not there.
            if now.min[0].is_nan() | old.min[0].is_nan() { f32::NAN } else { of(0).max(of(1)).max(of(2)) }
        };
        let sample = Sample::of(&self.changed, moved);
        if 2 * sample.count < sample.looked_at { None } else { sample.at(0.9) }
    }

    /// How many pairs would be near: those that overlap, as often as there is more room around a box; filters left aside.
    pub(super) fn near_to_come(&self, width: f32) -> f64 {
        let edge = |id: u32| {
            let extents = self.boxes[id as usize].extents();
            (extents[0] + extents[1] + extents[2]) / 3.0
        };
        let Some(edge) = Sample::of(&self.changed, edge).at(0.5) else { return 0.0 };
        let grown = 1.0 + 2.0 * f64::from(width) / f64::from(edge);
        let boxes = f64::from(self.present_count);
        (self.near.met as f64 * grown.powi(3)).min(boxes * (boxes - 1.0) / 2.0)
    }

    /// Boxes that tremble, or swing, need less of a skin than those that go on: once they have come no farther for as long
    /// again, near pairs are only those that such motion can bring together.
    pub(super) fn shrink_skin(&mut self) {
        self.see_how_far();
        let Some(enough) = self.near.skin.enough(self.changed.len()) else { return };
        let near = &mut self.near;
        for (reach, aabb) in near.reach.iter_mut().zip(&self.boxes) {
            let less = reach.inflated(enough - near.skin.width);
            if less.contains(aabb) {
                *reach = less;
            }
        }
        near.skin.width = enough;
        near.list.retain_near(&near.reach);
    }

    fn see_how_far(&mut self) {
        let Self { near, boxes, changed, .. } = self;
        let step = changed.len().div_ceil(SAMPLE).max(ROUND);
        for &id in changed.iter().skip(near.age as usize % step).step_by(step) {
            let gone = near.skin.width - slack(&near.reach[id as usize], &boxes[id as usize]);
            near.skin.farthest = near.skin.farthest.max(gone);
        }
    }
}

/// Something of some boxes, from the least to the most; only what is finite.
struct Sample {
    values: [f32; SAMPLE],
    count: usize,
    looked_at: usize,
}

impl Sample {
    fn of(ids: &[u32], value: impl Fn(u32) -> f32) -> Self {
        let step = ids.len().div_ceil(SAMPLE).max(1);
        let mut sample = Self { values: [0.0; SAMPLE], count: 0, looked_at: ids.len().div_ceil(step) };
        for value in ids.iter().step_by(step).map(|&id| value(id)).filter(|value| value.is_finite()) {
            sample.values[sample.count] = value;
            sample.count += 1;
        }
        sample.values[..sample.count].sort_unstable_by(f32::total_cmp);
        sample
    }

    /// The value that this share of the others is below; nothing of nothing.
    fn at(&self, share: f32) -> Option<f32> {
        self.values[..self.count].get((self.count as f32 * share) as usize).copied()
    }
}

/// The narrowest gap between a box and the reach around it; NaN where that is infinite.
fn slack(reach: &Aabb, aabb: &Aabb) -> f32 {
    let gap = |k: usize| (aabb.min[k] - reach.min[k]).min(reach.max[k] - aabb.max[k]);
    gap(0).min(gap(1)).min(gap(2))
}

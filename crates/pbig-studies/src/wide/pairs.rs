//! All pairs of boxes in f64, and how pairs that were found in f32 differ.

use super::Wide;
use pbig_core::Pair;
use std::ops::AddAssign;

/// Every pair of boxes that overlap, in order, each with [`Wide::gap`]. By a sweep along the axis on which they are spread most.
pub fn pairs(boxes: &[Wide]) -> Vec<(Pair, f64)> {
    let axis = longest(boxes);
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| boxes[a as usize].min[axis].total_cmp(&boxes[b as usize].min[axis]));
    let mut found = Vec::new();
    for (i, &a) in order.iter().enumerate() {
        let one = &boxes[a as usize];
        let later = order[i + 1..].iter().take_while(|&&b| boxes[b as usize].min[axis] <= one.max[axis]);
        let gaps = later.map(|&b| (Pair::new(a.min(b), a.max(b)), one.gap(&boxes[b as usize])));
        found.extend(gaps.filter(|(_, gap)| *gap <= 0.0));
    }
    found.sort_unstable_by_key(|(pair, _)| *pair);
    found
}

fn longest(boxes: &[Wide]) -> usize {
    let spread = |k: usize| {
        let low = boxes.iter().map(|one| one.min[k]).fold(f64::INFINITY, f64::min);
        boxes.iter().map(|one| one.min[k]).fold(f64::NEG_INFINITY, f64::max) - low
    };
    (0..3).max_by(|&a, &b| spread(a).total_cmp(&spread(b))).unwrap_or(0)
}

/// Boxes in f64 and their pairs.
pub struct Truth {
    /// The boxes.
    pub boxes: Vec<Wide>,
    /// Their pairs, in order, with gaps.
    pub pairs: Vec<(Pair, f64)>,
    /// Boxes nearer to touching than this count neither as a pair nor as none.
    pub doubt: f64,
}

/// The differences of pairs from the true ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Differences {
    /// True pairs that are not among them.
    pub missed: u64,
    /// Missed pairs whose boxes overlap by more than the given depth.
    pub missed_deep: u64,
    /// Others that are.
    pub added: u64,
}

impl AddAssign for Differences {
    fn add_assign(&mut self, other: Self) {
        self.missed += other.missed;
        self.missed_deep += other.missed_deep;
        self.added += other.added;
    }
}

impl Truth {
    /// Finds the pairs.
    pub fn of(boxes: Vec<Wide>, doubt: f64) -> Self {
        let pairs = pairs(&boxes);
        Self { boxes, pairs, doubt }
    }

    /// Compares with pairs in order; `deep` is the overlap from which a missed one is counted twice over, as
    /// [`Differences::missed_deep`].
    pub fn differences(&self, found: &[Pair], deep: f64) -> Differences {
        let is_in = |pairs: &[Pair], pair: &Pair| pairs.binary_search(pair).is_ok();
        let lost = self.pairs.iter().filter(|(pair, gap)| *gap < -self.doubt && !is_in(found, pair));
        let (mut missed, mut missed_deep) = (0, 0);
        for (_, gap) in lost {
            missed += 1;
            missed_deep += u64::from(*gap < -deep - self.doubt);
        }
        let is_apart = |pair: &&Pair| self.gap(**pair) > self.doubt;
        Differences { missed, missed_deep, added: found.iter().filter(is_apart).count() as u64 }
    }

    fn gap(&self, pair: Pair) -> f64 {
        self.boxes[pair.a as usize].gap(&self.boxes[pair.b as usize])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::rngs::StdRng;
    use rand::{RngExt, SeedableRng};

    fn random(n: usize, seed: u64) -> Vec<Wide> {
        let mut rng = StdRng::seed_from_u64(seed);
        let one = |_| {
            let at: [f64; 3] = std::array::from_fn(|k| rng.random_range(0.0..[9.0, 30.0, 4.0][k]));
            let half: [f64; 3] = std::array::from_fn(|_| rng.random_range(0.0..1.5));
            // Halves of whole numbers: faces that touch.
            let round = |x: f64| if n.is_multiple_of(2) { x.round() / 2.0 } else { x };
            Wide {
                min: std::array::from_fn(|k| round(at[k] - half[k])),
                max: std::array::from_fn(|k| round(at[k] + half[k])),
            }
        };
        (0..n).map(one).collect()
    }

    #[test]
    fn the_sweep_finds_what_brute_force_finds() {
        for n in [0, 1, 2, 3, 50, 51, 300, 301] {
            let boxes = random(n, n as u64);
            let all = (0..n as u32).flat_map(|a| (a + 1..n as u32).map(move |b| Pair::new(a, b)));
            let overlap = |pair: &Pair| {
                let (a, b) = (&boxes[pair.a as usize], &boxes[pair.b as usize]);
                (0..3).all(|k| a.min[k] <= b.max[k] && b.min[k] <= a.max[k])
            };
            let wanted: Vec<Pair> = all.filter(overlap).collect();
            let found: Vec<Pair> = pairs(&boxes).into_iter().map(|(pair, _)| pair).collect();
            assert_eq!(found, wanted, "{n} boxes");
            assert!(n < 50 || !wanted.is_empty(), "{n} boxes without a pair");
        }
    }

    #[test]
    fn missed_and_added_pairs_are_counted_and_those_in_doubt_are_not() {
        let cube = |x: f64| Wide { min: [x, 0.0, 0.0], max: [x + 1.0, 1.0, 1.0] };
        let truth = Truth::of([0.0, 0.5, 1.25, 2.25 + 1e-12].map(cube).to_vec(), 1e-9);
        let pair = |a, b| Pair::new(a, b);
        assert_eq!(truth.pairs, [(pair(0, 1), -0.5), (pair(1, 2), -0.25)]);
        let differences = |found: &[Pair], deep| {
            let d = truth.differences(found, deep);
            [d.missed, d.missed_deep, d.added]
        };
        assert_eq!(differences(&[pair(0, 1), pair(1, 2)], 0.0), [0, 0, 0]);
        assert_eq!(
            differences(&[pair(2, 3)], 0.3),
            [2, 1, 0],
            "the third and fourth touch, as far as f64 tells"
        );
        assert_eq!(differences(&[pair(0, 1), pair(0, 2), pair(1, 2)], 0.0), [0, 0, 1]);
    }
}

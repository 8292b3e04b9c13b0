//! Random boxes as PBIG's section 6 makes them: how many pairs they have by calculation, and the boxes
//! themselves.

use super::printed::{LENGTHS, NORMAL, SPACE};
use pbig_core::Aabb;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

/// Section 6.1 as it is printed.
pub(super) const UNIFORM: Model = Model::boxes(LENGTHS[0], LENGTHS[1]);

/// Section 6.3 as it is printed.
pub(super) const GAUSSIAN: Model = Model { space: Space::Normal(NORMAL), ..UNIFORM };

/// Section 6.3 by the reading that gives table III: lower corners, lengths from 0.
pub(super) const GAUSSIAN_READ: Model = Model { has_corners: true, lengths: [0.0, LENGTHS[1]], ..GAUSSIAN };

/// The distribution of points along each axis.
#[derive(Clone, Copy, Debug)]
pub(super) enum Space {
    /// Uniform over this length.
    Even(f64),
    /// Normal, with this mean and standard deviation.
    Normal([f64; 2]),
}

/// A law by which boxes are drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Model {
    pub(super) space: Space,
    /// True if lower corners are drawn from the space, false if centres are.
    pub(super) has_corners: bool,
    /// Lengths are uniform between two, on each axis by itself.
    pub(super) lengths: [f64; 2],
}

impl Model {
    /// Boxes whose centres are uniform in the paper's space.
    pub(super) const fn boxes(low: f64, high: f64) -> Self {
        Self { space: Space::Even(SPACE), has_corners: false, lengths: [low, high] }
    }

    pub(super) fn mean_length(&self) -> f64 {
        0.5 * (self.lengths[0] + self.lengths[1])
    }

    /// The mean of a function of the length: the midpoint rule, exact to 10^-5 for the cubics here.
    fn average(&self, of: impl Fn(f64) -> f64) -> f64 {
        const STEPS: usize = 128;
        let [low, high] = self.lengths;
        let step = (high - low) / STEPS as f64;
        (0..STEPS).map(|i| of(low + step * (i as f64 + 0.5))).sum::<f64>() / STEPS as f64
    }

    /// Expected pairs of `n` boxes.
    pub(super) fn pairs(&self, n: usize) -> f64 {
        let n = n as f64;
        0.5 * n * (n - 1.0) * self.chance().0
    }

    /// Standard deviation of the pairs: they come and go one by one, and with sizes and places of all boxes. (The
    /// variance of a U-statistic; `n` boxes with `k` pairs add `4 k^2 / n` times the relative variance of
    /// a box's own chance.)
    pub(super) fn deviation(&self, n: usize) -> f64 {
        let (pairs, relative) = (self.pairs(n), self.chance().1);
        (pairs + 4.0 * pairs * pairs / n as f64 * relative).sqrt()
    }

    /// Returns the deviation of a count in standard deviations, positive if it is larger than expected.
    pub(super) fn off(&self, n: usize, count: u64) -> f64 {
        (count as f64 - self.pairs(n)) / self.deviation(n)
    }

    /// The chance that two boxes overlap, and the relative variance over one box's sizes and places of its
    /// chance to overlap another.
    fn chance(&self) -> (f64, f64) {
        let of_one = |e: f64| self.average(|f| self.on_axis(e, f));
        let (first, second) = (self.average(of_one), self.average(|e| of_one(e).powi(2)));
        (first.powi(3), (second / first.powi(2) * self.crowding()).powi(3) - 1.0)
    }

    /// Along an axis the mean square of a box's chance to meet another, by where it lies, over the square of
    /// its mean. Normal: `2 / sqrt(3)` for every deviation. Even, with mean length `t` of the space: 1 but for
    /// boxes near the border, which have fewer around them; `4 t^2 (1 - 5 t / 6)` over `4 t^2 (1 - t / 2)^2`.
    fn crowding(&self) -> f64 {
        match self.space {
            Space::Even(length) => {
                let t = (self.mean_length() / length).min(0.5);
                (1.0 - 5.0 * t / 6.0) / (1.0 - 0.5 * t).powi(2)
            }
            Space::Normal(_) => 2.0 / 3f64.sqrt(),
        }
    }

    /// The chance that two boxes of given lengths overlap along an axis.
    fn on_axis(&self, e: f64, f: f64) -> f64 {
        if self.has_corners { self.within(e) + self.within(f) } else { 2.0 * self.within(0.5 * (e + f)) }
    }

    /// The chance that one point lies above another by at most `distance`.
    fn within(&self, distance: f64) -> f64 {
        match self.space {
            Space::Even(length) => {
                let share = (distance / length).min(1.0);
                share - 0.5 * share * share
            }
            Space::Normal([_, deviation]) => 0.5 * libm::erf(distance / (2.0 * deviation)),
        }
    }

    /// Draws `n` boxes, the same ones for the same seed.
    pub(super) fn draw(&self, n: usize, seed: u64) -> Vec<Aabb> {
        let mut rng = StdRng::seed_from_u64(seed);
        (0..n).map(|_| self.one(&mut rng)).collect()
    }

    fn one(&self, rng: &mut StdRng) -> Aabb {
        let [low, high] = self.lengths;
        let edges = [(); 3].map(|()| low + (high - low) * rng.random_range(0.0..1.0));
        let shift = if self.has_corners { 0.0 } else { 0.5 };
        let min = edges.map(|edge| self.point(rng) - shift * edge);
        Aabb::new(min.map(|x| x as f32), std::array::from_fn(|k| (min[k] + edges[k]) as f32))
    }

    fn point(&self, rng: &mut StdRng) -> f64 {
        match self.space {
            Space::Even(length) => rng.random_range(0.0..length),
            Space::Normal([mean, deviation]) => mean + deviation * rng.sample::<f64, _>(StandardNormal),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_core::oracle;

    /// Over several seeds the counts are within 4 standard deviations of the mean.
    #[test]
    fn the_expected_pairs_are_those_of_brute_force() {
        let (n, seeds) = (2000, 6);
        let laws = [Model::boxes(900.0, 900.0), Model::boxes(0.0, 1500.0)];
        let spaces = [Space::Even(1e4), Space::Normal([5000.0, 2000.0])];
        let laws = laws.into_iter().flat_map(|law| spaces.map(|space| Model { space, ..law }));
        for law in laws.flat_map(|law| [false, true].map(|has_corners| Model { has_corners, ..law })) {
            let count: usize = (0..seeds).map(|seed| oracle::pairs(&law.draw(n, seed)).len()).sum();
            let mean = count as f64 / seeds as f64;
            let off = (mean - law.pairs(n)) / (law.deviation(n) / (seeds as f64).sqrt());
            assert!(off.abs() < 4.0, "{law:?}: {mean} pairs, {} expected, {off} off", law.pairs(n));
        }
    }
}

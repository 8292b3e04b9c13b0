//! The size of the space in which boxes have a wanted number of pairs.

/// Random edges are replaced by so many typical ones.
const SAMPLES: usize = 32;

/// Edges of boxes of mixed sizes.
const MIXED: [f64; 2] = [0.1, 10.0];

/// Returns the edge at a place from 0 to 1 among the mixed sizes, log-uniform.
pub(super) fn mixed_edge(place: f64) -> f64 {
    MIXED[0] * (MIXED[1] / MIXED[0]).powf(place)
}

/// The law of the boxes: centers uniform in a cube, but for heights of boxes that fall.
pub(super) struct Space {
    /// Edges are mixed; otherwise they are 1.
    pub(super) mixed: bool,
    /// Heights are those of boxes on their way from the top to the bottom, starts uniform in time.
    pub(super) falls: bool,
}

impl Space {
    /// Returns the edge of the cube in which `n` boxes have `pairs` pairs a box.
    pub(super) fn side(&self, n: usize, pairs: f64) -> f64 {
        let (mut low, mut high): (f64, f64) = (0.1, 1e6);
        for _ in 0..60 {
            let middle = (low * high).sqrt();
            if self.pairs(n, middle) > pairs { low = middle } else { high = middle }
        }
        high
    }

    /// Returns the expected pairs a box.
    fn pairs(&self, n: usize, side: f64) -> f64 {
        let edges = self.edges();
        let all = edges.iter().flat_map(|a| edges.iter().map(move |b| 0.5 * (a + b)));
        let chance = |reach: f64| {
            let part = (reach / side).min(1.0);
            let vertical = if self.falls { near_in_a_fall(part) } else { near(part) };
            near(part).powi(2) * vertical
        };
        let mean = all.map(chance).sum::<f64>() / (edges.len() * edges.len()) as f64;
        0.5 * n.saturating_sub(1) as f64 * mean
    }

    fn edges(&self) -> Vec<f64> {
        if !self.mixed {
            return vec![1.0];
        }
        (0..SAMPLES).map(|i| mixed_edge((i as f64 + 0.5) / SAMPLES as f64)).collect()
    }
}

/// Returns the chance that two numbers, uniform from 0 to 1, differ by at most `part`.
fn near(part: f64) -> f64 {
    part * (2.0 - part)
}

/// Returns the chance that the squares of two such numbers differ by at most `part`: a fall covers the square of its time.
///
/// It is twice the integral, over the lower number s, of min(1, sqrt(s^2 + part)) - s.
fn near_in_a_fall(part: f64) -> f64 {
    1.0 - (1.0 - part).sqrt() + part * (1.0 / part - 1.0).sqrt().asinh()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chances_are_those_of_counted_numbers() {
        const N: usize = 1000;
        let place = |i: usize| (i as f64 + 0.5) / N as f64;
        for part in [0.01, 0.1, 0.5, 1.0] {
            let counted = |of: fn(f64) -> f64| {
                let close =
                    |i: usize| (0..N).filter(|&j| (of(place(i)) - of(place(j))).abs() <= part).count();
                (0..N).map(close).sum::<usize>() as f64 / (N * N) as f64
            };
            assert!((near(part) - counted(|x| x)).abs() < 0.003, "{part}");
            assert!((near_in_a_fall(part) - counted(|x| x * x)).abs() < 0.003, "{part}");
        }
    }
}

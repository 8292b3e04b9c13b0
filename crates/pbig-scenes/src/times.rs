//! The times of frames, and their summary. Nothing here uses rapier or reads a clock.

/// Milliseconds of one frame, without its checks.
#[derive(Clone, Copy, Debug, Default)]
pub struct StepTime {
    /// Time inside the broad phase, over all its calls.
    pub broad_phase: f64,
    /// Time of the whole step, the broad phase included.
    pub step: f64,
    /// Scene queries after the step, with the upkeep of an index that the first of them causes.
    pub queries: f64,
    pub frame: f64,
}

/// Figures of some times; zeros for none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    pub mean: f64,
    /// The median; of an even count, the upper of the two in the middle.
    pub median: f64,
    /// The 99th percentile: the smallest time that at least 99% of the times do not exceed.
    pub p99: f64,
    pub max: f64,
}

impl Summary {
    pub fn of(times: impl IntoIterator<Item = f64>) -> Self {
        let mut times: Vec<f64> = times.into_iter().collect();
        times.sort_unstable_by(f64::total_cmp);
        let rank = (times.len() * 99).div_ceil(100);
        match times.get(rank.wrapping_sub(1)) {
            None => Self::default(),
            Some(&p99) => {
                let mean = times.iter().sum::<f64>() / times.len() as f64;
                Self { mean, median: times[times.len() / 2], p99, max: times[times.len() - 1] }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn p99_is_the_nearest_rank() {
        let summary = |mean, median, p99, max| Summary { mean, median, p99, max };
        assert_eq!(Summary::of([]), Summary::default());
        assert_eq!(Summary::of([3.0]), summary(3.0, 3.0, 3.0, 3.0));
        assert_eq!(Summary::of((1..=100).map(f64::from)), summary(50.5, 51.0, 99.0, 100.0));
        assert_eq!(Summary::of((1..=101).rev().map(f64::from)), summary(51.0, 51.0, 100.0, 101.0));
    }
}

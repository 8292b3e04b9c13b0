//! The times of one case, frame by frame, and what they come to.

use crate::bench::table::{Row, Target};

/// Columns of the CSV.
pub(super) const HEAD: &str = "motion,density,boxes,threads,what,mean_ms,median_ms,p99_ms,worst_ms,first_ms";

/// The name of our side.
pub(super) const OURS: &str = "ours";

/// One way to do the work.
pub(super) struct Side {
    pub(super) what: &'static str,
    pub(super) threads: usize,
    /// Milliseconds by frame; the first is the one in which everything is new.
    pub(super) ms: Vec<f64>,
}

impl Side {
    /// Returns the name in tables and charts.
    pub(super) fn label(&self) -> &'static str {
        if (self.what, self.threads) == (OURS, 1) { "ours on one thread" } else { self.what }
    }
}

/// Milliseconds of some frames; all but `first` leave out the first frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Figures {
    pub(super) mean: f64,
    pub(super) median: f64,
    pub(super) p99: f64,
    pub(super) worst: f64,
    pub(super) first: f64,
}

impl Figures {
    pub(super) fn of(ms: &[f64]) -> Self {
        let Some((&first, rest)) = ms.split_first() else { return Self::default() };
        let mut sorted = rest.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let Some(&worst) = sorted.last() else { return Self { first, ..Self::default() } };
        let count = sorted.len();
        // By nearest rank.
        let p99 = sorted[(99 * count).div_ceil(100) - 1];
        let mean = sorted.iter().sum::<f64>() / count as f64;
        Self { mean, median: sorted[count / 2], p99, worst, first }
    }
}

/// The targets for ours.
#[derive(Clone, Copy, Default)]
pub(super) struct Wanted {
    /// Against a side of this name: the other's mean over ours.
    pub(super) faster: Option<(&'static str, f64)>,
    /// Against a side of this name: our mean over the other's at most.
    pub(super) within: Option<(&'static str, f64)>,
    /// Every frame has as much work, so p99 and worst stay near the median.
    pub(super) is_even: bool,
}

/// All sides on the same boxes; the first is ours.
pub(super) struct Case {
    /// The motion, or the scene.
    pub(super) motion: &'static str,
    /// The density, or "scene".
    pub(super) density: &'static str,
    /// Boxes, or bodies of a scene.
    pub(super) boxes: usize,
    /// Pairs at the end.
    pub(super) pairs: u64,
    pub(super) sides: Vec<Side>,
    pub(super) wanted: Wanted,
}

impl Case {
    pub(super) fn name(&self) -> String {
        format!("{}, {}", self.motion, self.density)
    }

    /// Returns a row for ours beside each other side, then those of p99 and worst beside the median. The first row has
    /// the figures of ours.
    pub(super) fn rows(&self, quick: bool) -> Vec<Row> {
        let Some((ours, others)) = self.sides.split_first() else { return vec![] };
        let ours = Figures::of(&ours.ms);
        let Figures { mean, median, p99, worst, first } = ours;
        let figures = vec![("median", median), ("p99", p99), ("worst", worst), ("first", first)];
        let beside = others.iter().zip([figures].into_iter().chain(std::iter::repeat(vec![])));
        let beside = beside.map(|(other, figures)| self.beside(mean, other, quick).stages(figures));
        beside.chain(self.evenness(&ours, quick)).collect()
    }

    fn beside(&self, mean: f64, other: &Side, quick: bool) -> Row {
        let theirs = Figures::of(&other.ms);
        let note = format!(
            "{}: median {:.4} ms, p99 {:.4} ms, worst {:.4} ms, first {:.4} ms",
            other.label(),
            theirs.median,
            theirs.p99,
            theirs.worst,
            theirs.first
        );
        self.row(self.name())
            .ours(mean)
            .against(other.label(), theirs.mean)
            .target(self.target(other.what).filter(|_| !quick))
            .note(note)
    }

    fn target(&self, other: &str) -> Option<Target> {
        let of = |wanted: Option<(&str, f64)>| wanted.filter(|(name, _)| *name == other).map(|(_, x)| x);
        of(self.wanted.faster).map(Target::Faster).or(of(self.wanted.within).map(Target::Within))
    }

    fn evenness(&self, ours: &Figures, quick: bool) -> Vec<Row> {
        if !self.wanted.is_even {
            return vec![];
        }
        let row = |name: &str, value: f64, most: f64| {
            let target = (!quick).then_some(Target::Within(most));
            self.row(format!("{}, {name}", self.name()))
                .ours(value)
                .against("median", ours.median)
                .target(target)
        };
        vec![row("p99", ours.p99, 1.3), row("worst", ours.worst, 2.0)]
    }

    fn row(&self, name: String) -> Row {
        Row::new(name, self.boxes, self.pairs)
    }

    /// Returns the lines of the CSV.
    pub(super) fn lines(&self) -> Vec<String> {
        let line = |side: &Side| {
            let Figures { mean, median, p99, worst, first } = Figures::of(&side.ms);
            format!(
                "{},{},{},{},{},{mean:.6},{median:.6},{p99:.6},{worst:.6},{first:.6}",
                self.motion, self.density, self.boxes, side.threads, side.what
            )
        };
        self.sides.iter().map(line).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case() -> Case {
        let side = |what, ms: &[f64]| Side { what, threads: 2, ms: ms.to_vec() };
        let sides = vec![side(OURS, &[9.0, 1.0, 2.0, 6.0]), side("parry", &[8.0, 12.0, 12.0, 12.0])];
        let wanted = Wanted { faster: Some(("parry", 4.0)), is_even: true, ..Wanted::default() };
        Case { motion: "drift", density: "dense", boxes: 10, pairs: 3, sides, wanted }
    }

    #[test]
    fn figures_by_hand() {
        let figures = Figures { mean: 3.0, median: 2.0, p99: 6.0, worst: 6.0, first: 9.0 };
        assert_eq!(Figures::of(&[9.0, 1.0, 2.0, 6.0]), figures);
        let many: Vec<f64> = std::iter::once(0.0).chain((1..=200).map(f64::from)).collect();
        assert_eq!((Figures::of(&many).p99, Figures::of(&many).worst), (198.0, 200.0));
        assert_eq!(Figures::of(&[5.0]), Figures { first: 5.0, ..Figures::default() });
    }

    #[test]
    fn a_row_compares_means_and_evenness_is_about_the_median() {
        let rows = case().rows(false);
        assert_eq!((rows.len(), rows[0].ratio(), rows[0].met()), (3, Some(4.0), Some(true)));
        assert_eq!((rows[1].ratio(), rows[1].met()), (Some(2.0 / 6.0), Some(false)));
        assert!(case().rows(true).iter().all(|row| row.met().is_none()), "no targets for a quick run");
    }

    #[test]
    fn a_line_has_every_column() {
        let lines = case().lines();
        assert_eq!(lines[0], "drift,dense,10,2,ours,3.000000,2.000000,6.000000,6.000000,9.000000");
        assert!(lines.iter().all(|line| line.split(',').count() == HEAD.split(',').count()));
    }
}

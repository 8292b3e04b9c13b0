//! Whether the default margin is the right one, as far as the times can tell.

use super::tally::MARGINS;
use super::{Row, STEP, Time, default_margin, fastest, largest_extra};
use pbig_harness::runner::Spread;

/// A margin's time over the default's.
pub(super) struct Against {
    /// Geometric mean over cases and passes.
    pub(super) times: f64,
    /// Of that mean: two standard errors, %.
    pub(super) noise: f64,
}

pub(super) fn against_default(rows: &[Row], margin: usize, time: &Time) -> Against {
    let of_case = |case: &[Row]| log_ratios(case, margin, time);
    let cases: Vec<Vec<f64>> = rows.chunks_exact(MARGINS.len()).filter_map(of_case).collect();
    let count = cases.len().max(1) as f64;
    let means: Vec<f64> = cases.iter().map(|passes| mean(passes)).collect();
    // Cases are independent, so variances add up: the error of their mean is less than that of one case.
    let of_passes = cases.iter().map(|passes| variance_of_mean(passes)).sum::<f64>() / (count * count);
    // Other cases would have told something else: passes are part of how they differ, but for too few cases to tell.
    let variance = of_passes.max(variance_of_mean(&means));
    Against { times: mean(&means).exp(), noise: ((2.0 * variance.sqrt()).exp() - 1.0) * 100.0 }
}

/// By pass: within one, both margins met the same disturbances. None where the case has no such time.
fn log_ratios(case: &[Row], margin: usize, Time { of, in_pass, .. }: &Time) -> Option<Vec<f64>> {
    let (one, default) = (&case[margin], &case[default_margin()]);
    of(one)?;
    Some(one.passes.iter().zip(&default.passes).map(|(a, b)| (in_pass(a) / in_pass(b)).ln()).collect())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn variance_of_mean(values: &[f64]) -> f64 {
    let (mean, count) = (mean(values), values.len() as f64);
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    squares / (count - 1.0).max(1.0) / count.max(1.0)
}

/// By how much passes differ for one margin in one case, in the middle; %. Of the cases that have such a time.
fn noise_of_a_case(rows: &[Row], Time { of, in_pass, .. }: &Time) -> f64 {
    let differ = |row: &Row| {
        let times = || row.passes.iter().map(in_pass);
        times().fold(0.0, f64::max) / times().fold(f64::MAX, f64::min) - 1.0
    };
    Spread::of(rows.iter().filter(|row| of(row).is_some()).map(differ)).median * 100.0
}

/// In how many of how many cases the default takes as long as the fastest margin, but for the noise of a case.
fn as_fast(rows: &[Row], time: &Time) -> (usize, usize) {
    let times = rows.chunks(MARGINS.len()).filter_map(|case| Some(fastest(case, time)?.1));
    let limit = 1.0 + noise_of_a_case(rows, time) / 100.0;
    (times.clone().filter(|times| *times <= limit).count(), times.count())
}

/// The fastest margin over all cases; by how many percent the default takes longer, and the noise of that.
struct Best {
    margin: usize,
    longer: f64,
    noise: f64,
}

impl Best {
    fn of(rows: &[Row], time: &Time) -> Self {
        let all = (0..MARGINS.len()).map(|margin| (margin, against_default(rows, margin, time)));
        let least = all.min_by(|a, b| a.1.times.total_cmp(&b.1.times));
        let (margin, Against { times, noise }) = least.expect("there are margins");
        Self { margin, longer: (1.0 / times - 1.0) * 100.0, noise }
    }

    fn is_default(&self) -> bool {
        self.margin == default_margin()
    }

    /// Whether it is faster than the default by more than the noise.
    fn is_better(&self) -> bool {
        !self.is_default() && self.longer > self.noise
    }
}

/// How the default is chosen, and what the times say to that.
pub(super) fn criterion(rows: &[Row]) -> String {
    let (default, best) = (MARGINS[default_margin()], Best::of(rows, &STEP));
    let verdict = match (best.is_default(), best.is_better()) {
        (true, _) => "it is supported: no other is as fast".to_owned(),
        (_, false) => format!("it stands, but cannot be told from {}", MARGINS[best.margin]),
        (_, true) => format!("it does not stand: {} is faster", MARGINS[best.margin]),
    };
    format!(
        "Criterion: the default, {default}, which is also what rapier's own broad phase has, stands while no \
         other margin makes the whole step of rapier faster, in the geometric mean over all cases, by more than \
         the noise of that mean. By these times {verdict}. The noise of a mean is two of its standard errors, \
         from how the ratio of two margins differs from case to case, or from pass to pass if that is more. (The fastest of {} margins is \
         partly so by chance.)",
        MARGINS.len()
    )
}

/// Which margin is fastest over all, and whether that is far from the default.
pub(super) fn over_all(rows: &[Row], time: &Time) -> String {
    let (default, best) = (MARGINS[default_margin()], Best::of(rows, time));
    let (longer, noise) = (best.longer, best.noise);
    let verdict = match (best.is_default(), best.is_better()) {
        (true, _) => "that is the default".to_owned(),
        (_, false) => {
            format!(
                "the default, {default}, takes {longer:.1}% longer, within the noise of that mean, {noise:.1}%"
            )
        }
        (_, true) => {
            format!(
                "the default, {default}, takes {longer:.1}% longer, more than the noise of that mean, {noise:.1}%"
            )
        }
    };
    let (as_fast, cases) = as_fast(rows, time);
    format!(
        "For {}, over {cases} cases, a margin of {} is fastest: {verdict}. It has at most {:.1}% extra pairs in \
         any case, the default {:.1}%. In {as_fast} of {cases} cases the default is as fast as any, but for the \
         noise of one case: passes of the same steps differ by {:.1}%, the median.",
        time.what,
        MARGINS[best.margin],
        largest_extra(rows, best.margin),
        largest_extra(rows, default_margin()),
        noise_of_a_case(rows, time)
    )
}

/// Which margin is fastest for the whole step where one scene does not count: it may be a special one.
pub(super) fn without_each_scene(rows: &[Row]) -> String {
    let mut scenes: Vec<&str> = rows.iter().filter(|row| row.step.is_some()).map(scene).collect();
    scenes.sort_unstable();
    scenes.dedup();
    let told = scenes.into_iter().map(|left_out| {
        let others: Vec<Row> = rows.iter().filter(|row| scene(row) != left_out).cloned().collect();
        let Best { margin, longer, noise } = Best::of(&others, &STEP);
        format!("{left_out}: {}, {longer:.1}% (noise {noise:.1}%)", MARGINS[margin])
    });
    format!(
        "With one scene left out, which margin is fastest for the whole step, and how much longer the default \
         takes: {}.",
        told.collect::<Vec<_>>().join("; ")
    )
}

fn scene(row: &Row) -> &str {
    row.case.split(' ').next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::super::tests::made;
    use super::super::{BROAD_PHASE, MARGINS};
    use super::*;

    #[test]
    fn cases_count_alike_whatever_their_size() {
        let mut cases = [[1.0; MARGINS.len()], [100.0; MARGINS.len()]];
        (cases[0][4], cases[1][4]) = (0.4, 100.0 / 6.4);
        let rows = made(&cases, true);
        assert!((against_default(&rows, 4, &BROAD_PHASE).times - 0.25).abs() < 1e-12);
        let told = over_all(&rows, &STEP);
        assert!(
            told.contains("a margin of 0.05") && told.contains("300.0% longer, more than the noise"),
            "{told}"
        );
        assert!(told.contains("at most 4.0% extra pairs in any case, the default 2.0%"), "{told}");
        assert!(told.contains("In 0 of 2 cases the default is as fast"), "{told}");
    }

    #[test]
    fn the_noise_of_a_mean_is_less_than_that_of_a_case() {
        let mut case = [1.0; MARGINS.len()];
        case[0] = 0.99;
        // Two passes 2% apart: an error of 1% for their mean, of a quarter of that for the mean of 16 cases.
        for (cases, noise) in [(1, 2.02), (16, 0.501)] {
            let found = against_default(&made(&vec![case; cases], true), 0, &BROAD_PHASE);
            assert!((found.noise - noise).abs() < 5e-3, "{cases} cases: {}", found.noise);
        }
        let told = over_all(&made(&[case], true), &BROAD_PHASE);
        assert!(told.contains("1.0% longer, within the noise of that mean, 2.0%"), "{told}");
        assert!(told.contains("In 1 of 1 cases the default is as fast"), "{told}");
        let told = over_all(&made(&[case; 16], true), &BROAD_PHASE);
        assert!(told.contains("1.0% longer, more than the noise of that mean, 0.5%"), "{told}");
    }

    #[test]
    fn the_criterion_is_met_or_not() {
        let told = |first: f64, default: f64, cases: usize| {
            let mut case = [1.0; MARGINS.len()];
            (case[0], case[default_margin()]) = (first, default);
            criterion(&made(&vec![case; cases], true))
        };
        assert!(told(1.0, 0.9, 1).contains("it is supported"), "{}", told(1.0, 0.9, 1));
        assert!(told(0.99, 1.0, 1).contains("cannot be told from 0."), "{}", told(0.99, 1.0, 1));
        assert!(told(0.99, 1.0, 16).contains("does not stand: 0 is faster"), "{}", told(0.99, 1.0, 16));
    }

    #[test]
    fn what_differs_from_case_to_case_is_not_told_by_their_mean() {
        let mut cases = [[1.0; MARGINS.len()]; 16];
        cases.iter_mut().step_by(2).for_each(|case| case[0] = 0.8);
        let told = criterion(&made(&cases, true));
        assert!(told.contains("does not stand: 0 is faster"), "{told}");
        cases.iter_mut().skip(1).step_by(2).for_each(|case| case[0] = 1.2);
        let told = criterion(&made(&cases, true));
        assert!(told.contains("cannot be told from 0."), "{told}");
    }

    #[test]
    fn a_scene_that_decides_alone_is_seen() {
        let mut case = [1.0; MARGINS.len()];
        case[0] = 0.5;
        let of = |scene: &str, cases: &[[f64; MARGINS.len()]]| {
            let named = |row| Row { case: format!("{scene} 1000, from step 3"), ..row };
            made(cases, true).into_iter().map(named).collect::<Vec<_>>()
        };
        let mut others = [1.0; MARGINS.len()];
        others[0] = 1.25;
        let told = without_each_scene(&[of("pile", &[case]), of("rain", &[others])].concat());
        assert!(told.contains("pile: 0.005, 0.0%") && told.contains("rain: 0, 100.0%"), "{told}");
    }

    #[test]
    fn cases_without_a_step_have_no_part_in_that_of_steps() {
        let slow = made(&[[1.0, 1.0, 9.0, 1.0, 1.0, 1.0, 1.0, 1.0]], false);
        let rows: Vec<Row> = made(&[[1.0; MARGINS.len()]], true).into_iter().chain(slow).collect();
        assert!((against_default(&rows, 0, &STEP).times - 1.0).abs() < 1e-12);
        assert!(against_default(&rows, 0, &BROAD_PHASE).times < 0.4);
    }
}

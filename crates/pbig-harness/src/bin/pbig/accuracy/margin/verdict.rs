//! The verdict on the default margin, as far as times can tell.

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

/// A margin held against the default: by how many percent the default takes longer over all cases, and the noise of that.
struct Rival {
    margin: usize,
    longer: f64,
    noise: f64,
}

impl Rival {
    fn new(rows: &[Row], margin: usize, time: &Time) -> Self {
        let Against { times, noise } = against_default(rows, margin, time);
        Self { margin, longer: (1.0 / times - 1.0) * 100.0, noise }
    }

    /// Every margin, the default too; the fastest first.
    fn all(rows: &[Row], time: &Time) -> Vec<Self> {
        let mut all: Vec<_> = (0..MARGINS.len()).map(|margin| Self::new(rows, margin, time)).collect();
        all.sort_by(|a, b| b.longer.total_cmp(&a.longer));
        all
    }

    fn is_default(&self) -> bool {
        self.margin == default_margin()
    }

    /// Returns true if it is faster than the default by more than the noise.
    fn is_better(&self) -> bool {
        !self.is_default() && self.longer > self.noise
    }

    /// Scenes each of which it owes the whole step's being faster to: left out, it is not.
    fn deciding<'a>(&self, rows: &'a [Row]) -> Vec<&'a str> {
        let is_better_without =
            |scene: &str| Self::new(&without(rows, scene), self.margin, &STEP).is_better();
        scenes(rows).into_iter().filter(|scene| !is_better_without(scene)).collect()
    }

    fn told(&self) -> String {
        let Self { margin, longer, noise } = self;
        format!("{} (the default takes {longer:.1}% longer, noise {noise:.1}%)", MARGINS[*margin])
    }
}

/// Says how the default was chosen, and compares that with the times.
pub(super) fn criterion(rows: &[Row]) -> String {
    format!(
        "Criterion. The default, {}, is what rapier's own broad phase has. Another margin would replace it if it made the \
         whole step of rapier faster, in the geometric mean over all cases, by more than the noise of that mean; and if it \
         still did with any one scene left out, which may be a special one. By these times {}. The noise of a mean is two of \
         its standard errors, in percent of it. They come from how the ratio of two margins differs from case to case, or \
         from pass to pass if that is more. So if ratios were normal, a given margin that takes as long as the default would \
         seem faster by more than the noise in 2.3% of runs. (The fastest of {} margins is partly so by chance.)",
        MARGINS[default_margin()],
        verdict(rows),
        MARGINS.len()
    )
}

fn verdict(rows: &[Row]) -> String {
    let all = Rival::all(rows, &STEP);
    let better = all.iter().filter(|rival| rival.is_better()).map(|rival| (rival, rival.deciding(rows)));
    let (proven, alone): (Vec<_>, Vec<_>) = better.partition(|(_, deciding)| deciding.is_empty());
    let fastest = &all[0];
    match (proven.first(), &alone[..]) {
        (Some((rival, _)), _) => {
            format!("it does not stand: {} is faster, whichever scene is left out", rival.told())
        }
        (None, [_, ..]) => {
            let each = alone.iter().map(|(rival, deciding)| by_a_scene(rival, deciding, rows));
            format!("it stands: {}", each.collect::<Vec<_>>().join("; "))
        }
        _ if fastest.is_default() => "it is supported: no other is as fast".to_owned(),
        _ => format!("it stands: the fastest, {}, is not faster by more than the noise", fastest.told()),
    }
}

/// A rival that owes it to some scenes: without each of these the default takes longer by no more than the noise.
fn by_a_scene(rival: &Rival, deciding: &[&str], rows: &[Row]) -> String {
    let left_out = |scene: &&str| {
        let rows = without(rows, scene);
        if scenes(&rows).is_empty() {
            return format!("without {scene} no scene is left");
        }
        let Rival { longer, noise, .. } = Rival::new(&rows, rival.margin, &STEP);
        format!("without {scene} the default takes {longer:.1}% longer, noise {noise:.1}%")
    };
    let left_out: Vec<String> = deciding.iter().map(left_out).collect();
    format!("{} is faster over all cases, but {}", rival.told(), left_out.join(", and "))
}

/// Which margin is fastest over all, and whether that is far from the default.
pub(super) fn over_all(rows: &[Row], time: &Time) -> String {
    let (default, best) = (MARGINS[default_margin()], &Rival::all(rows, time)[0]);
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
    let told = scenes(rows).into_iter().map(|left_out| {
        let rows = without(rows, left_out);
        if scenes(&rows).is_empty() {
            return format!("{left_out}: no scene is left");
        }
        let Rival { margin, longer, noise } = Rival::all(&rows, &STEP)[0];
        format!("{left_out}: {}, {longer:.1}% (noise {noise:.1}%)", MARGINS[margin])
    });
    format!(
        "With one scene left out, which margin is fastest for the whole step, and how much longer the default \
         takes: {}.",
        told.collect::<Vec<_>>().join("; ")
    )
}

/// Each once, of the cases that have a whole step.
fn scenes(rows: &[Row]) -> Vec<&str> {
    let mut scenes: Vec<&str> = rows.iter().filter(|row| row.step.is_some()).map(scene).collect();
    scenes.sort_unstable();
    scenes.dedup();
    scenes
}

fn scene(row: &Row) -> &str {
    row.case.split(' ').next().unwrap_or_default()
}

fn without(rows: &[Row], left_out: &str) -> Vec<Row> {
    rows.iter().filter(|row| scene(row) != left_out).cloned().collect()
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

    const EVEN: [f64; MARGINS.len()] = [1.0; MARGINS.len()];

    /// A case of each of some scenes in which the first margin takes so long.
    fn scenes_of(first: &[(&str, f64)]) -> Vec<Row> {
        let of = |&(scene, ms): &(&str, f64)| {
            let mut case = EVEN;
            case[0] = ms;
            let named = |row| Row { case: format!("{scene} 1000, from step 3"), ..row };
            made(&[case], true).into_iter().map(named).collect::<Vec<_>>()
        };
        first.iter().flat_map(of).collect()
    }

    #[test]
    fn the_criterion_is_met_or_not() {
        let told = |first: f64, default: f64, scenes: &[&str]| {
            let mut rows = scenes_of(&scenes.iter().map(|scene| (*scene, first)).collect::<Vec<_>>());
            for row in rows.iter_mut().skip(default_margin()).step_by(MARGINS.len()) {
                row.passes.iter_mut().for_each(|time| time.step *= default);
            }
            criterion(&rows)
        };
        let many = ["a", "b", "c", "d", "e", "f", "g", "h", "i"];
        assert!(told(1.0, 0.9, &many).contains("it is supported"), "{}", told(1.0, 0.9, &many));
        let one = told(0.99, 1.0, &["a"]);
        let noise = "it stands: the fastest, 0 (the default takes 1.0% longer, noise 2.0%), is not faster by more than";
        assert!(one.contains(noise), "{one}");
        let told = told(0.99, 1.0, &many);
        let whichever =
            "it does not stand: 0 (the default takes 1.0% longer, noise 0.7%) is faster, whichever scene";
        assert!(told.contains(whichever), "{told}");
    }

    #[test]
    fn what_differs_from_case_to_case_is_not_told_by_their_mean() {
        let told = |others: f64| {
            criterion(&scenes_of(&[
                ("a", 0.8),
                ("b", others),
                ("c", 0.8),
                ("d", others),
                ("e", 0.8),
                ("f", others),
            ]))
        };
        assert!(told(0.9).contains("does not stand: 0 ("), "{}", told(0.9));
        assert!(told(1.2).contains("is not faster by more than the noise"), "{}", told(1.2));
    }

    /// Another margin is faster over all cases, but by more than the noise only with what one scene adds.
    #[test]
    fn a_scene_that_decides_alone_decides_nothing() {
        let rows = scenes_of(&[("pile", 0.9), ("pile", 0.9), ("pile", 0.9), ("rain", 1.0), ("column", 0.99)]);
        let told = criterion(&rows);
        let but = "is faster over all cases, but without pile the default takes";
        assert!(told.contains("it stands: 0 (the default takes 6.") && told.contains(but), "{told}");
        assert!(told.contains("without pile the default takes 0.5% longer, noise 1."), "{told}");
        let told = criterion(&scenes_of(&[("pile", 0.9), ("pile", 0.9), ("rain", 0.9), ("rain", 0.9)]));
        assert!(told.contains("does not stand"), "{told}");
        // Another one is faster in every scene, though by less.
        let mut rows = rows;
        for row in rows.iter_mut().skip(1).step_by(MARGINS.len()) {
            row.passes.iter_mut().for_each(|time| time.step *= 0.98);
        }
        let told = criterion(&rows);
        assert!(told.contains("does not stand: 0.005 (the default takes 2.0% longer"), "{told}");
        // Of a single scene nothing is left.
        let told = criterion(&scenes_of(&[("pile", 0.9), ("pile", 0.9)]));
        assert!(told.contains("is faster over all cases, but without pile no scene is left"), "{told}");
        let rival = Rival { margin: 0, longer: 1.0, noise: 0.5 };
        let told = by_a_scene(&rival, &["pile", "rain"], &scenes_of(&[("pile", 0.5), ("rain", 0.8)]));
        let each = "without pile the default takes 25.0% longer, noise 2.0%, and without rain the default takes 100.0% longer";
        assert!(told.contains(each), "{told}");
    }

    #[test]
    fn the_fastest_without_each_scene_is_told() {
        let told = without_each_scene(&scenes_of(&[("pile", 0.5), ("rain", 1.25)]));
        assert!(told.contains("pile: 0.005, 0.0%") && told.contains("rain: 0, 100.0%"), "{told}");
        let told = without_each_scene(&scenes_of(&[("pile", 0.5)]));
        assert!(told.ends_with("takes: pile: no scene is left."), "{told}");
    }

    #[test]
    fn cases_without_a_step_have_no_part_in_that_of_steps() {
        let slow = made(&[[1.0, 1.0, 9.0, 1.0, 1.0, 1.0, 1.0, 1.0]], false);
        let rows: Vec<Row> = made(&[[1.0; MARGINS.len()]], true).into_iter().chain(slow).collect();
        assert!((against_default(&rows, 0, &STEP).times - 1.0).abs() < 1e-12);
        assert!(against_default(&rows, 0, &BROAD_PHASE).times < 0.4);
    }
}

//! Part of `pbig bench stages`: events by the share that moves, by each way to make them; where each wins.

mod race;

use super::measure::{Effort, Took};
use super::regret::{regret, winners};
use super::stages::counted;
use super::table::Row;
use crate::output::{Failure, progress};
use pbig_harness::boxes::cubes;
use pbig_harness::chart::{Line, LogLog};
use race::{ASKED, MEANS, NAMES, Race};
use std::time::Duration;

/// How far boxes go, along each axis, in edges: a part of one, or so far that near pairs would be too many for a list.
const MOTIONS: [(&str, f32); 2] = [("small moves", 0.1), ("jumps", 3.0)];

const SHARES: [f64; 13] = [0.003, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0];

/// Shares at which PBIG's grid takes part.
const WITH_PBIG: [f64; 3] = [0.01, 0.1, 1.0];

/// What each way took at a share, if updates went that way.
type Sides = Vec<Option<Took>>;

/// Rows and a chart for each motion, and in words where each way wins.
pub(super) fn run(
    quick: bool,
    rows: &mut Vec<Row>,
    charts: &mut Vec<LogLog>,
) -> Result<Vec<String>, Failure> {
    let n = if quick { 5000 } else { 100_000 };
    let shares = if quick { &[0.01, 0.1, 1.0] } else { &SHARES[..] };
    let effort =
        Effort { budget: Duration::from_millis(if quick { 100 } else { 2500 }), ..Effort::new(quick) };
    let bar = progress(MOTIONS.len() * shares.len(), "shares");
    let mut notes = vec![about()];
    for motion in MOTIONS {
        let mut took = Vec::new();
        for &share in shares {
            let mut race = Race::new(cubes(n, 1.0, 1.0, 1), share, motion.1, WITH_PBIG.contains(&share))?;
            let sides = race.run_all(effort)?;
            rows.push(row(motion.0, share, n, &race, &sides, effort)?);
            took.push((share, sides));
            bar.inc(1);
        }
        let lines = means(&took);
        notes.extend(in_words(motion.0, &lines));
        charts.push(chart(motion.0, n, lines, &took));
    }
    bar.finish_and_clear();
    Ok(notes)
}

fn about() -> String {
    let [small, jumps] = MOTIONS.map(|(name, distance)| format!("{name} are of up to {distance} edges"));
    format!(
        "events by share: {small}, {jumps}. Ours is `BroadPhase` as planned; beside it `BroadPhase` made to go one way \
         (`Config::study`: edits, a grid anew, near pairs), where at least half of the updates could: \
         edits leave some to a search of all once the order is used up, and so does what has no list. Then `Finder` with \
         sorted lists of which one is merged with the one before, and at some shares `BroadPhase` with \
         `Strategy::Pbig`. What the plan chose in how many updates comes last. Pairs and events of all were compared in \
         number, and agree"
    )
}

fn row(
    motion: &str,
    share: f64,
    boxes: usize,
    race: &Race,
    sides: &[Option<Took>],
    effort: Effort,
) -> Result<Row, Failure> {
    let planned = sides[0].unwrap_or(Took { median: 0.0, mean: 0.0 });
    let there = sides.iter().enumerate().skip(1).filter_map(|(k, took)| took.map(|took| (k, took)));
    let stages = there.flat_map(|(k, took)| [(NAMES[k], took.median), (MEANS[k], took.mean)]).collect();
    let row = Row::new(format!("events by share, {motion}, {}% moved", percent(share)), boxes, race.pairs()?);
    let chosen = counted(race.chosen[0].get(effort.warm_up..).unwrap_or(&[]));
    Ok(row.ours(planned.median).mean(planned.mean).stages(stages).note(chosen))
}

/// Without the digits that binary fractions add.
fn percent(share: f64) -> f64 {
    (share * 1e4).round() / 1e2
}

/// The means of each way, by share.
fn means(took: &[(f64, Sides)]) -> Vec<Line> {
    let point = |k: usize| {
        move |(share, sides): &(f64, Sides)| sides.get(k).copied().flatten().map(|took| (*share, took.mean))
    };
    let line = |k: usize| Line { name: NAMES[k].into(), points: took.iter().filter_map(point(k)).collect() };
    (0..NAMES.len()).map(line).collect()
}

/// Which way takes least at which shares, by the means, and how far what is planned is from the best.
fn in_words(motion: &str, lines: &[Line]) -> Vec<String> {
    let at = |share: f64| format!("{}%", percent(share));
    let asked: Vec<&Line> = lines[ASKED].iter().collect();
    let others: Vec<&Line> = lines[1..].iter().collect();
    let told = regret(&lines[0], &asked, at).map_or(String::new(), |told| format!("; {told}"));
    vec![
        format!(
            "events by share, {motion}: of edits, a grid anew and near pairs least by the mean: {}{told}",
            winners(&asked, at)
        ),
        format!(
            "events by share, {motion}: of all but what is planned least by the mean: {}",
            winners(&others, at)
        ),
    ]
}

fn chart(motion: &str, boxes: usize, mut lines: Vec<Line>, took: &[(f64, Sides)]) -> LogLog {
    let median = |(share, sides): &(f64, Sides)| sides[0].map(|took| (*share, took.median));
    lines.iter_mut().for_each(|line| line.name.push_str(", mean"));
    lines.push(Line { name: "as planned, median".into(), points: took.iter().filter_map(median).collect() });
    LogLog {
        name: format!("stages-events-{}", motion.replace(' ', "-")),
        title: format!("events of {boxes} boxes, {motion}: where each way wins"),
        x: "share moved",
        y: "ms",
        lines: lines.into_iter().filter(|line| !line.points.is_empty()).collect(),
        exponents: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_that_were_not_taken_win_nowhere_and_regret_is_of_those_that_can_be_asked_for() {
        let took = |mean| Some(Took { median: 1.0, mean });
        let took = [
            (0.01, vec![took(1.2), took(1.0), took(9.0), took(2.0), took(0.5)]),
            (1.0, vec![took(4.0), None, took(4.0), took(3.2), took(5.0)]),
        ];
        let lines = means(&took);
        assert_eq!(lines[1].points, [(0.01, 1.0)]);
        let [asked, all] = &in_words("jumps", &lines)[..] else { panic!("two notes") };
        assert!(
            asked.contains("least by the mean: edits at 1%; near pairs at 100%; as planned takes 1.25"),
            "{asked}"
        );
        assert!(asked.contains("at worst, at 100%, and 1.22 times on average"), "{asked}");
        assert!(all.ends_with("near pairs at 100%; from scratch and diff at 1%"), "{all}");
        let chart = chart("jumps", 10, lines, &took);
        assert_eq!(chart.lines.len(), 6, "five ways and a median; PBIG's grid took no part");
    }
}

//! Times of hard worlds, on which a grid of one cell size takes quadratic time, and of hard histories of updates.

use pbig_core::{Aabb, BroadPhase, Config, Engine, Finder};
use pbig_harness::hard::{History, histories, shapes, tell};
use pbig_harness::prelude::*;

/// Numbers of boxes; a grid alone is measured with the first one only.
const SIZES: [usize; 3] = [25_000, 100_000, 400_000];

/// Searches of a row; their median counts.
const SEARCHES: usize = 3;

/// Measures searches of all shapes, and updates of all histories. `quick`: the smallest size only.
pub fn run(quick: bool) -> Result<BenchReport, Failure> {
    let sizes = if quick { &SIZES[..1] } else { &SIZES };
    let columns = "world | boxes | pairs | algorithm | ms | ms_of_a_grid_alone | work_for_each_box_and_pair";
    let mut searches = Table::new("searches", columns);
    for (name, recipe) in tracked(shapes(), "shapes") {
        for &n in sizes {
            let boxes = recipe.boxes(n, 1);
            let (mut finder, ms) = search(&boxes, None)?;
            let grid = if n == SIZES[0] { Some(search(&boxes, Some(Engine::Grid))?.1) } else { None };
            let pairs = finder.find(&boxes)?.len();
            let report = finder.report();
            let work = report.work as f64 / (n + pairs) as f64;
            searches.row(cells![
                name,
                n,
                pairs,
                report.plan.algorithm.name(),
                ms,
                grid.unwrap_or(f64::NAN),
                work
            ]);
        }
    }
    let columns = "history | boxes | updates | mean_ms | worst_ms | search_mean_ms | search_worst_ms";
    let mut updates = Table::new("updates", columns);
    for (name, history) in tracked(histories(), "histories") {
        for &n in sizes {
            let [update, search] = follow(&history, n)?;
            updates.row(cells![name, n, history.updates, ..update, ..search]);
        }
    }
    Ok(BenchReport::new("hard", vec![searches, updates]))
}

fn search(boxes: &[Aabb], engine: Option<Engine>) -> Result<(Finder, f64), Failure> {
    let mut finder = Finder::new(Config { engine, ..crate::UNLIMITED });
    finder.find(boxes)?;
    let mut times = Vec::new();
    for _ in 0..SEARCHES {
        let (found, ms) = timed(|| finder.find(boxes).map(|_| ()));
        found?;
        times.push(ms);
    }
    Ok((finder, Spread::of(times).median))
}

/// Returns mean and worst milliseconds of updates, and of searches of the same boxes.
fn follow(history: &History, n: usize) -> Result<[[f64; 2]; 2], Failure> {
    let mut broad_phase = BroadPhase::new(crate::UNLIMITED)?;
    let (mut finder, mut times) = (Finder::new(crate::UNLIMITED), [vec![], vec![]]);
    let all = history.changes(n, 1);
    tell(&mut broad_phase, &all[0])?;
    broad_phase.update()?;
    for changes in &all[1..] {
        tell(&mut broad_phase, changes)?;
        let (done, ms) = timed(|| broad_phase.update().map(|_| ()));
        done?;
        times[0].push(ms);
        let (found, ms) = timed(|| finder.find(broad_phase.fat_aabbs()).map(<[_]>::len));
        check(found? == broad_phase.pair_count(), || "an update and a search differ".into())?;
        times[1].push(ms);
    }
    Ok(times.map(|ms| [ms.iter().sum::<f64>() / ms.len() as f64, ms.iter().fold(0.0, |a, b| b.max(a))]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_history_is_followed_to_its_end() {
        for (name, history) in histories() {
            let [[mean, worst], search] = follow(&history, 400).expect("no difference");
            assert!(mean > 0.0 && worst >= mean && search[0] > 0.0, "{name}");
        }
    }
}

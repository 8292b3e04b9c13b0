//! Times of hard worlds, on which a grid of one cell size takes quadratic time.

use pbig_core::{Aabb, Config, Engine, Finder};
use pbig_harness::hard::shapes;
use pbig_harness::prelude::*;

/// Numbers of boxes; a grid alone is measured with the first one only.
const SIZES: [usize; 3] = [25_000, 100_000, 400_000];

/// Searches of a row; their median counts.
const SEARCHES: usize = 3;

/// Measures searches of all shapes. `quick`: the smallest size only.
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
    Ok(BenchReport::new("hard", vec![searches]))
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

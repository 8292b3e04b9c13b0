//! Times of updates: mean, median, p99, worst. Boxes in motion: our updates beside a search from nothing and parry's tree, in turn in
//! every frame; pairs agree in number wherever a side takes part.

use crate::trees::{Kept, Parry, Refit, partition};
use crate::{UNLIMITED, UNSORTED};
use pbig_core::Finder;
use pbig_harness::chart::{Chart, Line, Plot};
use pbig_harness::motions::{Density, Motion, MovingBoxes};
use pbig_harness::prelude::*;
use pbig_harness::runner::Summary;

/// All sides; the second is ours on one thread.
const NAMES: [&str; 4] = ["ours", "ours", "search from nothing", "parry 0.31"];
const PARRY: usize = 3;

/// All but the first frame's time leave out the first frame, in which everything is new.
const COLUMNS: &str =
    "motion | density | boxes | threads | side | frames | mean_ms | median_ms | p99_ms | worst_ms | first_ms";

/// Measures every motion; `given`: numbers of boxes instead of its own. Fails if the sides have different numbers of pairs.
pub fn run(quick: bool, given: &[usize]) -> Result<BenchReport, Failure> {
    let own: &[usize] = if quick { &[1000, 10_000] } else { &[1000, 10_000, 100_000, 1_000_000] };
    let boxes = if given.is_empty() { own } else { given };
    let mut table = Table::new("steady", COLUMNS);
    let plots = motions(boxes, quick, &mut table)?;
    let charts = vec![Chart { name: "steady-frames".into(), plots }];
    Ok(BenchReport { charts, ..BenchReport::new("steady", vec![table]) })
}

/// The motions whose frames are drawn, of the largest of the sizes up to [`MOST_DRAWN`].
const DRAWN: [Motion; 4] = [Motion::Drift, Motion::Fall, Motion::Burst, Motion::Shares];

const MOST_DRAWN: usize = 100_000;

/// Every motion, dense and sparse; of mixed sizes one that moves all and one that moves few.
fn scenes() -> impl Iterator<Item = (Motion, Density)> {
    let equal = [Density::Dense, Density::Sparse].into_iter();
    let equal = equal.flat_map(|density| Motion::ALL.map(|motion| (motion, density)));
    equal.chain([Motion::Drift, Motion::Few].map(|motion| (motion, Density::Mixed)))
}

/// Returns a plot of each drawn motion.
fn motions(sizes: &[usize], quick: bool, table: &mut Table) -> Result<Vec<Plot>, Failure> {
    let largest = sizes.iter().copied().filter(|n| *n <= MOST_DRAWN).max();
    let mut plots = vec![];
    let cases = sizes.iter().flat_map(|n| scenes().map(move |scene| (*n, scene)));
    for (n, (motion, density)) in tracked(cases, "motions") {
        let name = format!("{}, {}, {n} boxes", motion.name(), density.name());
        let frames = frames(n, quick);
        let times =
            race(MovingBoxes::new(motion, density, n, 1), frames, frames_of_parry(motion, n, frames), &name)?;
        for (k, ms) in times.iter().enumerate() {
            let threads = if k == 1 { 1 } else { rayon::current_num_threads() };
            row([motion.name(), density.name(), NAMES[k]], [n, threads], ms, table);
        }
        if Some(n) == largest && density == Density::Dense && DRAWN.contains(&motion) {
            plots.push(plot(&name, &times));
        }
    }
    Ok(plots)
}

/// Returns the frames after the first: enough for a p99 where they are short, and for two bursts at least.
fn frames(n: usize, quick: bool) -> usize {
    match n {
        _ if quick => 24,
        0..=10_000 => 300,
        10_001..=100_000 => 120,
        _ => 60,
    }
}

/// Returns the frames in which parry's tree takes part: a frame of many jumps takes it ten seconds.
fn frames_of_parry(motion: Motion, n: usize, frames: usize) -> usize {
    if motion == Motion::Jump && n > 10_000 { 5 } else { frames }
}

/// Returns the milliseconds of all sides on the same boxes, by side, then by frame. Each side warms the caches for the next one,
/// so the first one changes from frame to frame, and every second frame runs the other way round.
fn race(
    mut scene: MovingBoxes,
    frames: usize,
    frames_of_parry: usize,
    name: &str,
) -> Result<[Vec<f64>; NAMES.len()], Failure> {
    let (mut ours, mut parry) = (Kept::new(UNLIMITED)?, None::<Parry>);
    let mut finder = Finder::new(UNSORTED);
    let mut times = [(); NAMES.len()].map(|()| vec![]);
    let mut changed: Vec<u32> = (0..scene.boxes().len() as u32).collect();
    for frame in 0..=frames {
        let has_parry = frame <= frames_of_parry;
        if frame > 0 {
            changed = scene.step().to_vec();
            if let Some(parry) = parry.as_mut().filter(|_| has_parry) {
                parry.prepare(scene.boxes(), &changed);
            }
        }
        let (boxes, of_ours) = (scene.boxes(), partition(scene.boxes(), &changed));
        for place in 0..NAMES.len() {
            let place = if frame.is_multiple_of(2) { place } else { NAMES.len() - 1 - place };
            let side = (frame / 2 + place) % NAMES.len();
            if side == PARRY && !has_parry {
                continue;
            }
            times[side].push(match side {
                0 | 1 => ours.update(side, boxes, &of_ours)?,
                2 => {
                    let (done, ms) = timed(|| finder.find(boxes).map(|_| ()));
                    done.map(|()| ms)?
                }
                _ => timed(|| parry.get_or_insert_with(|| Parry::new(boxes, Refit::Parallel)).frame()).1,
            });
        }
        let pairs = finder.pairs().len();
        let [all, lone] = ours.pairs();
        let counts = [all, lone, parry.as_ref().filter(|_| has_parry).map_or(pairs, Parry::pairs)];
        let what = || format!("{name}, frame {frame}: {pairs} pairs, the others have {counts:?}");
        check(counts == [pairs; 3], what)?;
    }
    Ok(times)
}

/// Draws all frames but the first, which is longer than all others and would flatten their lines. One thread's line would hide ours.
fn plot(title: &str, times: &[Vec<f64>]) -> Plot {
    let drawn = [("pbig", 0), ("pbig, a list alone", 2), ("parry 0.31, all threads", PARRY)];
    let line = |(name, side): (&str, usize)| Line::steps(name, times[side][1..].iter().copied());
    Plot::steps(title, drawn.into_iter().map(line).collect())
}

fn row([motion, density, side]: [&str; 3], [boxes, threads]: [usize; 2], ms: &[f64], table: &mut Table) {
    let Summary { mean, median, p99, max } = Summary::of(ms[1..].iter().copied());
    table.row(cells![motion, density, boxes, threads, side, ms.len() - 1, mean, median, p99, max, ms[0]]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parry_takes_part_in_the_first_frames_only() {
        let scene = MovingBoxes::new(Motion::Jump, Density::Dense, 200, 1);
        let times = race(scene, 6, 3, "jump").expect("all agree");
        assert_eq!(times.map(|ms| ms.len()), [7, 7, 7, 4]);
        assert_eq!(
            (frames_of_parry(Motion::Jump, 100_000, 120), frames_of_parry(Motion::Fall, 100_000, 120)),
            (5, 120)
        );
    }
}

//! Margins without rapier: boxes that drift or tremble, and the finder alone.

use super::tally::{MARGINS, Tallied, Tally, passes};
use super::{Row, rows};
use crate::reported::Reported;
use pbig_core::{Aabb, BroadPhase, Config, Error, Finder, Limits, Pair, ProxyFilter};
use pbig_harness::bench::{Contest, timed};
use pbig_harness::boxes::{BoxSet, Wander};
use pbig_harness::output::Failure;
use pbig_harness::runner::StepTime;

/// The motions: the largest distance along each axis, in edges. As fast as things that fall, or as little as a thing that
/// leans on something.
const MOTIONS: [(&str, f32, Start); 2] =
    [("drifting", 0.02, Wander::drifting), ("trembling", 0.004, |boxes, by| Wander::new(boxes, 1.0, by))];

type Start = fn(Vec<Aabb>, f32) -> Wander;

/// All rows, those of one motion and size together.
pub(super) fn measured(quick: bool) -> Result<Vec<Row>, Failure> {
    let sizes: &[(usize, usize)] = if quick { &[(1000, 22)] } else { &[(10_000, 62), (100_000, 32)] };
    let mut rows = Vec::new();
    for (motion, by, start) in MOTIONS {
        for &(boxes, rounds) in sizes {
            rows.extend(motion_of(motion, boxes, rounds, &|set| start(set, by))?);
        }
    }
    Ok(rows)
}

fn motion_of(
    motion: &str,
    boxes: usize,
    rounds: usize,
    start: &dyn Fn(Vec<Aabb>) -> Wander,
) -> Result<Vec<Row>, Failure> {
    let set = BoxSet::named("unit").map(|set| set.boxes(boxes, 1)).unwrap_or_default();
    let case = format!("{motion} {boxes}");
    let failed = |error| Failure::Input(format!("{case}: {error}"));
    let passes = passes(rounds, || Boxes::new(start(set.clone())).map_err(failed))?;
    let edge = set.first().map_or(1.0, |aabb| aabb.extents()[0]);
    rows(&case, boxes, edge, false, &passes)
}

/// The same boxes for each margin.
struct Boxes {
    wander: Wander,
    finders: Vec<BroadPhase>,
    tallies: Vec<Tally>,
    /// Of the last round that was one to compare.
    needed: Result<Vec<Pair>, Error>,
}

impl Boxes {
    fn new(wander: Wander) -> Result<Self, Error> {
        let finder = |&margin: &f64| BroadPhase::new(Config { margin: margin as f32, ..CONFIG });
        let finders = MARGINS.iter().map(finder).collect::<Result<_, _>>()?;
        Ok(Self { wander, finders, tallies: vec![Tally::default(); MARGINS.len()], needed: Ok(vec![]) })
    }
}

const CONFIG: Config = Config { limits: Limits::UNLIMITED, ..Config::DEFAULT };

/// All boxes are set, as an app does that does not know which have moved far.
fn update(finder: &mut BroadPhase, boxes: &[Aabb]) -> Result<(), Error> {
    for (id, aabb) in boxes.iter().enumerate() {
        finder.set(id as u32, *aabb, ProxyFilter::ALL)?;
    }
    finder.update().map(|_| ())
}

impl Contest for Boxes {
    fn sides(&self) -> usize {
        MARGINS.len()
    }

    fn prepare(&mut self, round: usize) {
        self.wander.step(round);
        if Tally::compares(round) {
            // From nothing, by another search: brute force takes two seconds for 100,000 boxes.
            self.needed = Finder::new(CONFIG).find(&self.wander.boxes).map(<[Pair]>::to_vec);
        }
    }

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let Self { wander, finders, tallies, needed } = self;
        let (done, ms) = timed(|| update(&mut finders[side], &wander.boxes));
        let failed = |error: &Error| Failure::Input(format!("margin {}: {error}", MARGINS[side]));
        done.as_ref().map_err(failed)?;
        let needed = needed.as_ref().map_err(failed)?;
        let (finder, time) = (&finders[side], StepTime { broad_phase: ms, step: ms });
        let counts = [wander.boxes.len() as u64, finder.report().changed];
        tallies[side].note(time, counts, || Reported::compare(finder.pairs().collect(), needed));
        Ok(ms)
    }
}

impl Tallied for Boxes {
    fn tallies(self) -> Vec<Tally> {
        self.tallies
    }
}

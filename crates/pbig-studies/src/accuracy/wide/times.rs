//! The times of boxes in f32, by way: computed and searched, in turn in one run.

use super::place::{Place, WAYS, Way, finder};
use pbig_core::Finder;
use pbig_harness::bench::{Contest, Effort, medians, timed};
use pbig_harness::output::Failure;
use pbig_harness::runner::Spread;
use std::time::Duration;

/// Nanoseconds a box.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Time {
    /// To compute it.
    pub(super) boxes: f64,
    /// To compute it and find its pairs.
    pub(super) both: f64,
}

/// Ways that are measured: a margin on top of a way takes what the way takes.
pub(super) fn ways() -> impl Iterator<Item = Way> {
    WAYS.into_iter().filter(|way| !matches!(way, Way::Margin(_)))
}

struct Sides<'a> {
    place: &'a Place<'a>,
    /// By way: the finder, which keeps its buffers, and the times for boxes.
    sides: Vec<(Way, Finder, Vec<f64>)>,
}

impl Contest for Sides<'_> {
    fn sides(&self) -> usize {
        self.sides.len()
    }

    fn prepare(&mut self, _: usize) {}

    fn run(&mut self, side: usize) -> Result<f64, Failure> {
        let (way, finder, kept) = &mut self.sides[side];
        let (boxes, computed) = timed(|| self.place.boxes(*way));
        let (found, searched) = timed(|| finder.find(&boxes).map(<[_]>::len));
        found.map_err(|error| Failure::Input(format!("{}: {error}", way.name())))?;
        kept.push(computed);
        Ok(computed + searched)
    }
}

/// In the order of [`ways`].
pub(super) fn times(place: &Place<'_>, quick: bool) -> Result<Vec<Time>, Failure> {
    let sides = ways().map(|way| (way, finder(), Vec::new())).collect();
    let mut sides = Sides { place, sides };
    let (rounds, budget) = if quick { (6, 60) } else { (60, 2000) };
    let effort = Effort { warm_up: 2, rounds, budget: Duration::from_millis(budget) };
    let both = medians(&mut sides, effort)?;
    let each = 1e6 / place.len().max(1) as f64;
    let boxes = sides.sides.iter().map(|(.., kept)| Spread::of(kept.iter().copied()).median * each);
    Ok(boxes.zip(both).map(|(boxes, both)| Time { boxes, both: both * each }).collect())
}

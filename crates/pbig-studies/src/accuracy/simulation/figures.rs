//! One run in figures.

use super::sides::{Moving, Side};
use crate::mechanics::Mechanics;
use crate::numbered::Apart;
use crate::reported::Reported;
use pbig_harness::output::Failure;
use pbig_harness::runner::Spread;

/// Joules a kilogram below which a world counts as at rest: 4.5 cm/s on average, a tenth of the speed at which rapier
/// lets a body fall asleep.
pub(super) const REST: f64 = 1e-3;

/// One way through one scene.
#[derive(Clone, Debug)]
pub(super) struct Figures {
    pub(super) way: &'static str,
    /// In the second half of the run, on average.
    pub(super) contacts: f64,
    pub(super) points: f64,
    /// The deepest of the run, millimetres.
    pub(super) deepest: f64,
    /// Over all points of the run, millimetres.
    pub(super) penetration: f64,
    /// At the end, % of that after the first step.
    pub(super) energy: f64,
    /// The most that energy has risen above what it had been, % of that after the first step.
    pub(super) rise: f64,
    /// The most that the sum of momenta has moved, % of the sum of their sizes at first; where nothing acts from
    /// outside.
    pub(super) momentum: Option<f64>,
    /// The step from which on the world is at rest.
    pub(super) rest: Option<usize>,
    /// The step from which on all bodies sleep.
    pub(super) asleep: Option<usize>,
    /// Of the dynamic bodies, those that do not sleep, %; on average over the steps.
    pub(super) awake: f64,
    /// Pairs that ended while their colliders touched.
    pub(super) parted: u64,
    /// Number of steps.
    pub(super) steps: usize,
    /// At the end.
    pub(super) moving: Moving,
    /// From the bodies of the first way, at the end.
    pub(super) apart: Apart,
    /// The first step after which a body is elsewhere than with the first way.
    pub(super) differs: Option<usize>,
    /// A whole step, in the middle.
    pub(super) ms: f64,
    pub(super) reported: Reported,
    pub(super) compared: u64,
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    sum / f64::from(count.max(1))
}

impl Figures {
    /// Of a whole run.
    pub(super) fn of(side: &Side, is_isolated: bool) -> Self {
        let all: Vec<Mechanics> = side.samples.iter().map(|sample| sample.mechanics).collect();
        let late = &all[all.len() / 2..];
        let points: f64 = all.iter().map(|m| m.points as f64).sum();
        let inside: f64 = all.iter().map(|m| m.points as f64 * m.mean_penetration).sum();
        let moved = side.samples.iter().position(|sample| sample.apart.max > 0.0);
        Self {
            way: side.way.name,
            contacts: mean(late.iter().map(|m| m.contacts as f64)),
            points: mean(late.iter().map(|m| m.points as f64)),
            deepest: all.iter().map(|m| m.deepest).fold(0.0, f64::max) * 1e3,
            penetration: inside / points.max(1.0) * 1e3,
            energy: energy_left(&all),
            rise: energy_rise(&all),
            momentum: is_isolated.then(|| momentum_drift(&all)),
            rest: rest(&all),
            asleep: lasts(&side.samples, |sample| sample.awake == 0.0),
            awake: mean(side.samples.iter().map(|sample| sample.awake)),
            parted: side.parted,
            steps: all.len(),
            moving: side.moving(REST),
            apart: side.samples.last().map(|sample| sample.apart).unwrap_or_default(),
            differs: moved.map(|step| step + 1),
            ms: Spread::of(side.ms.iter().copied()).median,
            reported: side.reported,
            compared: side.compared,
        }
    }

    /// Or that a pair is missing which pbig should have reported.
    pub(super) fn complete(self, scene: &str, is_pbig: bool) -> Result<Self, Failure> {
        let Reported { missed, needed, .. } = self.reported;
        if is_pbig && missed > 0 {
            let what = format!("{scene}, {}: {missed} of {needed} pairs that overlap are missing", self.way);
            return Err(Failure::Check(what));
        }
        Ok(self)
    }
}

/// Returns the energy to which all percentages refer.
fn first_energy(all: &[Mechanics]) -> f64 {
    all.first().map_or(1.0, |m| m.energy().abs()).max(f64::MIN_POSITIVE)
}

fn energy_left(all: &[Mechanics]) -> f64 {
    all.last().map_or(0.0, Mechanics::energy) / first_energy(all) * 100.0
}

fn energy_rise(all: &[Mechanics]) -> f64 {
    let (mut least, mut rise) = (f64::MAX, 0.0f64);
    for energy in all.iter().map(Mechanics::energy) {
        least = least.min(energy);
        rise = rise.max(energy - least);
    }
    rise / first_energy(all) * 100.0
}

fn momentum_drift(all: &[Mechanics]) -> f64 {
    let Some(first) = all.first() else { return 0.0 };
    let drift = |m: &Mechanics| {
        let squares = m.momentum.iter().zip(first.momentum).map(|(p, at_first)| (p - at_first).powi(2));
        squares.sum::<f64>().sqrt()
    };
    all.iter().map(drift).fold(0.0, f64::max) / first.speed.max(f64::MIN_POSITIVE) * 100.0
}

/// The step from which on kinetic energy stays below [`REST`].
fn rest(all: &[Mechanics]) -> Option<usize> {
    lasts(all, |m| m.kinetic <= REST * m.mass)
}

/// The step from which on something is so.
fn lasts<T>(all: &[T], is_so: impl Fn(&T) -> bool) -> Option<usize> {
    let last = all.iter().rposition(|one| !is_so(one)).map_or(0, |step| step + 1);
    (last < all.len()).then_some(last + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_momentum_and_rest_by_hand() {
        let of = |kinetic| Mechanics { kinetic, mass: 2.0, ..Mechanics::default() };
        let all = [10.0, 4.0, 7.0, 5.0].map(of);
        assert_eq!((energy_left(&all), energy_rise(&all)), (50.0, 30.0));
        let with = |momentum| Mechanics { momentum, speed: 50.0, ..Mechanics::default() };
        assert_eq!(momentum_drift(&[with([1.0, 0.0, 0.0]), with([4.0, 4.0, 0.0])]), 10.0);
        assert_eq!(rest(&[1.0, REST, 1.0, REST, REST].map(of)), Some(4));
        assert_eq!(rest(&[REST, 1.0].map(of)), None);
    }
}

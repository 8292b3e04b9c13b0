//! Checks that a pair ends in the order in which it began, even if its colliders change in between: an app that keeps ordered pairs
//! of handles must not keep one for ever. A harness for a version of rapier implements [`Zone`] and calls the checks.

use glam::Vec3;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::collections::HashSet;

#[derive(Clone, Copy, Debug)]
pub enum Change {
    Move(Vec3),
    Throw(Vec3),
    /// No groups, so no pairs.
    Exclude,
    /// The shape of a cube, by half its edge.
    Resize(f32),
    /// A body that the app moves.
    MakeKinematic,
}

/// An event of rapier's narrow phase: true for a beginning, and the colliders in their order.
pub type Told = (bool, [(u32, u32); 2]);

/// A world with a fixed sensor, a cube with an edge of 4 m around the origin, and weightless balls. All listen for events.
pub trait Zone {
    fn new() -> Self;
    /// Adds a ball with a radius of 0.4 m.
    fn add_ball(&mut self, at: Vec3, is_sensor: bool);
    fn change(&mut self, ball: usize, change: Change);
    /// Lets another broad phase find the pairs, or saves and restores the world.
    fn hand_over(&mut self, rng: &mut StdRng);
    fn step(&mut self) -> Vec<Told>;
}

/// An app that keeps the ordered pairs it was told of.
struct App<Z> {
    zone: Z,
    told: HashSet<[(u32, u32); 2]>,
    ends: usize,
    lost: usize,
}

impl<Z: Zone> App<Z> {
    fn new() -> Self {
        let mut zone = Z::new();
        zone.add_ball(Vec3::ZERO, false);
        Self { zone, told: HashSet::new(), ends: 0, lost: 0 }
    }

    fn step(&mut self) {
        for (began, pair) in self.zone.step() {
            if began {
                self.told.insert(pair);
            } else {
                self.ends += 1;
                self.lost += usize::from(!self.told.remove(&pair));
            }
        }
    }
}

/// Checks balls that leave the zone in one step.
///
/// # Panics
/// If an end was told in another order.
pub fn a_ball_that_leaves_a_zone_leaves_as_it_came<Z: Zone>() {
    for change in [Change::Move(50.0 * Vec3::X), Change::Exclude, Change::Throw(5000.0 * Vec3::X)] {
        let mut app = App::<Z>::new();
        app.step();
        assert_eq!(app.told.len(), 1);
        (0..4).for_each(|i| app.zone.add_ball(Vec3::new(0.9 * i as f32 - 1.4, 1.4, 0.0), false));
        app.step();
        app.zone.change(0, change);
        (0..3).for_each(|_| app.step());
        assert_eq!((app.ends, app.lost, app.told.len()), (1, 0, 4), "{change:?}");
    }
}

/// Checks random worlds, in which one broad phase takes over from another.
///
/// # Panics
/// If an end was told in another order.
pub fn pairs_keep_their_order_whoever_finds_them_next<Z: Zone>() {
    let mut ends = 0;
    for seed in 0..60 {
        let (mut app, mut rng, mut balls) = (App::<Z>::new(), StdRng::seed_from_u64(seed), 1);
        for round in 0..60 {
            let at = Vec3::from_array([0.0; 3].map(|_: f32| rng.random_range(-3.0..3.0)));
            let ball = rng.random_range(0..balls);
            match rng.random_range(0..8) {
                0 | 1 => {
                    app.zone.add_ball(at, round % 3 == 0);
                    balls += 1;
                }
                2 => app.zone.change(ball, Change::Resize(rng.random_range(0.1..3.0))),
                3 => app.zone.hand_over(&mut rng),
                4 => app.zone.change(ball, Change::MakeKinematic),
                _ => app.zone.change(ball, Change::Move(at)),
            }
            app.step();
        }
        assert_eq!(app.lost, 0, "seed {seed}: {} ends", app.ends);
        ends += app.ends;
    }
    assert!(ends > 500, "{ends}");
}

/// Checks that the checks can fail.
///
/// # Panics
/// If an end in the other order is not noticed.
pub fn an_end_in_the_other_order_is_noticed<Z: Zone>() {
    let mut app = App::<Z>::new();
    app.step();
    let [a, b] = *app.told.iter().next().expect("the ball is in the zone");
    app.told = HashSet::from([[b, a]]);
    app.zone.change(0, Change::Move(50.0 * Vec3::X));
    app.step();
    assert_eq!((app.ends, app.lost), (1, 1));
}

//! Scenes with pbig's broad phase instead of rapier's own: contacts, energy, and the paths of bodies.
//! Events come in another order, so rapier solves contacts in another order. The effect is compared with the effect of another
//! order of insertion, and with the effect of our order of events on rapier's own broad phase.

mod sides;

use super::{mean, percent, report};
use crate::reported::Reported;
use glam::DVec3;
use pbig_harness::prelude::*;
use pbig_harness::world::{World, to_vector};
use rapier3d::prelude::{Real, RigidBody};
use sides::{CLOUD, PERMUTED, SceneCase, VariantRun, simulated};

/// Scenes, bodies and steps.
const FULL: [SceneCase; 6] = [
    ("column", 1000, 500),
    ("pile", 500, 300),
    ("pyramid", 506, 300),
    ("ragdolls", 660, 400),
    ("compounds", 500, 400),
    (CLOUD, 500, 400),
];

const QUICK: [SceneCase; 3] = [("column", 60, 120), ("ragdolls", 22, 60), (CLOUD, 60, 60)];

/// The columns of the table of runs.
const RUNS: &str = "scene | broad_phase | contacts | points | deepest_mm | mean_penetration_mm | \
    energy_at_the_end_percent | energy_rise_percent | momentum_drift_percent | asleep_from_step | awake_percent | \
    parted_in_contact | differs_from_step | mean_distance | largest_distance | missed | step_ms | needed_pairs";

pub(super) fn run(quick: bool) -> Result<BenchReport, Failure> {
    let mut runs = Table::new("runs", RUNS);
    let mut repeated = Table::new("repeated", "scene | broad_phase | steps | differ_from_step");
    let cases = if quick { &QUICK[..] } else { &FULL };
    for case in cases {
        let sides = simulated(*case)?;
        rows(case.0, &sides)?.into_iter().for_each(|row| runs.row(row));
        for two in sides.windows(2).filter(|two| two[1].way.is_again) {
            repeated.row(cells![case.0, two[0].way.name, case.2, first_difference(two)]);
        }
    }
    let axes = ["whole step, ms", "mean distance from stock's bodies at the end, m"];
    let points = points(&runs);
    let tables = vec![drift(cases, &runs), runs, repeated];
    let mut report = report("simulation", tables, ("Whole simulations", axes), points);
    // Runs have no order.
    report.charts[0].plots[0].is_joined = false;
    Ok(report)
}

/// Returns the first step after which the poses of two runs differ.
fn first_difference(two: &[VariantRun]) -> Option<usize> {
    let mut both = two[0].samples.iter().zip(&two[1].samples);
    both.position(|(one, again)| one.poses != again.poses).map(|step| step + 1)
}

/// Returns the mean distance from stock's bodies at the end: the farthest permuted run, pbig, and stock with sorted events.
fn drift(cases: &[SceneCase], runs: &Table) -> Table {
    let mut table = Table::new("drift", "scene | steps | farthest_permuted | pbig | stock_sorted");
    for (scene, _, steps) in cases {
        let distance = |way: &str| {
            let row = runs.rows.iter().find(|row| row[0] == *scene && row[1] == way);
            row.and_then(|row| runs.number(row, "mean_distance"))
        };
        let ways = ["stock permuted, most", "pbig", "stock sorted"];
        table.row(cells![*scene, *steps, ..ways.map(distance)]);
    }
    table
}

/// Returns points of three scenes in motion with rapier's own broad phase and with pbig's, in every order of bodies and events.
/// More scenes could not be told apart.
fn points(runs: &Table) -> Vec<(String, f64, f64)> {
    let drawn =
        runs.rows.iter().filter(|row| ["column", "ragdolls", CLOUD].iter().any(|scene| row[0] == *scene));
    let point = |row: &Vec<Value>| {
        let kind = if row[1].as_str()?.starts_with("pbig") { "pbig" } else { "stock" };
        let name = format!("{}, {kind}", row[0].as_str()?);
        Some((name, runs.number(row, "step_ms")?, runs.number(row, "mean_distance")?))
    };
    drawn.filter_map(point).collect()
}

/// Returns a row for each way; of the permuted ones the first, the middle and the last value of each column.
fn rows(scene: &str, sides: &[VariantRun]) -> Result<Vec<Vec<Value>>, Failure> {
    let rows: Result<Vec<_>, Failure> = sides.iter().map(|side| figures(scene, side)).collect();
    // The permuted ones come after stock, and stock again.
    let (mut rows, places) = (rows?, 2..2 + PERMUTED);
    let ranks = [("least", 0), ("median", PERMUTED / 2), ("most", PERMUTED - 1)];
    let ranks = ranks.map(|(name, rank)| ranked(&rows[places.clone()], name, rank));
    rows.splice(places, ranks);
    Ok(rows)
}

/// Returns the values of this rank, column by column. A step that never came is later than all others.
fn ranked(permuted: &[Vec<Value>], name: &str, rank: usize) -> Vec<Value> {
    let column = |k: usize| {
        let mut values: Vec<&Value> = permuted.iter().map(|row| &row[k]).collect();
        let size = |value: &Value| value.as_f64().unwrap_or(f64::INFINITY);
        values.sort_by(|a, b| size(a).total_cmp(&size(b)));
        values[rank].clone()
    };
    let mut row: Vec<Value> = (0..permuted[0].len()).map(column).collect();
    row[1] = format!("stock permuted, {name}").into();
    row
}

/// Returns one run in figures. A pair that pbig should have reported and did not is a failed check.
fn figures(scene: &str, side: &VariantRun) -> Result<Vec<Value>, Failure> {
    let (name, Reported { missed, needed, .. }) = (side.way.name, side.reported);
    let what = || format!("{scene}, {name}: {missed} of {needed} pairs that overlap are missing");
    check(missed == 0 || !side.way.is_pbig(), what)?;
    let awake: Vec<f64> = side.samples.iter().map(|sample| sample.awake).collect();
    let asleep = lasts(&awake, |awake| *awake == 0.0);
    let asleep = asleep.map_or_else(|| format!("not within {}", awake.len()).into(), Value::from);
    let differs = side.samples.iter().position(|sample| sample.apart[1] > 0.0).map(|step| step + 1);
    let [mean_apart, most_apart] = side.samples.last().map(|sample| sample.apart).unwrap_or_default();
    let paths = cells![asleep, mean(&awake), side.parted, differs, mean_apart, most_apart];
    let step = Spread::of(side.ms.iter().copied()).median;
    Ok(cells![scene, name, ..mechanics(scene, side), ..paths, missed, step, needed])
}

/// Contacts, penetration, energy and momentum of a world after a step. Of bodies, the dynamic ones.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Mechanics {
    /// Pairs of colliders that rapier holds to be in contact: within its prediction distance, 2 mm unless told.
    contacts: u64,
    /// Their contact points.
    points: u64,
    /// The depth of the deepest point, in metres; 0 if none is inside.
    deepest: f64,
    /// The mean depth of all points, in metres. A point outside counts as 0.
    mean_penetration: f64,
    /// Joules.
    kinetic: f64,
    /// Joules, 0 at the origin; taken half a step of rapier's solver back, where the velocities belong, so that a body
    /// in free fall keeps the sum of its energies.
    potential: f64,
    /// The sum over bodies, kg m/s.
    momentum: DVec3,
    /// The sum of the lengths of the bodies' momenta.
    speed: f64,
}

impl Mechanics {
    fn of(world: &World) -> Self {
        let mut found = Self::default();
        let bodies = world.bodies.iter().filter(|(_, body)| body.is_dynamic());
        bodies.for_each(|(_, body)| found.add(world, body));
        let pairs = world.narrow_phase.contact_pairs().filter(|pair| pair.has_any_active_contact);
        for pair in pairs {
            found.contacts += 1;
            for point in pair.manifolds.iter().flat_map(|manifold| &manifold.points) {
                let inside = f64::from(-point.dist).max(0.0);
                found.points += 1;
                found.deepest = found.deepest.max(inside);
                // The sum, until all are in.
                found.mean_penetration += inside;
            }
        }
        found.mean_penetration /= found.points.max(1) as f64;
        found
    }

    fn energy(&self) -> f64 {
        self.kinetic + self.potential
    }

    fn add(&mut self, world: &World, body: &RigidBody) {
        let mass = f64::from(body.mass());
        let momentum = DVec3::from_array(body.linvel().map(|v| f64::from(v) * mass).into());
        self.kinetic += f64::from(body.kinetic_energy());
        // Rapier's solver divides each step into this number of small ones.
        let dt = world.params.dt / world.params.num_solver_iterations.get() as Real;
        self.potential += f64::from(body.gravitational_potential_energy(dt, to_vector(world.gravity)));
        self.speed += momentum.length();
        self.momentum += momentum;
    }
}

/// Returns contacts of the second half of a run; penetration, energy and momentum of all of it.
fn mechanics(scene: &str, side: &VariantRun) -> Vec<Value> {
    let all: Vec<Mechanics> = side.samples.iter().map(|sample| sample.mechanics).collect();
    let late = |of: fn(&Mechanics) -> u64| {
        mean(&all[all.len() / 2..].iter().map(|m| of(m) as f64).collect::<Vec<_>>())
    };
    let points: f64 = all.iter().map(|m| m.points as f64).sum();
    let inside: f64 = all.iter().map(|m| m.points as f64 * m.mean_penetration).sum();
    let deepest = all.iter().map(|m| m.deepest).fold(0.0, f64::max);
    // Where nothing acts from outside.
    let drift = (scene == CLOUD).then(|| momentum_drift(&all));
    let contacts =
        cells![late(|m| m.contacts), late(|m| m.points), deepest * 1e3, inside / points.max(1.0) * 1e3];
    cells![..contacts, energy_left(&all), energy_rise(&all), drift]
}

/// Returns the energy to which all percentages refer.
fn first_energy(all: &[Mechanics]) -> f64 {
    all.first().map_or(1.0, |m| m.energy().abs()).max(f64::MIN_POSITIVE)
}

fn energy_left(all: &[Mechanics]) -> f64 {
    all.last().map_or(0.0, Mechanics::energy) / first_energy(all) * 100.0
}

/// Returns the most that energy has risen above what it had been.
fn energy_rise(all: &[Mechanics]) -> f64 {
    let (mut least, mut rise) = (f64::MAX, 0.0f64);
    for energy in all.iter().map(Mechanics::energy) {
        least = least.min(energy);
        rise = rise.max(energy - least);
    }
    rise / first_energy(all) * 100.0
}

/// Returns the most that the sum of momenta has moved, in percent of the sum of their sizes at first.
fn momentum_drift(all: &[Mechanics]) -> f64 {
    let Some(first) = all.first() else { return 0.0 };
    let drift = |m: &Mechanics| (m.momentum - first.momentum).length();
    all.iter().map(drift).fold(0.0, f64::max) / first.speed.max(f64::MIN_POSITIVE) * 100.0
}

/// Returns the step from which on something is so.
fn lasts<T>(all: &[T], is_so: impl Fn(&T) -> bool) -> Option<usize> {
    let last = all.iter().rposition(|one| !is_so(one)).map_or(0, |step| step + 1);
    (last < all.len()).then_some(last + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use rapier3d::prelude::*;

    #[test]
    fn energy_momentum_and_rest_by_hand() {
        let of = |kinetic| Mechanics { kinetic, ..Mechanics::default() };
        let all = [10.0, 4.0, 7.0, 5.0].map(of);
        assert_eq!((energy_left(&all), energy_rise(&all)), (50.0, 30.0));
        let with = |x, y| Mechanics { momentum: DVec3::new(x, y, 0.0), speed: 50.0, ..Mechanics::default() };
        assert_eq!(momentum_drift(&[with(1.0, 0.0), with(4.0, 4.0)]), 10.0);
        let rests = |awake: &[f64]| lasts(awake, |awake| *awake == 0.0);
        assert_eq!((rests(&[1.0, 0.0, 1.0, 0.0, 0.0]), rests(&[0.0, 1.0])), (Some(4), None));
    }

    fn near(found: f64, right: f64) {
        assert!((found - right).abs() <= 1e-5 * right.abs().max(1.0), "{found}, not {right}");
    }

    /// Measures after a step of zero length, which only finds masses and contacts.
    fn measured(mut world: World) -> Mechanics {
        world.params.dt = 0.0;
        world.step(&mut DefaultBroadPhase::new());
        Mechanics::of(&world)
    }

    fn ball(radius: f32, mass: f32) -> ColliderBuilder {
        ColliderBuilder::ball(radius).mass(mass)
    }

    #[test]
    fn contacts_energy_and_momentum_by_hand() {
        let mut world = World::with_gravity(Vec3::ZERO);
        // Inside each other by 0.1, by 0.3, and 1 apart.
        for x in [0.0, 0.9, 1.6, 3.6] {
            world.add(World::dynamic(Vec3::X * x), ball(0.5, 1.0));
        }
        let found = measured(world);
        assert_eq!((found.contacts, found.points), (2, 2));
        near(found.deepest, 0.3);
        near(found.mean_penetration, 0.2);

        let mut world = World::with_gravity(Vec3::new(0.0, -10.0, 0.0));
        let moving = |at: Vec3, v: Vec3| World::dynamic(at).linvel(to_vector(v));
        world.add(moving(Vec3::Y * 3.0, Vec3::X * 2.0), ball(0.5, 2.0));
        let spin = moving(Vec3::new(9.0, 1.0, 0.0), Vec3::X * -1.0).angvel(vector![0.0, 4.0, 0.0]);
        world.add(spin, ball(0.5, 5.0));
        let kinematic = RigidBodyBuilder::kinematic_velocity_based().linvel(vector![7.0, 0.0, 0.0]);
        world.add(kinematic.translation(vector![0.0, 20.0, 0.0]), ball(0.5, 3.0));
        let found = measured(world);
        // Half of m v^2 twice, and of I w^2 with I = 2/5 m r^2; then m g h.
        near(found.kinetic, 4.0 + 2.5 + 0.5 * (0.4 * 5.0 * 0.25) * 16.0);
        near(found.energy(), found.kinetic + 10.0 * (2.0 * 3.0 + 5.0 * 1.0));
        near(found.momentum.x, -1.0);
        near(found.speed, 9.0);
    }
}

//! Prints what single scene queries take, by rapier's own tree and by pbig, as CSV: `cargo run --release --bin bench_questions -- --help`.
//! One world has both broad phases, so both know the same colliders.

use clap::Parser;
use glam::Vec3;
use pbig_harness_036::dimension::cuboid;
use pbig_harness_036::world::{World, pose, real, to_vector};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rapier::parry::query::ShapeCastOptions;
use rapier::math::DIM;
use rapier::prelude::*;
use std::time::Instant;

/// Nanoseconds of a scene query by rapier's own tree ("stock") and by pbig, in turn, as CSV.
#[derive(Parser)]
struct Args {
    /// Bodies, several separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "30,100,300,1000,10000,100000")]
    bodies: Vec<usize>,
    /// Queries of a kind in a round.
    #[arg(long, default_value_t = 2000)]
    queries: usize,
    /// Kinds of queries whose names begin so; all by default.
    #[arg(long, default_value = "")]
    kind: String,
    /// Rounds; the shortest one counts.
    #[arg(long, default_value_t = 14)]
    rounds: usize,
}

/// Half the edge of a body, in metres.
const HALF: f32 = 1.0;

/// The velocity of moving bodies, in metres per second: they stay apart.
const VELOCITY: Vec3 = Vec3::new(0.7, -0.2, 0.4);

/// The layout of a world, with the distance of two neighbours, in metres.
const LAYOUTS: [(&str, f32); 2] = [("heap", 2.05), ("sparse", 9.0)];

/// The name of a kind of query, and what makes one for a world's half extent and asks it.
const KINDS: [(&str, Kind); 6] = [
    ("ray in", Kind::RayIn),
    ("ray past", Kind::RayPast),
    ("ray from inside", Kind::RayInside),
    ("cast", Kind::Cast),
    ("nearest", Kind::Nearest),
    ("nearest within 4", Kind::Near),
];

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    RayIn,
    RayPast,
    RayInside,
    Cast,
    Nearest,
    Near,
}

/// A place, and a unit vector.
type Question = (Vec3, Vec3);

/// The subject of some rows.
struct Subject {
    bodies: usize,
    layout: (&'static str, f32),
    has_ground: bool,
    moves: bool,
}

/// Two equal worlds, one with each broad phase.
struct Both {
    sides: [(World, BroadPhaseBvh); 2],
    /// Half the extent of the world.
    reach: f32,
    rng: StdRng,
}

/// Returns a place in a cube around the origin, in two dimensions with z 0.
fn place(rng: &mut StdRng, reach: f32) -> Vec3 {
    let z = if DIM == 2 { 0.0 } else { reach };
    let one = |rng: &mut StdRng, reach: f32| if reach > 0.0 { rng.random_range(-reach..reach) } else { 0.0 };
    Vec3::new(one(rng, reach), one(rng, reach), one(rng, z))
}

impl Both {
    fn new(subject: &Subject) -> Self {
        let gap = subject.layout.1;
        let side = (subject.bodies as f32).powf(1.0 / DIM as f32).ceil() as usize;
        let middle = (side as f32 - 1.0) / 2.0;
        let reach = (middle + 0.5) * gap;
        let at = |i: usize| {
            let cell = Vec3::new((i % side) as f32, (i / side % side) as f32, (i / side / side) as f32);
            (cell - middle) * gap * if DIM == 2 { Vec3::new(1.0, 1.0, 0.0) } else { Vec3::ONE }
        };
        let sides = [BroadPhaseBvh::new(), rapier_pbig::broad_phase()].map(|broad_phase| {
            let mut world = World::default();
            world.gravity = Vec3::ZERO;
            for i in 0..subject.bodies {
                let mut body = World::dynamic(at(i)).sleeping(!subject.moves);
                if subject.moves {
                    body = body.linvel(to_vector(VELOCITY));
                }
                world.add(body, ColliderBuilder::new(cuboid(Vec3::splat(HALF))));
            }
            if subject.has_ground {
                let half = Vec3::new(2.0 * reach, 1.0, 2.0 * reach);
                let under = pose(Vec3::new(0.0, -reach - 2.0, 0.0));
                world.colliders.insert(ColliderBuilder::new(cuboid(half)).position(under));
            }
            (world, broad_phase)
        });
        let mut both = Self { sides, reach, rng: StdRng::seed_from_u64(1) };
        (0..20).for_each(|_| both.step());
        both
    }

    fn step(&mut self) {
        self.sides.iter_mut().for_each(|(world, broad_phase)| world.step(broad_phase));
    }

    fn question(&mut self, kind: Kind) -> Question {
        let (rng, reach) = (&mut self.rng, self.reach);
        let along = place(rng, 1.0).normalize_or(Vec3::Y);
        match kind {
            Kind::RayIn | Kind::Cast => {
                let to = place(rng, 0.5 * reach);
                let up = Vec3::new(along.x, along.y.abs(), along.z);
                (to + up * 3.0 * reach, -up)
            }
            Kind::RayPast => {
                let from = place(rng, reach) + Vec3::Y * 3.0 * reach;
                (from, Vec3::new(along.x, 0.1 * along.y.abs(), along.z).normalize_or(Vec3::X))
            }
            Kind::RayInside | Kind::Nearest | Kind::Near => (place(rng, reach), along),
        }
    }

    /// Asks some questions, and returns the hits.
    fn ask(&self, side: usize, kind: Kind, questions: &[Question]) -> Vec<Option<(ColliderHandle, Real)>> {
        let (World { bodies, colliders, narrow_phase, .. }, broad_phase) = &self.sides[side];
        let (dispatcher, filter) = (narrow_phase.query_dispatcher(), QueryFilter::default());
        let queries = broad_phase.as_query_pipeline(dispatcher, bodies, colliders, filter);
        questions.iter().map(|question| ask(&queries, kind, *question)).collect()
    }
}

fn ask(queries: &QueryPipeline<'_>, kind: Kind, (from, along): Question) -> Option<(ColliderHandle, Real)> {
    let limit = real(1e6);
    match kind {
        Kind::RayIn | Kind::RayPast | Kind::RayInside => {
            queries.cast_ray(&Ray::new(to_vector(from), to_vector(along)), limit, true)
        }
        Kind::Cast => {
            let options = ShapeCastOptions::with_max_time_of_impact(limit);
            let hit = queries.cast_shape(&pose(from), to_vector(along), &Ball::new(real(0.5)), options)?;
            Some((hit.0, hit.1.time_of_impact))
        }
        Kind::Nearest | Kind::Near => {
            let limit = if kind == Kind::Near { real(4.0) } else { limit };
            let (handle, found) = queries.project_point(to_vector(from), limit, true)?;
            Some((handle, (found.point - to_vector(from)).length()))
        }
    }
}

/// Returns the nanoseconds of a question in the shortest round, by side, and the time of the first question of a round.
fn measure(args: &Args, subject: &Subject, both: &mut Both, kind: Kind) -> [[f64; 2]; 2] {
    let mut shortest = [[f64::INFINITY; 2]; 2];
    let questions: Vec<Question> = (0..args.queries).map(|_| both.question(kind)).collect();
    for round in 0..args.rounds {
        if subject.moves {
            both.step();
        }
        let mut hits = [Vec::new(), Vec::new()];
        for side in if round % 2 == 0 { [0, 1] } else { [1, 0] } {
            let clock = Instant::now();
            both.ask(side, kind, &questions[..1]);
            let first = clock.elapsed().as_nanos() as f64;
            let clock = Instant::now();
            hits[side] = both.ask(side, kind, &questions);
            let each = clock.elapsed().as_nanos() as f64 / questions.len() as f64;
            shortest[side] = [shortest[side][0].min(each), shortest[side][1].min(first)];
        }
        compare(&hits);
    }
    shortest
}

/// Stops if the distances differ by more than rounding.
fn compare(hits: &[Vec<Option<(ColliderHandle, Real)>>; 2]) {
    for (stock, ours) in hits[0].iter().zip(&hits[1]) {
        let is_same = match (stock, ours) {
            (None, None) => true,
            (Some(stock), Some(ours)) => (stock.1 - ours.1).abs() <= real(1e-4) * (real(1.0) + stock.1.abs()),
            _ => false,
        };
        assert!(is_same, "stock {stock:?}, pbig {ours:?}");
    }
}

fn main() {
    let args = Args::parse();
    println!("bodies,layout,ground,motion,query,stock_ns,pbig_ns,stock_over_pbig,stock_first_ns,pbig_first_ns");
    let mut ratios: Vec<f64> = Vec::new();
    for &bodies in &args.bodies {
        for layout in LAYOUTS {
            for (has_ground, moves) in [(false, false), (false, true), (true, false), (true, true)] {
                let subject = Subject { bodies, layout, has_ground, moves };
                let mut both = Both::new(&subject);
                for (name, kind) in KINDS.into_iter().filter(|(name, _)| name.starts_with(&args.kind)) {
                    let [stock, ours] = measure(&args, &subject, &mut both, kind);
                    let ground = if has_ground { "ground" } else { "none" };
                    let motion = if moves { "moving" } else { "asleep" };
                    let ratio = stock[0] / ours[0];
                    ratios.push(ratio);
                    println!(
                        "{bodies},{},{ground},{motion},{name},{:.1},{:.1},{ratio:.3},{:.0},{:.0}",
                        layout.0, stock[0], ours[0], stock[1], ours[1]
                    );
                }
            }
        }
    }
    let mean = (ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64).exp();
    let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
    let below = ratios.iter().filter(|ratio| **ratio < 1.0).count();
    eprintln!("{} kinds: geometric mean {mean:.3}, least {least:.3}, {below} below 1", ratios.len());
}

//! Prints the times of single scene queries, by rapier's own tree and by pbig in turn, as CSV:
//! `cargo run --release --bin bench_queries -- --help`.

use clap::Parser;
use glam::Vec3;
use pbig_harness_036::dimension::cuboid;
use pbig_harness_036::world::{World, pose, real, to_vector};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rapier::math::DIM;
use rapier::parry::query::ShapeCastOptions;
use rapier::prelude::*;
use std::num::NonZeroUsize;
use std::time::Instant;

/// Nanoseconds of a scene query in two equal worlds, one with rapier's own tree ("stock") and one with pbig, as CSV.
#[derive(Parser)]
struct Args {
    /// Bodies, several separated by commas.
    #[arg(long, value_delimiter = ',', default_value = "30,100,300,1000,10000,100000")]
    bodies: Vec<usize>,
    /// Queries of a kind in a round.
    #[arg(long, default_value = "2000")]
    queries: NonZeroUsize,
    /// Rounds, the shortest of which counts. Moving worlds make a step before each.
    #[arg(long, default_value = "14")]
    rounds: NonZeroUsize,
    /// Only kinds of queries with a name that begins so.
    #[arg(long, default_value = "")]
    kind: String,
}

/// Half the edge of a body, in metres.
const HALF: f32 = 1.0;

/// The velocity of moving bodies, in metres per second. It is the same for all, so they stay apart.
const VELOCITY: Vec3 = Vec3::new(0.7, -0.2, 0.4);

/// The maximum time or distance of a query, in seconds or metres.
const FAR: f32 = 1e6;

/// Layouts of a world, with the distance of two neighbours, in metres.
const LAYOUTS: [(&str, f32); 2] = [("heap", 2.05), ("sparse", 9.0)];

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
    /// A ray from outside to a place in the middle.
    RayIn,
    /// A ray that passes above all bodies.
    RayPast,
    RayInside,
    /// A cast of a ball from outside to a place in the middle.
    Cast,
    Nearest,
    Near,
}

/// A place, and a unit vector.
type Place = (Vec3, Vec3);

/// A collider, and the time or distance at which it is met.
type Answer = Option<(ColliderHandle, Real)>;

/// The subject of some rows.
#[derive(Clone, Copy)]
struct Subject {
    bodies: usize,
    layout: (&'static str, f32),
    has_ground: bool,
    moves: bool,
}

impl Subject {
    fn all(bodies: usize) -> impl Iterator<Item = Self> {
        let of = move |layout, has_ground, moves| Self { bodies, layout, has_ground, moves };
        let grounds = LAYOUTS.into_iter().flat_map(|layout| [false, true].map(|ground| (layout, ground)));
        grounds.flat_map(move |(layout, ground)| [false, true].map(|moves| of(layout, ground, moves)))
    }

    /// Returns the number of bodies along an axis.
    fn side(&self) -> usize {
        (self.bodies as f32).powf(1.0 / DIM as f32).ceil() as usize
    }

    /// Returns half the extent of the world, in metres.
    fn reach(&self) -> f32 {
        0.5 * self.side() as f32 * self.layout.1
    }

    /// Builds the world.
    fn world(&self) -> World {
        let mut world = World::default();
        world.gravity = Vec3::ZERO;
        for i in 0..self.bodies {
            let body = World::dynamic(self.place(i)).sleeping(!self.moves);
            let body = if self.moves { body.linvel(to_vector(VELOCITY)) } else { body };
            world.add(body, ColliderBuilder::new(cuboid(Vec3::splat(HALF))));
        }
        if self.has_ground {
            let (wide, below) = (2.0 * self.reach(), Vec3::NEG_Y * (self.reach() + 2.0));
            let ground = ColliderBuilder::new(cuboid(Vec3::new(wide, 1.0, wide))).position(pose(below));
            world.colliders.insert(ground);
        }
        world
    }

    fn place(&self, i: usize) -> Vec3 {
        let side = self.side();
        let cell = Vec3::new((i % side) as f32, (i / side % side) as f32, (i / side / side) as f32);
        flat((cell + 0.5) * self.layout.1 - self.reach())
    }
}

/// Returns a vector of the world's dimension.
fn flat(v: Vec3) -> Vec3 {
    if DIM == 2 { v.with_z(0.0) } else { v }
}

fn random_place(rng: &mut StdRng, reach: f32) -> Vec3 {
    flat(Vec3::from_array([(); 3].map(|()| rng.random_range(-reach..reach))))
}

impl Kind {
    fn place(self, rng: &mut StdRng, reach: f32) -> Place {
        let along = random_place(rng, 1.0).normalize_or(Vec3::Y);
        let up = along.with_y(along.y.abs());
        match self {
            Self::RayIn | Self::Cast => (random_place(rng, 0.5 * reach) + up * 3.0 * reach, -up),
            Self::RayPast => {
                let level = along.with_y(0.1 * along.y.abs()).normalize_or(Vec3::X);
                (random_place(rng, reach) + Vec3::Y * 3.0 * reach, level)
            }
            Self::RayInside | Self::Nearest | Self::Near => (random_place(rng, reach), along),
        }
    }

    fn ask(self, queries: &QueryPipeline<'_>, (from, along): Place) -> Answer {
        let (from, along) = (to_vector(from), to_vector(along));
        match self {
            Self::RayIn | Self::RayPast | Self::RayInside => {
                queries.cast_ray(&Ray::new(from, along), real(FAR), true)
            }
            Self::Cast => {
                let (options, ball) =
                    (ShapeCastOptions::with_max_time_of_impact(real(FAR)), Ball::new(real(0.5)));
                let hit = queries.cast_shape(&Pose::from_translation(from), along, &ball, options)?;
                Some((hit.0, hit.1.time_of_impact))
            }
            Self::Nearest | Self::Near => {
                let limit = if self == Self::Near { 4.0 } else { FAR };
                let (handle, found) = queries.project_point(from, real(limit), true)?;
                Some((handle, (found.point - from).length()))
            }
        }
    }
}

/// Two equal worlds, with rapier's own tree and with pbig.
struct Both([(World, BroadPhaseBvh); 2]);

/// Nanoseconds of each query, and of the first one of a round.
type Times = [f64; 2];

impl Both {
    fn new(subject: &Subject) -> Self {
        let mut both =
            Self([BroadPhaseBvh::new(), rapier_pbig::broad_phase()].map(|one| (subject.world(), one)));
        (0..20).for_each(|_| both.step());
        both
    }

    fn step(&mut self) {
        self.0.iter_mut().for_each(|(world, broad_phase)| world.step(broad_phase));
    }

    fn ask(&self, side: usize, kind: Kind, places: &[Place]) -> (f64, Vec<Answer>) {
        let (World { bodies, colliders, narrow_phase, .. }, broad_phase) = &self.0[side];
        let (dispatcher, filter) = (narrow_phase.query_dispatcher(), QueryFilter::default());
        let clock = Instant::now();
        let queries = broad_phase.as_query_pipeline(dispatcher, bodies, colliders, filter);
        let answers = places.iter().map(|place| kind.ask(&queries, *place)).collect();
        (clock.elapsed().as_nanos() as f64 / places.len() as f64, answers)
    }

    /// Returns the least times of some rounds, of stock and of pbig. Both have the same hits.
    fn measure(&mut self, args: &Args, subject: &Subject, kind: Kind) -> [Times; 2] {
        let mut rng = StdRng::seed_from_u64(1);
        let places: Vec<Place> =
            (0..args.queries.get()).map(|_| kind.place(&mut rng, subject.reach())).collect();
        let mut least = [[f64::INFINITY; 2]; 2];
        for round in 0..args.rounds.get() {
            if subject.moves {
                self.step();
            }
            let mut answers = [vec![], vec![]];
            for side in if round % 2 == 0 { [0, 1] } else { [1, 0] } {
                let first = self.ask(side, kind, &places[..1]).0;
                let (each, found) = self.ask(side, kind, &places);
                answers[side] = found;
                least[side] = [least[side][0].min(each), least[side][1].min(first)];
            }
            compare(&answers);
        }
        least
    }
}

/// Compares the distances of hits. Where two colliders are at one distance, either is right.
fn compare(answers: &[Vec<Answer>; 2]) {
    for (stock, ours) in answers[0].iter().zip(&answers[1]) {
        let [one, other] = [stock, ours].map(|answer| answer.map_or(real(-1.0), |hit| hit.1));
        assert!((one - other).abs() <= real(1e-4) * (real(1.0) + one.abs()), "{stock:?}, pbig {ours:?}");
    }
}

fn main() {
    let args = Args::parse();
    println!(
        "bodies,layout,ground,motion,query,stock_ns,pbig_ns,stock_over_pbig,stock_first_ns,pbig_first_ns"
    );
    let mut ratios = vec![];
    for subject in args.bodies.iter().flat_map(|bodies| Subject::all(*bodies)) {
        let mut both = Both::new(&subject);
        for (name, kind) in KINDS.into_iter().filter(|(name, _)| name.starts_with(&args.kind)) {
            let times = both.measure(&args, &subject, kind);
            ratios.push(times[0][0] / times[1][0]);
            print_row(&subject, name, times);
        }
    }
    let mean = (ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64).exp();
    let (least, below) = (
        ratios.iter().copied().fold(f64::INFINITY, f64::min),
        ratios.iter().filter(|ratio| **ratio < 1.0).count(),
    );
    eprintln!("{} kinds: geometric mean {mean:.3}, least {least:.3}, {below} below 1", ratios.len());
}

fn print_row(subject: &Subject, query: &str, [stock, ours]: [Times; 2]) {
    let Subject { bodies, layout: (layout, _), has_ground, moves } = subject;
    let ground = if *has_ground { "ground" } else { "none" };
    let motion = if *moves { "moving" } else { "asleep" };
    let (ratio, [stock, stock_first], [ours, first]) = (stock[0] / ours[0], stock, ours);
    println!(
        "{bodies},{layout},{ground},{motion},{query},{stock:.1},{ours:.1},{ratio:.3},{stock_first:.0},{first:.0}"
    );
}

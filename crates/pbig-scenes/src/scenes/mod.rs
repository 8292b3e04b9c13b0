//! Scenes by name, count and seed. Built with glam; the same world for the same three, every time.
//!
//! The workspace for rapier 0.36 builds the same scenes from this file: what differs between versions of rapier is in `world`.

mod ragdolls;

use crate::world::{World, groups_that_meet, heights, pose, to_rotation, to_vector};
use glam::{EulerRot, Quat, Vec3};
use ragdolls::ragdolls;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use rapier3d::prelude::*;

/// A named scene.
#[derive(Clone, Copy)]
pub struct Scene {
    /// The name on the command line.
    pub name: &'static str,
    /// A description in a few words.
    pub about: &'static str,
    /// Bodies when the user does not say how many.
    pub default_bodies: usize,
    build: fn(&mut Builder, usize),
}

/// A world under construction, with its random numbers.
struct Builder {
    world: World,
    rng: StdRng,
}

impl Scene {
    /// Every scene.
    pub const ALL: [Self; 14] = [
        Self {
            name: "column",
            about: "spheres, cubes and slabs fall in a column onto a plane (Avril, figure 1)",
            default_bodies: 1000,
            build: column,
        },
        Self {
            name: "spheres",
            about: "the column with spheres alone",
            default_bodies: 1000,
            build: |b, n| fall(b, n, sphere),
        },
        Self {
            name: "cubes",
            about: "the column with cubes alone",
            default_bodies: 1000,
            build: |b, n| fall(b, n, cube),
        },
        Self {
            name: "slabs",
            about: "the column with slabs alone",
            default_bodies: 1000,
            build: |b, n| fall(b, n, slab),
        },
        Self {
            name: "pile",
            about: "cubes stacked close together settle and fall asleep",
            default_bodies: 1000,
            build: pile,
        },
        Self { name: "pyramid", about: "a pyramid of cubes at rest", default_bodies: 650, build: pyramid },
        Self {
            name: "mixed",
            about: "sizes from 0.05 to 50 fall together",
            default_bodies: 600,
            build: mixed,
        },
        Self {
            name: "city",
            about: "fixed blocks in streets, few movers among them",
            default_bodies: 3000,
            build: city,
        },
        Self {
            name: "rain",
            about: "small drops fall fast over a wide, hilly ground, thinly spread",
            default_bodies: 1500,
            build: rain,
        },
        Self {
            name: "ragdolls",
            about: "figures of eleven jointed capsules fall over each other",
            default_bodies: 660,
            build: ragdolls,
        },
        Self {
            name: "sensors",
            about: "spheres fall through layers of sensors, some that see fixed bodies too",
            default_bodies: 800,
            build: sensors,
        },
        Self {
            name: "compounds",
            about: "bodies of several colliders, and compound shapes, fall",
            default_bodies: 500,
            build: compounds,
        },
        Self {
            name: "sleeping",
            about: "one awake body among sleeping ones",
            default_bodies: 20_000,
            build: sleeping,
        },
        Self {
            name: "groups",
            about: "crowds in groups that ignore each other, kinematic bodies and moving walls",
            default_bodies: 800,
            build: groups,
        },
    ];

    /// The scene with this name, or an error that lists them all.
    pub fn named(name: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(|scene| scene.name).join(", ");
        let found = Self::ALL.into_iter().find(|scene| scene.name == name);
        found.ok_or_else(|| format!("no scene is called '{name}'; there are: {}", names()))
    }

    /// Builds the world with about `bodies` bodies.
    pub fn build(&self, bodies: usize, seed: u64) -> World {
        let mut builder = Builder { world: World::default(), rng: StdRng::seed_from_u64(seed) };
        (self.build)(&mut builder, bodies);
        builder.world
    }
}

impl Builder {
    fn random(&mut self, low: f32, high: f32) -> f32 {
        self.rng.random_range(low..high)
    }

    fn random_vec(&mut self, reach: Vec3) -> Vec3 {
        let mut along = |r: f32| if r > 0.0 { self.random(-r, r) } else { 0.0 };
        Vec3::new(along(reach.x), along(reach.y), along(reach.z))
    }

    fn random_turn(&mut self) -> Quat {
        let angles = self.random_vec(Vec3::splat(std::f32::consts::PI));
        Quat::from_euler(EulerRot::XYZ, angles.x, angles.y, angles.z)
    }

    fn ground(&mut self) {
        self.world.colliders.insert(World::ground());
    }

    fn falling(&mut self, at: Vec3, collider: ColliderBuilder) -> RigidBodyHandle {
        let turn = self.random_turn();
        self.world.add(World::dynamic(at).rotation(to_rotation(turn)), collider)
    }

    fn fixed(&mut self, at: Vec3, collider: ColliderBuilder) {
        self.world.colliders.insert(collider.translation(to_vector(at)));
    }
}

/// The `i`-th place of a square column, layer by layer from the ground.
fn lattice(i: usize, side: usize) -> Vec3 {
    Vec3::new((i % side) as f32, (i / side / side) as f32, (i / side % side) as f32)
}

fn sphere(i: usize) -> ColliderBuilder {
    ColliderBuilder::ball(0.3 + 0.05 * (i % 5) as f32)
}

fn cube(i: usize) -> ColliderBuilder {
    let half = 0.3 + 0.04 * (i % 5) as f32;
    ColliderBuilder::cuboid(half, half, half)
}

fn slab(i: usize) -> ColliderBuilder {
    let half = 0.4 + 0.05 * (i % 4) as f32;
    ColliderBuilder::cuboid(half, 0.1, half)
}

/// A square column, at most 24 wide so that it is tall, above the ground.
fn fall(b: &mut Builder, n: usize, shape: fn(usize) -> ColliderBuilder) {
    b.ground();
    let side = ((n as f32 / 4.0).cbrt().ceil() as usize).clamp(1, 24);
    for i in 0..n {
        let place = lattice(i, side);
        let at = place * 1.3 + b.random_vec(Vec3::splat(0.1)) + Vec3::Y * 1.5;
        b.falling(at, shape(i));
    }
}

fn column(b: &mut Builder, n: usize) {
    fall(b, n, |i| [sphere, cube, slab][i % 3](i));
}

fn pile(b: &mut Builder, n: usize) {
    b.ground();
    let side = (n as f32).cbrt().ceil() as usize;
    for i in 0..n {
        let place = lattice(i, side);
        let at = place * 1.02 + b.random_vec(Vec3::new(0.01, 0.0, 0.01)) + Vec3::Y * 0.51;
        b.world.add(World::dynamic(at), ColliderBuilder::cuboid(0.5, 0.5, 0.5));
    }
}

fn pyramid(b: &mut Builder, n: usize) {
    b.ground();
    let mut left = n;
    let levels = (1..).find(|&k: &usize| k * (k + 1) * (2 * k + 1) / 6 >= n).unwrap_or(1);
    for level in 0..levels {
        let side = levels - level;
        for i in 0..(side * side).min(left) {
            let corner = Vec3::new(level as f32 * 0.5, level as f32 + 0.5, level as f32 * 0.5);
            let at = corner + Vec3::new((i % side) as f32, 0.0, (i / side) as f32);
            b.world.add(World::dynamic(at), ColliderBuilder::cuboid(0.495, 0.495, 0.495));
        }
        left = left.saturating_sub(side * side);
    }
}

/// Log-uniform sizes; each on its own level above the larger ones, so that nothing starts inside.
fn mixed(b: &mut Builder, n: usize) {
    b.ground();
    let mut sizes: Vec<f32> = (0..n).map(|_| 0.025 * 1000f32.powf(b.random(0.0, 1.0))).collect();
    sizes.sort_by(|x, y| y.total_cmp(x));
    let width = (n as f32).sqrt() * 2.0 + 50.0;
    let mut height = 0.0;
    for (i, half) in sizes.into_iter().enumerate() {
        height += 2.0 * half / (width / (2.2 * half)).max(1.0).powi(2) + 1e-3;
        let free = (width - half).max(0.0);
        let at = b.random_vec(Vec3::new(free, 0.0, free)) + Vec3::Y * (height + half);
        let shape =
            if i % 2 == 0 { ColliderBuilder::ball(half) } else { ColliderBuilder::cuboid(half, half, half) };
        b.falling(at, shape);
    }
}

fn city(b: &mut Builder, n: usize) {
    b.ground();
    let side = (n as f32).sqrt().ceil() as usize;
    for i in 0..n {
        let at = Vec3::new((i % side) as f32, 0.0, (i / side) as f32) * 4.0;
        if i % 50 == 0 {
            let up = b.random(10.0, 20.0);
            let body = World::dynamic(at + Vec3::Y * up + Vec3::X * 2.0)
                .linvel(to_vector(b.random_vec(Vec3::splat(5.0))));
            b.world.add(body, ColliderBuilder::ball(0.4));
        } else {
            let half_height = b.random(0.5, 6.0);
            b.fixed(at + Vec3::Y * half_height, ColliderBuilder::cuboid(1.5, half_height, 1.5));
        }
    }
}

fn rain(b: &mut Builder, n: usize) {
    let wide = (n as f32).sqrt() * 3.0;
    let hills = heights(24, |i, j| (i as f32 * 0.7).sin() + (j as f32 * 0.9).cos());
    let scale = to_vector(Vec3::new(wide, 1.0, wide));
    b.world.colliders.insert(ColliderBuilder::heightfield(hills, scale));
    for _ in 0..n {
        let at = b.random_vec(Vec3::new(wide * 0.49, 0.0, wide * 0.49)) + Vec3::Y * b.random(3.0, 60.0);
        let down = b.random(-40.0, -10.0);
        let body = World::dynamic(at).linvel(to_vector(Vec3::Y * down)).ccd_enabled(true);
        b.world.add(body, ColliderBuilder::ball(0.08).restitution(0.3));
    }
}

fn sensors(b: &mut Builder, n: usize) {
    b.ground();
    let side = (n as f32 / 4.0).sqrt().ceil() as usize;
    for i in 0..n {
        let place = lattice(i, side) * 1.5;
        let types = ActiveCollisionTypes::default() | ActiveCollisionTypes::FIXED_FIXED;
        match i % 3 {
            0 => {
                let half = b.random(0.4, 1.2);
                let sensor = ColliderBuilder::cuboid(half, half, half).sensor(true);
                let sees_fixed = if i % 2 == 0 { sensor.active_collision_types(types) } else { sensor };
                b.fixed(place + Vec3::Y, sees_fixed);
            }
            _ => {
                let jitter = b.random_vec(Vec3::splat(0.2));
                b.falling(place + jitter + Vec3::Y * 6.0, sphere(i));
            }
        }
    }
}

fn compounds(b: &mut Builder, n: usize) {
    b.ground();
    let side = (n as f32 / 4.0).cbrt().ceil() as usize;
    for i in 0..n {
        let place = lattice(i, side);
        let at = place * 2.6 + b.random_vec(Vec3::splat(0.1)) + Vec3::Y * 2.0;
        if i % 3 == 0 {
            let cube = || SharedShape::cuboid(0.3, 0.3, 0.3);
            let shapes =
                vec![(pose(Vec3::new(-0.4, 0.0, 0.0)), cube()), (pose(Vec3::new(0.4, 0.2, 0.0)), cube())];
            b.falling(at, ColliderBuilder::compound(shapes));
        } else {
            let body = b.falling(at, ColliderBuilder::ball(0.35));
            for x in [-0.6, 0.6] {
                let arm = ColliderBuilder::cuboid(0.4, 0.15, 0.15).translation(to_vector(Vec3::X * x));
                b.world.colliders.insert_with_parent(arm, body, &mut b.world.bodies);
            }
        }
    }
}

fn sleeping(b: &mut Builder, n: usize) {
    b.ground();
    let side = (n as f32).sqrt().ceil() as usize;
    for i in 0..n.saturating_sub(1) {
        let at = Vec3::new((i % side) as f32 * 1.1, 0.5, (i / side) as f32 * 1.1);
        b.world.add(World::dynamic(at).sleeping(true), ColliderBuilder::cuboid(0.5, 0.5, 0.5));
    }
    let middle = side as f32 * 0.55;
    let awake = World::dynamic(Vec3::new(middle, 8.0, middle)).linvel(to_vector(Vec3::new(3.0, 0.0, 0.5)));
    b.world.add(awake.can_sleep(false), ColliderBuilder::ball(0.4));
}

fn groups(b: &mut Builder, n: usize) {
    b.ground();
    let side = (n as f32 / 3.0).cbrt().ceil() as usize;
    for i in 0..n {
        // Three crowds in one place: neighbours in the list stand inside each other.
        let spot = i / 3;
        let place = lattice(spot, side);
        let at = place * 1.3 + b.random_vec(Vec3::splat(0.05)) + Vec3::Y;
        let own = Group::from_bits_truncate(1 << (i % 3));
        let groups = groups_that_meet(own, own | Group::GROUP_4);
        b.falling(at, cube(i).collision_groups(groups));
    }
    let all = groups_that_meet(Group::GROUP_4, Group::ALL);
    for x in [-4.0, 4.0 + side as f32 * 1.3] {
        let wall = RigidBodyBuilder::kinematic_velocity_based()
            .translation(to_vector(Vec3::new(x, 3.0, 0.0)))
            .linvel(to_vector(Vec3::X * -x.signum()));
        let reach = side as f32 * 1.3;
        b.world.add(wall, ColliderBuilder::cuboid(0.5, 3.0, reach).collision_groups(all));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scene_builds_at_every_size_and_the_same_each_time() {
        for scene in Scene::ALL {
            for bodies in [1, 2, 7, 100] {
                let world = scene.build(bodies, 1);
                assert!(!world.colliders.is_empty(), "{}, {bodies} bodies", scene.name);
                assert_eq!(world.pose_bits(), scene.build(bodies, 1).pose_bits(), "{}", scene.name);
            }
            assert!(!scene.about.is_empty());
        }
    }

    #[test]
    fn a_wrong_name_is_answered_with_the_right_ones() {
        let error = Scene::named("colum").map(|s| s.name).unwrap_err();
        assert!(error.contains("'colum'") && error.contains("column, spheres"), "{error}");
    }
}

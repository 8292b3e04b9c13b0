//! A world at a place: in f64, as rapier holds it, and its boxes in f32 by every way there is to them.

use crate::wide::{Differences, Layout, Pose, Truth, Wide, doubt, to_f32, to_f64, widened_by_ulps};
use pbig_core::{Aabb, Config, Finder, Limits, Pair};
use pbig_harness::output::Failure;
use pbig_harness::scenes::Scene;
use rapier_pbig::{PbigConfig, collision_aabb};
use rapier3d::prelude::{Collider, IntegrationParameters, RigidBodySet};

/// The way to make boxes in f32.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Way {
    /// Rapier's, widened by so many ulps.
    Ulps(u32),
    /// The same, and the margin that the drop-in stores them with.
    Margin(u32),
    /// In f64 at poses in f64, rounded outward: what f32 cannot do without.
    Outward,
}

/// Every way, in the order of tables; what takes time comes first.
pub(super) const WAYS: [Way; 8] = [
    Way::Ulps(0),
    Way::Ulps(1),
    Way::Ulps(2),
    Way::Ulps(3),
    Way::Ulps(4),
    Way::Outward,
    Way::Margin(0),
    Way::Margin(2),
];

/// The way that misses nothing at the poses that rapier holds.
pub(super) const AT_POSES: Way = Way::Ulps(2);

/// The way that misses nothing of the world, whose poses are in f64.
pub(super) const IN_WORLD: Way = Way::Ulps(3);

impl Way {
    pub(super) fn name(self) -> String {
        match self {
            Self::Ulps(0) => "rapier's boxes".into(),
            Self::Ulps(1) => "widened by 1 ulp".into(),
            Self::Ulps(ulps) => format!("widened by {ulps} ulps"),
            Self::Margin(0) => "rapier's boxes, with the margin".into(),
            Self::Margin(ulps) => format!("widened by {ulps} ulps, with the margin"),
            Self::Outward => "f64, rounded outward".into(),
        }
    }

    /// Its place in [`WAYS`].
    pub(super) fn index(self) -> usize {
        WAYS.iter().position(|&way| way == self).unwrap_or(0)
    }
}

/// A world near the origin.
pub(super) struct World {
    pub(super) name: &'static str,
    /// About how large its shapes are.
    pub(super) size: f64,
    pub(super) layout: Layout,
    /// True if it is moved along one axis, too.
    pub(super) along_x: bool,
}

/// The worlds; `count` shapes in each, or a fifth where at last all lie in one place.
pub(super) fn worlds(count: usize) -> Result<Vec<World>, Failure> {
    let crowd = |name, size: f64, count| World {
        name,
        size,
        layout: Layout::crowd(count, size, 1),
        along_x: size == 1.0,
    };
    let scene = |name| -> Result<World, Failure> {
        let built = Scene::named(name).map_err(Failure::Input)?.build(count, 1);
        Ok(World { name, size: 1.0, layout: Layout::of_world(&built), along_x: true })
    };
    Ok(vec![
        crowd("crowd", 1.0, count),
        crowd("crowd, a tenth as large", 0.1, count / 5),
        crowd("crowd, ten times as large", 10.0, count / 5),
        scene("column")?,
        scene("ragdolls")?,
        scene("pile")?,
    ])
}

/// Which way a world is moved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Along {
    Diagonal,
    X,
}

/// A world that has been moved.
pub(super) struct Place<'a> {
    layout: &'a Layout,
    poses: Vec<Pose>,
    colliders: Vec<Collider>,
    params: IntegrationParameters,
    /// Boxes in f64 at poses in f64.
    pub(super) world: Truth,
    /// Boxes in f64 at the poses that rapier holds in f32.
    pub(super) held: Truth,
}

impl<'a> Place<'a> {
    pub(super) fn new(layout: &'a Layout, offset: f64, along: Along) -> Self {
        let poses = match along {
            Along::Diagonal => layout.poses([offset; 3]),
            Along::X => layout.poses([offset, 0.0, 0.0]),
        };
        Self::at(layout, poses)
    }

    /// Shapes at poses of their own.
    pub(super) fn at(layout: &'a Layout, poses: Vec<Pose>) -> Self {
        let params = IntegrationParameters::default();
        let narrow: Vec<_> = poses.iter().map(to_f32).collect();
        let held: Vec<_> = narrow.iter().map(to_f64).collect();
        let truth = |poses: &[Pose]| {
            let boxes = layout.boxes(poses, f64::from(params.prediction_distance() / 2.0));
            Truth::of(boxes, doubt(farthest(poses)))
        };
        let (world, held) = (truth(&poses), truth(&held));
        Self { layout, colliders: layout.colliders(&narrow), poses, params, world, held }
    }

    /// Twice what boxes reach beyond shapes: boxes that overlap by more are of shapes whose own do.
    pub(super) fn reach(&self) -> f64 {
        f64::from(self.params.prediction_distance())
    }

    pub(super) fn len(&self) -> usize {
        self.colliders.len()
    }

    pub(super) fn boxes(&self, way: Way) -> Vec<Aabb> {
        match way {
            Way::Ulps(ulps) => self.rapiers(ulps),
            Way::Margin(ulps) => {
                let margin = PbigConfig::DEFAULT.margin;
                self.rapiers(ulps).iter().map(|aabb| aabb.inflated(margin)).collect()
            }
            Way::Outward => {
                let boxes = self.layout.boxes(&self.poses, self.reach() / 2.0);
                boxes.iter().map(Wide::outward).collect()
            }
        }
    }

    fn rapiers(&self, ulps: u32) -> Vec<Aabb> {
        rapiers(&self.params, self.colliders.iter(), ulps)
    }

    /// Compares the pairs of boxes in f32 with those in f64: at the poses that rapier holds, and in the world.
    fn differences(&self, way: Way) -> Result<[Differences; 2], Failure> {
        let mut finder = finder();
        let found = finder.find(&self.boxes(way));
        let found = found.map_err(|error| Failure::Input(format!("{}: {error}", way.name())))?;
        Ok([&self.held, &self.world].map(|truth| truth.differences(found, self.reach())))
    }

    /// Returns the largest distance by which a bound of rapier's boxes ends inside the one in f64, in ulps of [`widened_by_ulps`].
    fn shortfall(&self) -> f64 {
        let short = |((wide, aabb), collider): ((&Wide, &Aabb), &Collider)| {
            let units = units(aabb, collider);
            wide.shortfall(aabb).into_iter().zip(units).map(|(short, unit)| short / unit).fold(0.0, f64::max)
        };
        let rapiers = self.rapiers(0);
        let boxes = self.held.boxes.iter().zip(&rapiers).zip(&self.colliders);
        boxes.map(short).fold(0.0, f64::max)
    }
}

/// Boxes of colliders without bodies, or of bodies without soft CCD, widened by so many ulps.
pub(super) fn rapiers<'c>(
    params: &IntegrationParameters,
    colliders: impl Iterator<Item = &'c Collider>,
    ulps: u32,
) -> Vec<Aabb> {
    let none = RigidBodySet::new();
    let stock = |collider: &Collider| collision_aabb(params, &none, collider);
    if ulps == 0 {
        return colliders.map(stock).collect();
    }
    colliders.map(|one| widened_by_ulps(&stock(one), one.position(), ulps)).collect()
}

/// By how much one ulp of [`widened_by_ulps`] widens a box on each axis.
fn units(aabb: &Aabb, collider: &Collider) -> [f64; 3] {
    // So many that rounding of the widened bound is nothing beside them; a power of two, which rounds nothing itself.
    const MANY: u32 = 1024;
    let wide = widened_by_ulps(aabb, collider.position(), MANY);
    std::array::from_fn(|k| (f64::from(wide.max[k]) - f64::from(aabb.max[k])) / f64::from(MANY))
}

pub(super) fn finder() -> Finder {
    Finder::new(Config { limits: Limits::UNLIMITED, ..Config::DEFAULT })
}

fn farthest(poses: &[Pose]) -> f64 {
    poses.iter().map(|pose| pose.translation.vector.amax()).fold(0.0, f64::max)
}

/// From one f32 to the next.
pub(super) fn ulp(x: f64) -> f64 {
    f64::from(f32::EPSILON) * x.abs().log2().floor().exp2()
}

/// The results of a world at a place.
#[derive(Clone)]
pub(super) struct Row {
    pub(super) world: &'static str,
    pub(super) size: f64,
    pub(super) offset: f64,
    pub(super) along: Along,
    /// In f64.
    pub(super) pairs: u64,
    /// In f64 at the poses in f32.
    pub(super) held_pairs: u64,
    /// Boxes in f64 at the poses in f32, against the world.
    pub(super) poses: Differences,
    /// By way: against boxes in f64 at the same poses, and against the world.
    pub(super) ways: Vec<[Differences; 2]>,
    /// Of rapier's boxes at the poses that it holds, in ulps as [`widened_by_ulps`] has them.
    pub(super) shortfall: f64,
}

impl Row {
    pub(super) fn new(world: &World, offset: f64, along: Along) -> Result<Self, Failure> {
        Self::of(world.name, world.size, (offset, along), &Place::new(&world.layout, offset, along))
    }

    pub(super) fn of(
        world: &'static str,
        size: f64,
        (offset, along): (f64, Along),
        place: &Place<'_>,
    ) -> Result<Self, Failure> {
        let held: Vec<Pair> = place.held.pairs.iter().map(|(pair, _)| *pair).collect();
        let ways: Result<_, Failure> = WAYS.iter().map(|&way| place.differences(way)).collect();
        Ok(Self {
            world,
            size,
            offset,
            along,
            pairs: place.world.pairs.len() as u64,
            held_pairs: held.len() as u64,
            poses: place.world.differences(&held, place.reach()),
            ways: ways?,
            shortfall: place.shortfall(),
        })
    }

    /// With what became of the same world later.
    pub(super) fn and(mut self, later: &Self) -> Self {
        self.pairs += later.pairs;
        self.held_pairs += later.held_pairs;
        self.poses += later.poses;
        for (sums, more) in self.ways.iter_mut().zip(&later.ways) {
            sums.iter_mut().zip(more).for_each(|(sum, &one)| *sum += one);
        }
        self.shortfall = self.shortfall.max(later.shortfall);
        self
    }

    /// Against boxes in f64 at the same poses.
    pub(super) fn by_boxes(&self, way: Way) -> Differences {
        self.ways[way.index()][0]
    }

    /// Against the world.
    pub(super) fn in_all(&self, way: Way) -> Differences {
        self.ways[way.index()][1]
    }

    /// Missed and added, against the world, in percent of its pairs.
    pub(super) fn wrong_percent(&self, way: Way) -> f64 {
        let Differences { missed, added, .. } = self.in_all(way);
        (missed + added) as f64 / self.pairs.max(1) as f64 * 100.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shortfall_is_counted_in_what_a_box_is_widened_by() {
        let ball = |at: f32| {
            rapier3d::prelude::ColliderBuilder::ball(0.5).translation([at, 0.0, 0.0].into()).build()
        };
        let of = |at: f32| units(&Aabb::from_center([at, 0.0, 0.0], [0.5; 3]), &ball(at));
        // On x an ulp of 10^7 + 1, on the others one of 1; and 2^-17 of what the box reaches: 0.5.
        let near = 2f64.powi(-23) + 2f64.powi(-18);
        for (found, right) in of(1e7).into_iter().zip([1.0 + 2f64.powi(-18), near, near]) {
            assert!((found / right - 1.0).abs() < 1e-2, "{found}, not {right}");
        }
        let worlds = worlds(100).expect("worlds");
        let far = Row::new(&worlds[0], 1e5, Along::Diagonal).expect("a row");
        assert!(far.shortfall > 0.0 && far.shortfall < 2.0, "{}: no more than is proved", far.shortfall);
    }
}

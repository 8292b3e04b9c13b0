//! The scene queries of a frame: their kinds, and the places and directions that they ask about. A frame is a step and the
//! queries after it, as a game has them. Nothing here uses rapier, so every version of rapier gets the same queries.

use glam::Vec3;

/// The longest way of a ray, in metres.
pub const MAX_DISTANCE_METRES: f32 = 100.0;

/// Half the length of the segment in the character's capsule, in metres.
pub const CAPSULE_HALF_HEIGHT_METRES: f32 = 0.6;

/// The radius of the character's capsule, in metres.
pub const CAPSULE_RADIUS_METRES: f32 = 0.3;

/// The time of a frame, in seconds.
pub const FRAME_SECONDS: f32 = 1.0 / 60.0;

/// Metres per second.
const WALKING_SPEED: f32 = 4.0;

/// The part of a character's motion that goes down in each frame, in metres. It keeps the character on the ground.
const FALL_METRES: f32 = 0.05;

const FRAMES_PER_HEADING: u64 = 30;

/// The queries of one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameKind {
    None,
    Ray,
    Rays10000,
    /// One move of a character controller with a capsule.
    Character,
}

impl FrameKind {
    pub const ALL: [Self; 4] = [Self::None, Self::Ray, Self::Rays10000, Self::Character];

    /// Returns the name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Ray => "ray",
            Self::Rays10000 => "rays-10000",
            Self::Character => "character",
        }
    }

    /// Returns the kind with this name, or an error that lists them all.
    ///
    /// # Errors
    /// If no kind has this name.
    pub fn named(name: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|kind| kind.name() == name);
        found.ok_or_else(|| format!("no kind of query is called '{name}'; there are: {}", names()))
    }

    pub fn queries(self) -> u64 {
        match self {
            Self::None => 0,
            Self::Rays10000 => 10_000,
            Self::Ray | Self::Character => 1,
        }
    }
}

/// A place and a direction to ask about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Query {
    pub origin: Vec3,
    /// A unit vector.
    pub direction: Vec3,
}

/// An AABB around all bodies that can move, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    pub min: Vec3,
    pub max: Vec3,
}

impl Extent {
    /// Returns the AABB around AABBs, each as its lower and its upper corner. Without any it reaches a metre from the origin.
    pub fn around(aabbs: impl IntoIterator<Item = [Vec3; 2]>) -> Self {
        let union = |one: [Vec3; 2], other: [Vec3; 2]| [one[0].min(other[0]), one[1].max(other[1])];
        let [min, max] = aabbs.into_iter().reduce(union).unwrap_or([Vec3::NEG_ONE, Vec3::ONE]);
        Self { min, max }
    }

    /// Returns a query of a frame. It starts anywhere inside, and points mostly down or mostly across.
    pub fn query(&self, frame: u64, number: u64) -> Query {
        let random = |part| unit(frame, number, part);
        let share = Vec3::new(random(0), random(1), random(2));
        let slant = 2.0 * Vec3::new(random(3), random(4), random(5)) - Vec3::ONE;
        let is_down = random(6) < 0.5;
        let direction = if is_down { slant * 0.3 - Vec3::Y } else { across(slant) };
        Query { origin: self.min + share * (self.max - self.min), direction: direction.normalize() }
    }

    pub fn queries(self, kind: FrameKind, frame: u64) -> impl Iterator<Item = Query> {
        (0..kind.queries()).map(move |number| self.query(frame, number))
    }

    /// Returns the centre of the character's capsule in the first frame: beside all bodies, above a ground at height 0.
    pub fn character_start(&self) -> Vec3 {
        let middle = 0.5 * (self.min.z + self.max.z);
        Vec3::new(self.min.x - 1.0, CAPSULE_HALF_HEIGHT_METRES + CAPSULE_RADIUS_METRES + 0.1, middle)
    }

    /// Returns the character's wanted motion in a frame, in metres. The character crosses the extent to and fro, and turns a
    /// little twice a second. The motion does not depend on the way so far, so it is the same beside every broad phase.
    pub fn character_motion(&self, frame: u64) -> Vec3 {
        let metres = WALKING_SPEED * FRAME_SECONDS;
        let frames_across = ((self.max.x - self.min.x + 2.0) / metres).max(1.0) as u64;
        let ahead = if (frame / frames_across).is_multiple_of(2) { 1.0 } else { -1.0 };
        let aside = 2.0 * unit(frame / FRAMES_PER_HEADING, 0, 7) - 1.0;
        Vec3::new(ahead, 0.0, aside).normalize() * metres - Vec3::Y * FALL_METRES
    }
}

/// Returns a direction that is more level than steep, of any length but 0.
fn across(slant: Vec3) -> Vec3 {
    let level = Vec3::new(slant.x, 0.0, slant.z).normalize_or(Vec3::X);
    level + Vec3::Y * 0.2 * slant.y
}

/// Returns a number from 0 up to 1 that depends on the arguments alone: the finalizer of SplitMix64. `number` is below 2^29,
/// `part` below 8.
fn unit(frame: u64, number: u64, part: u64) -> f32 {
    let mut bits = (frame << 32 | number << 3 | part).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^= bits >> 31;
    // An f32 holds 24 bits exactly.
    (bits >> 40) as f32 / (1u32 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extent() -> Extent {
        Extent::around([[Vec3::new(-3.0, 0.0, 1.0), Vec3::ONE], [Vec3::ZERO, Vec3::new(1.0, 20.0, 5.0)]])
    }

    #[test]
    fn an_extent_by_hand() {
        assert_eq!(extent(), Extent { min: Vec3::new(-3.0, 0.0, 0.0), max: Vec3::new(1.0, 20.0, 5.0) });
        assert_eq!(Extent::around([]), Extent { min: Vec3::NEG_ONE, max: Vec3::ONE });
    }

    #[test]
    fn kinds_have_names_and_a_wrong_name_lists_them() {
        for kind in FrameKind::ALL {
            assert_eq!(FrameKind::named(kind.name()), Ok(kind));
            assert_eq!(extent().queries(kind, 3).count() as u64, kind.queries());
        }
        let error = FrameKind::named("rays").unwrap_err();
        assert!(error.contains("'rays'") && error.contains("none, ray, rays-10000"), "{error}");
    }

    #[test]
    fn queries_lie_inside_repeat_and_half_of_them_point_down() {
        let (extent, kind) = (extent(), FrameKind::Rays10000);
        let queries: Vec<Query> = extent.queries(kind, 7).collect();
        for query in &queries {
            assert!(
                query.origin.cmpge(extent.min).all() && query.origin.cmple(extent.max).all(),
                "{query:?}"
            );
            assert!(query.direction.is_normalized(), "{query:?}");
        }
        let down = queries.iter().filter(|query| query.direction.y < -0.7).count();
        assert!((4500..5500).contains(&down), "{down}");
        assert!(extent.queries(kind, 7).eq(queries.iter().copied()));
        assert!(extent.queries(kind, 8).zip(&queries).all(|(other, query)| other != *query));
    }

    #[test]
    fn the_character_comes_back() {
        let extent = extent();
        let mut at = extent.character_start();
        let across: Vec<f32> = (0..180)
            .map(|frame| {
                at += extent.character_motion(frame);
                at.x
            })
            .collect();
        let farthest = across.iter().copied().fold(f32::MIN, f32::max);
        assert!(farthest > extent.min.x && farthest < extent.max.x + 1.0, "{farthest}");
        assert!(across[179] < farthest - 1.0, "{across:?}");
    }
}

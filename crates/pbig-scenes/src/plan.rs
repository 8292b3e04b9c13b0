//! A world as plain data: bodies, colliders and joints, for any version of rapier.

use glam::{Quat, Vec3};

/// Everything that a world begins with, in the order in which it is inserted.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Acceleration, m/s^2.
    pub gravity: Vec3,
    pub bodies: Vec<Body>,
    pub colliders: Vec<Collider>,
    pub joints: Vec<Joint>,
}

impl Default for Plan {
    fn default() -> Self {
        let (bodies, colliders, joints) = Default::default();
        Self { gravity: Vec3::new(0.0, -9.81, 0.0), bodies, colliders, joints }
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BodyKind {
    #[default]
    Dynamic,
    Fixed,
    /// Moved by its velocity, which no force changes.
    Kinematic,
}

#[derive(Clone, Debug, Default)]
pub struct Body {
    pub kind: BodyKind,
    pub at: Vec3,
    pub turn: Quat,
    /// Velocity, m/s.
    pub linvel: Vec3,
    /// Angular velocity, radians a second.
    pub angvel: Vec3,
    pub can_sleep: bool,
    pub is_sleeping: bool,
    pub has_ccd: bool,
    /// The distance in which contacts are predicted.
    pub soft_ccd: f32,
}

impl Body {
    pub fn dynamic(at: Vec3) -> Self {
        Self { at, can_sleep: true, ..Self::default() }
    }

    pub fn fixed(at: Vec3) -> Self {
        Self { kind: BodyKind::Fixed, ..Self::dynamic(at) }
    }

    pub fn kinematic(at: Vec3) -> Self {
        Self { kind: BodyKind::Kinematic, ..Self::dynamic(at) }
    }

    pub fn turned(self, turn: Quat) -> Self {
        Self { turn, ..self }
    }

    pub fn linvel(self, linvel: Vec3) -> Self {
        Self { linvel, ..self }
    }

    pub fn angvel(self, angvel: Vec3) -> Self {
        Self { angvel, ..self }
    }

    pub fn sleepless(self) -> Self {
        Self { can_sleep: false, ..self }
    }
}

#[derive(Clone, Debug, Default)]
pub enum Shape {
    #[default]
    HalfSpace,
    Ball(f32),
    /// Half the extents.
    Cuboid(Vec3),
    /// Half the vector from the centre of one end to the other, along an axis, and the radius.
    Capsule(Vec3, f32),
    /// The number of samples along each side, the heights (those along z side by side), and the extents.
    Heights(usize, Vec<f32>, Vec3),
    Compound(Vec<(Vec3, Shape)>),
}

#[derive(Clone, Debug, Default)]
pub struct Collider {
    pub shape: Shape,
    pub body: Option<usize>,
    pub at: Vec3,
    pub turn: Quat,
    pub friction: Option<f32>,
    pub restitution: Option<f32>,
    pub is_sensor: bool,
    /// Pairs of fixed colliders count, too.
    pub sees_fixed: bool,
    /// Its groups, and those that it meets.
    pub groups: Option<[u32; 2]>,
}

impl Collider {
    pub fn new(shape: Shape) -> Self {
        Self { shape, ..Self::default() }
    }

    pub fn ball(radius: f32) -> Self {
        Self::new(Shape::Ball(radius))
    }

    pub fn cuboid(x: f32, y: f32, z: f32) -> Self {
        Self::new(Shape::Cuboid(Vec3::new(x, y, z)))
    }

    /// Returns a capsule by half its length along x, and its radius.
    pub fn capsule_x(half: f32, radius: f32) -> Self {
        Self::new(Shape::Capsule(Vec3::X * half, radius))
    }

    /// Returns a capsule by half its length along y, and its radius.
    pub fn capsule_y(half: f32, radius: f32) -> Self {
        Self::new(Shape::Capsule(Vec3::Y * half, radius))
    }

    pub fn at(self, at: Vec3) -> Self {
        Self { at, ..self }
    }

    pub fn friction(self, friction: f32) -> Self {
        Self { friction: Some(friction), ..self }
    }

    pub fn restitution(self, restitution: f32) -> Self {
        Self { restitution: Some(restitution), ..self }
    }

    pub fn sensor(self) -> Self {
        Self { is_sensor: true, ..self }
    }

    pub fn groups(self, own: u32, met: u32) -> Self {
        Self { groups: Some([own, met]), ..self }
    }
}

/// The freedom that a joint leaves.
#[derive(Clone, Copy, Debug)]
pub enum JointKind {
    /// Rotations by at most some radians around each axis.
    Socket(f32),
    /// A rotation around an axis, between two angles in radians.
    Hinge(Vec3, [f32; 2]),
    /// All motion. An acceleration pulls the second body to the first: 1/s^2, for each metre of distance.
    Pull(f32),
}

#[derive(Clone, Copy, Debug)]
pub struct Joint {
    pub kind: JointKind,
    pub bodies: [usize; 2],
    /// The place of the joint in the coordinates of each body.
    pub anchors: [Vec3; 2],
    /// False if the two bodies never touch.
    pub has_contacts: bool,
}

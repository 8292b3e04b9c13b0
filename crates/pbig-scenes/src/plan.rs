//! A world as plain data: bodies, colliders and joints, for any version of rapier.

use glam::{Quat, Vec3};

/// Everything that a world begins with, in the order in which it is inserted.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Acceleration, m/s^2.
    pub gravity: Vec3,
    /// Rigid bodies.
    pub bodies: Vec<Body>,
    /// Colliders.
    pub colliders: Vec<Collider>,
    /// Joints.
    pub joints: Vec<Joint>,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            gravity: Vec3::new(0.0, -9.81, 0.0),
            bodies: Vec::new(),
            colliders: Vec::new(),
            joints: Vec::new(),
        }
    }
}

/// The kind of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyKind {
    /// Moved by forces.
    Dynamic,
    /// Never moves.
    Fixed,
    /// Moved by its velocity, which no force changes.
    Kinematic,
}

/// A rigid body.
#[derive(Clone, Debug)]
pub struct Body {
    /// The kind.
    pub kind: BodyKind,
    /// The place.
    pub at: Vec3,
    /// The rotation.
    pub turn: Quat,
    /// Velocity, m/s.
    pub linvel: Vec3,
    /// Angular velocity, radians a second.
    pub angvel: Vec3,
    /// False if the body stays awake.
    pub can_sleep: bool,
    /// The body begins asleep.
    pub is_sleeping: bool,
    /// Continuous collision detection.
    pub has_ccd: bool,
    /// The distance in which contacts are predicted.
    pub soft_ccd: f32,
    /// The factor of gravity.
    pub gravity_scale: f32,
    /// The damping of the velocity.
    pub damping: f32,
    /// The body does not move along z.
    pub keeps_z: bool,
    /// The body has a kilogramme at its origin.
    pub has_own_mass: bool,
}

impl Body {
    fn new(kind: BodyKind) -> Self {
        Self {
            kind,
            at: Vec3::ZERO,
            turn: Quat::IDENTITY,
            linvel: Vec3::ZERO,
            angvel: Vec3::ZERO,
            can_sleep: true,
            is_sleeping: false,
            has_ccd: false,
            soft_ccd: 0.0,
            gravity_scale: 1.0,
            damping: 0.0,
            keeps_z: false,
            has_own_mass: false,
        }
    }

    /// Returns a dynamic body at a place.
    pub fn dynamic(at: Vec3) -> Self {
        Self { at, ..Self::new(BodyKind::Dynamic) }
    }

    /// Returns a fixed body at a place.
    pub fn fixed(at: Vec3) -> Self {
        Self { at, ..Self::new(BodyKind::Fixed) }
    }

    /// Returns a kinematic body at a place.
    pub fn kinematic(at: Vec3) -> Self {
        Self { at, ..Self::new(BodyKind::Kinematic) }
    }

    /// Sets the rotation.
    pub fn turned(self, turn: Quat) -> Self {
        Self { turn, ..self }
    }

    /// Sets the velocity.
    pub fn linvel(self, linvel: Vec3) -> Self {
        Self { linvel, ..self }
    }

    /// Sets the angular velocity.
    pub fn angvel(self, angvel: Vec3) -> Self {
        Self { angvel, ..self }
    }

    /// Keeps the body awake.
    pub fn sleepless(self) -> Self {
        Self { can_sleep: false, ..self }
    }
}

/// A shape around its origin.
#[derive(Clone, Debug)]
pub enum Shape {
    /// All below height 0.
    HalfSpace,
    /// A radius.
    Ball(f32),
    /// Half the extents, and the radius by which the cuboid is rounded, if it is.
    Cuboid(Vec3, Option<f32>),
    /// Half the vector from the centre of one end to the other, along an axis, and the radius.
    Capsule(Vec3, f32),
    /// Half the height, along y, and the radius.
    Cylinder(f32, f32),
    /// The number of samples along each side, the heights (those along z side by side), and the extents.
    Heights(usize, Vec<f32>, Vec3),
    /// Shapes at places.
    Compound(Vec<(Vec3, Shape)>),
}

/// A collider.
#[derive(Clone, Debug)]
pub struct Collider {
    /// The shape.
    pub shape: Shape,
    /// The number of the body that it belongs to, if any.
    pub body: Option<usize>,
    /// The place, in the body's coordinates.
    pub at: Vec3,
    /// The rotation, in the body's coordinates.
    pub turn: Quat,
    /// The density, if not rapier's default.
    pub density: Option<f32>,
    /// The friction, if not rapier's default.
    pub friction: Option<f32>,
    /// The restitution, if not rapier's default.
    pub restitution: Option<f32>,
    /// A sensor has no contacts.
    pub is_sensor: bool,
    /// Pairs of fixed colliders count, too.
    pub sees_fixed: bool,
    /// Its groups, and those that it meets.
    pub groups: Option<[u32; 2]>,
}

impl Collider {
    /// Returns a collider of a shape.
    pub fn new(shape: Shape) -> Self {
        Self {
            shape,
            body: None,
            at: Vec3::ZERO,
            turn: Quat::IDENTITY,
            density: None,
            friction: None,
            restitution: None,
            is_sensor: false,
            sees_fixed: false,
            groups: None,
        }
    }

    /// Returns a ball.
    pub fn ball(radius: f32) -> Self {
        Self::new(Shape::Ball(radius))
    }

    /// Returns a cuboid by half its extents.
    pub fn cuboid(x: f32, y: f32, z: f32) -> Self {
        Self::new(Shape::Cuboid(Vec3::new(x, y, z), None))
    }

    /// Returns a capsule by half its length along x, and its radius.
    pub fn capsule_x(half: f32, radius: f32) -> Self {
        Self::new(Shape::Capsule(Vec3::X * half, radius))
    }

    /// Returns a capsule by half its length along y, and its radius.
    pub fn capsule_y(half: f32, radius: f32) -> Self {
        Self::new(Shape::Capsule(Vec3::Y * half, radius))
    }

    /// Moves the collider.
    pub fn at(self, at: Vec3) -> Self {
        Self { at, ..self }
    }

    /// Sets the density.
    pub fn density(self, density: f32) -> Self {
        Self { density: Some(density), ..self }
    }

    /// Sets the friction.
    pub fn friction(self, friction: f32) -> Self {
        Self { friction: Some(friction), ..self }
    }

    /// Sets the restitution.
    pub fn restitution(self, restitution: f32) -> Self {
        Self { restitution: Some(restitution), ..self }
    }

    /// Makes the collider a sensor.
    pub fn sensor(self) -> Self {
        Self { is_sensor: true, ..self }
    }

    /// Sets the groups, and those that it meets.
    pub fn groups(self, own: u32, met: u32) -> Self {
        Self { groups: Some([own, met]), ..self }
    }
}

/// The freedom that a joint leaves.
#[derive(Clone, Copy, Debug)]
pub enum JointKind {
    /// All rotations, or at most some radians around each axis.
    Socket(Option<f32>),
    /// A rotation around an axis, between two angles in radians.
    Hinge(Vec3, [f32; 2]),
    /// All motion. An acceleration pulls the second body to the first: 1/s^2, for each metre of distance.
    Pull(f32),
}

/// A joint between two bodies.
#[derive(Clone, Copy, Debug)]
pub struct Joint {
    /// The freedom that it leaves.
    pub kind: JointKind,
    /// The numbers of the bodies.
    pub bodies: [usize; 2],
    /// The place of the joint in the coordinates of each body.
    pub anchors: [Vec3; 2],
    /// False if the two bodies never touch.
    pub has_contacts: bool,
}

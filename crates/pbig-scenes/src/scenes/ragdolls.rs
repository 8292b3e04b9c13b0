//! Bodies of joined limbs.

use super::builder::{Builder, lattice, side_of_square};
use crate::plan::{Body, Collider, Joint, JointKind};
use glam::{Quat, Vec3};

/// Rigid bodies of a figure: trunk, head, hips, and two to each limb.
const PARTS: usize = 11;
/// Figures above each other.
const LAYERS: usize = 6;
/// From figure to figure. A foot reaches 1.4 m from the middle of a figure, so none begins inside another.
const DISTANCE: f32 = 2.9;

/// Drops figures in a heap, each turned in its own way.
pub(super) fn ragdolls(b: &mut Builder, n: usize) {
    b.ground();
    let figures = n.div_ceil(PARTS);
    let side = side_of_square(figures.div_ceil(LAYERS));
    for i in 0..figures {
        let at = lattice(i, side) * DISTANCE + Vec3::Y * 1.5;
        let (turn, velocity) = (b.random_turn(), b.random_vec(Vec3::splat(2.0)));
        Figure { b, at, turn, velocity }.build();
    }
}

/// A figure in its own coordinates: it stands upright around the origin with its arms stretched out along x, and looks
/// along z. Lengths in metres.
struct Figure<'a> {
    b: &'a mut Builder,
    at: Vec3,
    turn: Quat,
    velocity: Vec3,
}

/// A rigid body of a figure and where its centre is.
#[derive(Clone, Copy)]
struct Part {
    body: usize,
    at: Vec3,
}

/// Two capsules in a line, from the joint with the trunk on.
struct Limb {
    start: Vec3,
    /// A unit vector, along the axis of the capsule.
    along: Vec3,
    capsule: fn(f32, f32) -> Collider,
    half: f32,
    radius: f32,
    /// The axis around which knee or elbow bends.
    axis: Vec3,
}

impl Figure<'_> {
    /// Adds all parts and joins them.
    fn build(mut self) {
        let trunk = self.part(Vec3::ZERO, Collider::capsule_y(0.2, 0.17));
        let head = self.part(Vec3::Y * 0.56, Collider::ball(0.16));
        self.socket(trunk, head, Vec3::Y * 0.39, 0.6);
        let hips = self.part(Vec3::Y * -0.44, Collider::capsule_x(0.08, 0.13));
        self.socket(trunk, hips, Vec3::Y * -0.34, 0.5);
        for side in [-1.0, 1.0] {
            self.limb(trunk, arm(side));
            self.limb(hips, leg(side));
        }
    }

    /// Adds a body.
    fn part(&mut self, at: Vec3, shape: Collider) -> Part {
        let body = Body::dynamic(self.at + self.turn * at).turned(self.turn).linvel(self.velocity);
        Part { body: self.b.add(body, shape), at }
    }

    /// Adds two bodies that hang on a third.
    fn limb(&mut self, parent: Part, limb: Limb) {
        let reach = limb.half + limb.radius;
        let [upper, lower] = [1.0, 3.0].map(|reaches| {
            self.part(limb.start + limb.along * reach * reaches, (limb.capsule)(limb.half, limb.radius))
        });
        self.socket(parent, upper, limb.start, 1.0);
        let middle = limb.start + limb.along * 2.0 * reach;
        self.join(JointKind::Hinge(limb.axis, [0.0, 2.4]), [upper, lower], middle);
    }

    /// Joins two parts at a point. Each turns by at most `most` radians around each axis.
    fn socket(&mut self, parent: Part, child: Part, at: Vec3, most: f32) {
        self.join(JointKind::Socket(most), [parent, child], at);
    }

    /// Joins two parts, which never touch, at a point.
    fn join(&mut self, kind: JointKind, parts: [Part; 2], at: Vec3) {
        let (bodies, anchors) = (parts.map(|part| part.body), parts.map(|part| at - part.at));
        self.b.plan.joints.push(Joint { kind, bodies, anchors, has_contacts: false });
    }
}

/// Returns an arm that bends forward; `side` is -1 or 1.
fn arm(side: f32) -> Limb {
    Limb {
        start: Vec3::new(0.19 * side, 0.2, 0.0),
        along: Vec3::X * side,
        capsule: Collider::capsule_x,
        half: 0.12,
        radius: 0.065,
        axis: Vec3::Y * -side,
    }
}

/// Returns a leg that bends backward; `side` is -1 or 1.
fn leg(side: f32) -> Limb {
    Limb {
        start: Vec3::new(0.11 * side, -0.5, 0.0),
        along: Vec3::NEG_Y,
        capsule: Collider::capsule_y,
        half: 0.14,
        radius: 0.085,
        axis: Vec3::X,
    }
}

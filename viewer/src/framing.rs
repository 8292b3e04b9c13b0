//! Where the camera stands.

use crate::shapes::to_vec3;
use crate::simulation::Ball;
use kiss3d::prelude::Vec3;
use pbig_scenes::world::World;

/// A place to look from, and one to look at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Framing {
    pub eye: [f32; 3],
    /// The place in the middle of the picture.
    pub at: [f32; 3],
    pub radius: f32,
}

/// The vertical field of view, in radians.
pub const FIELD_OF_VIEW: f32 = 0.7;
/// The direction from the objects to the camera.
const TOWARDS_CAMERA: [f32; 3] = [0.55, 0.38, 0.85];
/// A thrown ball's radius, as a share of what is seen.
const BALL_SHARE: f32 = 0.05;
/// A thrown ball reaches the middle of the picture in about this time, in seconds.
const BALL_SECONDS: f32 = 0.8;

impl Framing {
    /// Returns a place from which the moving objects of a world can be seen. Without one it looks at all objects.
    pub fn of(world: &World) -> Self {
        let (centre, half) = world.moving_aabb().map_or((Vec3::ZERO, Vec3::splat(5.0)), |around| {
            (to_vec3(around.center()), to_vec3(around.half_extents()))
        });
        let radius = half.length().max(2.0);
        // Objects fall, and lie low for most of the time.
        let at = centre - 0.5 * half * Vec3::Y;
        let distance = 1.1 * radius / (0.5 * FIELD_OF_VIEW).sin();
        let eye = at + Vec3::from_array(TOWARDS_CAMERA).normalize() * distance;
        Self { eye: eye.into(), at: at.into(), radius }
    }

    /// Returns a ball that flies from the camera to the middle of the picture.
    pub fn ball(&self) -> Ball {
        let [eye, at] = [self.eye, self.at].map(Vec3::from_array);
        let start = eye + (at - eye) * 0.25;
        let velocity = (at - start) / BALL_SECONDS;
        Ball { from: start.into(), velocity: velocity.into(), radius: BALL_SHARE * self.radius }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_scenes::scenes::Scene;

    #[test]
    fn scenes_are_in_the_picture_and_the_camera_above_ground() {
        for scene in Scene::ALL {
            let world = scene.build(200, 1);
            let Framing { eye, at, radius } = Framing::of(&world);
            let distance = to_vec3(eye).distance(to_vec3(at));
            assert!(eye.iter().chain(&at).all(|x| x.is_finite()), "{}", scene.name);
            assert!(distance * (0.5 * FIELD_OF_VIEW).sin() > 0.9 * radius, "{}", scene.name);
            assert!(eye[1] > at[1], "{}", scene.name);
        }
    }

    #[test]
    fn an_empty_world_has_a_framing() {
        assert!(Framing::of(&World::default()).eye.iter().all(|x| x.is_finite()));
    }

    #[test]
    fn a_ball_reaches_the_middle() {
        let framing = Framing { eye: [0.0, 0.0, 8.0], at: [0.0; 3], radius: 4.0 };
        let ball = framing.ball();
        assert_eq!(ball.from, [0.0, 0.0, 6.0]);
        assert!((ball.from[2] + ball.velocity[2] * BALL_SECONDS).abs() < 1e-5 && ball.radius == 0.2);
    }
}

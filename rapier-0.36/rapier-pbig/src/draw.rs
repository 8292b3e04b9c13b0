//! The differences between versions of rapier in `debug_render`, whose file is that of `crates/rapier-pbig`.

pub(crate) use crate::PbigFinder as Drawn;
pub(crate) use crate::finder::to_handle;

use rapier3d::math::{Pose, Vector};
use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};

/// Draws edges between corners, given in world coordinates.
pub(crate) fn draw_edges(
    backend: &mut dyn DebugRenderBackend,
    object: DebugRenderObject,
    corners: &[Vector],
    edges: &[[u32; 2]],
    color: DebugColor,
) {
    backend.draw_polyline(object, corners, edges, &Pose::IDENTITY, Vector::ONE, color);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DebugRenderParts;
    use rapier3d::prelude::*;

    #[derive(Default)]
    struct Canvas {
        lines: usize,
        longest: f32,
    }

    impl DebugRenderBackend for Canvas {
        fn draw_line(&mut self, _: DebugRenderObject, a: Vector, b: Vector, _: DebugColor) {
            self.lines += 1;
            self.longest = self.longest.max(a.distance(b));
        }
    }

    #[test]
    fn boxes_and_cells_are_drawn_with_twelve_lines_each() {
        let (mut colliders, bodies) = (ColliderSet::new(), RigidBodySet::new());
        let at = |i: u32| Vector::new((i % 8) as f32, (i / 8 % 8) as f32, (i / 64) as f32) * 5.0;
        let cube = |i| ColliderBuilder::cuboid(0.5, 0.5, 0.5).translation(at(i));
        let all: Vec<_> = (0..512).map(|i| colliders.insert(cube(i))).collect();
        let mut broad_phase = crate::broad_phase();
        let params = IntegrationParameters::default();
        broad_phase.update(&params, &colliders, &bodies, &all, &[], &mut Vec::new());
        let finder = crate::finder(&broad_phase).unwrap();
        let [boxes, cells] = [true, false].map(|fat_boxes| {
            let mut canvas = Canvas::default();
            let parts = DebugRenderParts { fat_boxes, cells: !fat_boxes };
            finder.debug_render(&colliders, parts, &mut canvas);
            canvas
        });
        assert_eq!(boxes.lines, 512 * 12);
        // On each side the margin, and half the prediction distance of 2 cm.
        let edge = 1.0 + 2.0 * (crate::MARGIN + params.prediction_distance() / 2.0);
        assert!((boxes.longest - edge).abs() < 1e-4, "a cube with its margins: {}", boxes.longest);
        assert!(cells.lines % 12 == 0 && cells.lines > 12 && cells.lines <= 512 * 12, "{}", cells.lines);
        assert!(cells.longest > boxes.longest, "a box fits into a cell");
    }
}

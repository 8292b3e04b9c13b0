//! Draws the broad phase through rapier's debug renderer.

use crate::PbigFinder;
use crate::scene::to_handle;
use crate::tree::to_tree;
use rapier::math::{DIM, Pose, Vector};
use rapier::pipeline::{DebugRenderBackend, DebugRenderObject};
use rapier::prelude::ColliderSet;

pbig_adapter::define_debug_render!(PbigFinder, &Pose::IDENTITY, Vector::ONE);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DebugRenderParts;
    use pbig_adapter::Scalar as _;
    use rapier::prelude::*;

    #[derive(Default)]
    struct Canvas {
        lines: usize,
        longest: Real,
    }

    impl DebugRenderBackend for Canvas {
        fn draw_line(&mut self, _: DebugRenderObject, a: Vector, b: Vector, _: DebugColor) {
            self.lines += 1;
            self.longest = self.longest.max(a.distance(b));
        }
    }

    #[test]
    fn boxes_and_cells_are_drawn_with_all_their_edges() {
        let (mut colliders, bodies) = (ColliderSet::new(), RigidBodySet::new());
        let (side, edges) = if DIM == 2 { (32_u32, 4) } else { (8, 12) };
        let along = |i: u32, k: usize| 5.0 * (i / side.pow(k as u32) % side) as Real;
        let at = |i: u32| Vector::from(std::array::from_fn::<Real, DIM, _>(|k| along(i, k)));
        let ball = |i| ColliderBuilder::ball(0.5).translation(at(i));
        let all: Vec<_> = (0..512).map(|i| colliders.insert(ball(i))).collect();
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
        assert_eq!(boxes.lines, 512 * edges);
        // On each side half the prediction distance of 2 cm. New fixed colliders have a margin for rounding: 1.5e-4 at 155 m.
        let edge = 1.0 + params.prediction_distance().to_f32();
        assert!((boxes.longest.to_f32() - edge).abs() < 1e-3, "a ball and its prediction: {}", boxes.longest);
        assert!(
            cells.lines % edges == 0 && cells.lines > edges && cells.lines <= 512 * edges,
            "{}",
            cells.lines
        );
        assert!(cells.longest > boxes.longest, "a box fits into a cell");
    }
}

//! A frame is a step and its queries.
#![cfg(not(any(feature = "dim2", feature = "f64")))]

use pbig_harness_036::run::Run;
use pbig_scenes::frames::FrameKind;
use pbig_scenes::scenes::Scene;

#[test]
fn a_frame_is_a_step_and_its_queries() {
    for kind in FrameKind::ALL {
        let has_queries = kind != FrameKind::None;
        let scene = Scene::named("column").expect("the scene exists");
        let mut run = Run::new(scene, 50, 1, rapier_pbig::broad_phase()).with_queries(kind);
        (0..20).for_each(|_| run.step());
        assert_eq!(run.hits > 0, has_queries, "{}", kind.name());
        for time in &run.times {
            assert_eq!((time.frame, time.queries > 0.0), (time.step + time.queries, has_queries));
        }
    }
}

//! Draws what the broad phase has stored: boxes with their margins, and the cells of its grid. A renderer that draws rapier's
//! debug lines draws these too; here they go into an SVG.
//!
//! `cargo run --release --example debug_render` writes out/debug_render.svg

use rapier_pbig::{DebugRenderParts, PbigBroadPhase};
use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
use rapier3d::prelude::*;
use std::fmt::Write;

/// Lines of an SVG, seen obliquely from above.
#[derive(Default)]
struct Picture {
    lines: String,
    count: usize,
}

impl DebugRenderBackend for Picture {
    /// Leaves out the ground, which is larger than any paper.
    fn filter_object(&self, object: DebugRenderObject) -> bool {
        matches!(object, DebugRenderObject::ColliderAabb(_, _, aabb) if aabb.extents().amax() < 100.0)
    }

    fn draw_line(&mut self, _: DebugRenderObject, a: Point<Real>, b: Point<Real>, color: DebugColor) {
        let [[x1, y1], [x2, y2]] = [a, b].map(|p| {
            [10.0 * (p.x - p.z), -10.0 * p.y - 4.0 * (p.x + p.z)].map(|x| (10.0 * x).round() / 10.0)
        });
        // Rapier's colours are hue in degrees, saturation, lightness and opacity.
        let [hue, saturation, lightness, alpha] = color;
        let color = format!("hsla({hue}, {}%, {}%, {alpha})", 100.0 * saturation, 100.0 * lightness);
        let written = writeln!(self.lines, r#"<path d="M{x1} {y1}L{x2} {y2}" stroke="{color}"/>"#);
        written.expect("a string takes everything");
        self.count += 1;
    }
}

/// Returns a broad phase that has seen 1,500 balls in a spiral. Few boxes would need no grid.
fn spiral(bodies: &RigidBodySet, colliders: &mut ColliderSet) -> PbigBroadPhase {
    colliders.insert(ColliderBuilder::halfspace(Vector::y_axis()));
    for i in 0..1500 {
        let (turn, radius) = (0.05 * i as f32, 5.0 + 0.015 * i as f32);
        let at = vector![radius * turn.cos(), 0.02 * i as f32, radius * turn.sin()];
        colliders.insert(ColliderBuilder::ball(0.5).translation(at));
    }
    let handles: Vec<ColliderHandle> = colliders.iter().map(|(handle, _)| handle).collect();
    let mut broad_phase = PbigBroadPhase::new();
    broad_phase.update(&IntegrationParameters::default(), colliders, bodies, &handles, &[], &mut Vec::new());
    broad_phase
}

fn main() -> std::io::Result<()> {
    let (bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
    let broad_phase = spiral(&bodies, &mut colliders);
    let mut picture = Picture::default();
    broad_phase.debug_render(&colliders, DebugRenderParts::ALL, &mut picture);

    std::fs::create_dir_all("out")?;
    let head = "<svg xmlns='http://www.w3.org/2000/svg' viewBox='-450 -480 900 570' stroke-width='0.4' \
        style='background: #181820'>";
    std::fs::write("out/debug_render.svg", format!("{head}{}</svg>", picture.lines))?;
    println!("{}", broad_phase.stats().report.plan);
    println!("{} lines in out/debug_render.svg", picture.count);
    Ok(())
}

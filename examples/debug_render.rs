//! A picture of what the broad phase has stored: boxes with their margins, and the cells of its grid. Any renderer that
//! draws rapier's own debug lines draws these too; here they go into an SVG.
//!
//! `cargo run --release --example debug_render` writes out/debug_render.svg

use pbig_core::{Config, Strategy};
use pbig_harness::scenes::Scene;
use plotters::prelude::*;
use rapier_pbig::{DebugRenderParts, PbigBroadPhase, PbigConfig};
use rapier3d::pipeline::{DebugColor, DebugRenderBackend, DebugRenderObject};
use rapier3d::prelude::{Point, Real};
use std::error::Error;
use std::path::Path;

/// A line on the paper, and its colour.
type Line = ([(f64, f64); 2], DebugColor);

/// Remembers lines, seen obliquely from above.
#[derive(Default)]
struct Lines(Vec<Line>);

impl DebugRenderBackend for Lines {
    /// A ground is larger than any paper.
    fn filter_object(&self, object: DebugRenderObject) -> bool {
        matches!(object, DebugRenderObject::ColliderAabb(_, _, aabb) if aabb.extents().amax() < 20.0)
    }

    fn draw_line(&mut self, _: DebugRenderObject, a: Point<Real>, b: Point<Real>, color: DebugColor) {
        let seen =
            |p: Point<Real>| (f64::from(p.x - p.z) * 0.87, f64::from(p.y) + f64::from(p.x + p.z) * 0.3);
        self.0.push(([seen(a), seen(b)], color));
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    // So few boxes are usually tested without a grid.
    let config = Config { strategy: Strategy::Grid, ..PbigConfig::DEFAULT.into() };
    let mut broad_phase = PbigBroadPhase::with_core_config(config)?;
    let mut world = Scene::named("rain")?.build(160, 1);
    for _ in 0..60 {
        world.step(&mut broad_phase);
    }

    let draw = |parts: DebugRenderParts| {
        let mut lines = Lines::default();
        broad_phase.debug_render(&world.colliders, parts, &mut lines);
        lines.0
    };
    let file = Path::new("out/debug_render.svg");
    std::fs::create_dir_all("out")?;
    let boxes = draw(DebugRenderParts { fat_boxes: true, cells: false });
    let all = draw(DebugRenderParts::ALL);
    paint(file, [("boxes with their margins", boxes), ("and the cells that they are sorted into", all)])?;
    println!("{} pairs; {}", broad_phase.pair_count(), broad_phase.stats().report.plan);
    println!("the picture is {}", file.display());
    Ok(())
}

/// Two pictures side by side.
fn paint(file: &Path, pictures: [(&str, Vec<Line>); 2]) -> Result<(), Box<dyn Error>> {
    let root = SVGBackend::new(file, (1200, 700)).into_drawing_area();
    root.fill(&RGBColor(24, 24, 32))?;
    let points = || pictures[1].1.iter().flat_map(|(line, _)| line);
    let range = |of: fn(&(f64, f64)) -> f64| {
        let (low, high) = points().map(of).fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
        low - 0.5..high + 0.5
    };
    for (area, (title, lines)) in root.split_evenly((1, 2)).iter().zip(&pictures) {
        let mut chart = ChartBuilder::on(area)
            .caption(title, ("sans-serif", 20, &WHITE))
            .margin(10)
            .build_cartesian_2d(range(|p| p.0), range(|p| p.1))?;
        let path = |(line, color): &Line| PathElement::new(line.to_vec(), paint_of(*color));
        chart.draw_series(lines.iter().map(path))?;
    }
    root.present()?;
    Ok(())
}

/// Rapier's colours are hue in degrees, saturation, lightness and opacity.
fn paint_of([hue, saturation, lightness, opacity]: DebugColor) -> RGBAColor {
    let [hue, saturation, lightness] = [hue / 360.0, saturation, lightness].map(f64::from);
    HSLColor(hue, saturation, lightness).mix(f64::from(opacity))
}

//! Line charts as SVG: an image that needs no fonts or libraries to write.

mod log_log;
mod pareto;

pub use log_log::{Line, LogLog, growth};
pub use pareto::Pareto;

use plotters::prelude::*;
use std::path::Path;

/// A named line of a chart.
pub struct Series<'a> {
    /// For the legend.
    pub name: &'a str,
    /// One value for each step.
    pub values: Vec<f64>,
}

/// One panel of a chart.
pub struct Panel<'a> {
    /// Above the panel.
    pub title: &'a str,
    /// Its lines.
    pub series: Vec<Series<'a>>,
}

/// Colours that differ for the colour-blind too (Okabe and Ito).
const COLOURS: [RGBColor; 7] = [
    RGBColor(213, 94, 0),
    RGBColor(0, 114, 178),
    RGBColor(0, 158, 115),
    RGBColor(0, 0, 0),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

/// Writes panels one below the other, milliseconds against steps.
///
/// # Errors
/// A message that names the file, when it cannot be written.
pub fn write(path: &Path, panels: &[Panel<'_>]) -> Result<(), String> {
    draw(path, panels).map_err(|error| format!("{}: cannot write the chart: {error}", path.display()))
}

fn draw(path: &Path, panels: &[Panel<'_>]) -> Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::new(path, (960, 340 * panels.len() as u32)).into_drawing_area();
    root.fill(&WHITE)?;
    for (area, panel) in root.split_evenly((panels.len(), 1)).iter().zip(panels) {
        draw_panel(area, panel)?;
    }
    root.present()?;
    Ok(())
}

fn draw_panel(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    panel: &Panel<'_>,
) -> Result<(), Box<dyn std::error::Error + 'static>> {
    let steps = panel.series.iter().map(|s| s.values.len()).max().unwrap_or(1).max(2);
    let highest = panel.series.iter().flat_map(|s| &s.values).fold(1e-6, |a: f64, &b| a.max(b));
    let mut chart = ChartBuilder::on(area)
        .caption(panel.title, ("sans-serif", 20))
        .margin(12)
        .x_label_area_size(36)
        .y_label_area_size(60)
        .build_cartesian_2d(0..steps, 0.0..highest * 1.05)
        .map_err(owned)?;
    chart.configure_mesh().light_line_style(WHITE).x_desc("step").y_desc("ms").draw().map_err(owned)?;
    for (series, colour) in panel.series.iter().zip(COLOURS) {
        let points = series.values.iter().enumerate().map(|(step, &ms)| (step, ms));
        chart
            .draw_series(LineSeries::new(points, colour.stroke_width(2)))
            .map_err(owned)?
            .label(series.name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour.stroke_width(3)));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK)
        .draw()
        .map_err(owned)
}

fn owned(error: impl std::error::Error) -> Box<dyn std::error::Error> {
    error.to_string().into()
}

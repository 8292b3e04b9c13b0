//! Charts of time against error: what is best lies to the left and below.

use super::{COLOURS, Line, owned};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::ops::Range;
use std::path::Path;

/// Points of time and error over logarithmic axes. An error of 0, which has no logarithm, is drawn on a line of
/// its own: a decade below the smallest error there is, labelled 0.
pub struct Pareto {
    /// Name of the file, without its extension.
    pub name: String,
    /// Above the chart.
    pub title: String,
    /// Along the x axis: the time.
    pub x: &'static str,
    /// Along the y axis: the error.
    pub y: &'static str,
    /// The points: times above 0 and errors of at least 0, all finite. Others are left out.
    pub lines: Vec<Line>,
    /// True if the points of a line are joined.
    pub joined: bool,
}

/// Width of the legend, which stands beside the points and hides none.
const LEGEND: u32 = 300;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Done = Result<(), Box<dyn std::error::Error>>;

fn drawn(line: &Line) -> impl Iterator<Item = (f64, f64)> + '_ {
    let fits = |&(x, y): &(f64, f64)| x > 0.0 && x.is_finite() && y >= 0.0 && y.is_finite();
    line.points.iter().copied().filter(fits)
}

impl Pareto {
    /// Writes the chart.
    ///
    /// # Errors
    /// A message that names the file, when it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), String> {
        self.draw(path).map_err(|error| format!("{}: cannot write the chart: {error}", path.display()))
    }

    fn values(&self, of: fn((f64, f64)) -> f64) -> impl Iterator<Item = f64> + '_ {
        self.lines.iter().flat_map(drawn).map(of).filter(|value| *value > 0.0)
    }

    /// From the smallest to the largest above 0.
    fn ends(&self, of: fn((f64, f64)) -> f64) -> (f64, f64) {
        let (low, high) = (self.values(of).fold(f64::MAX, f64::min), self.values(of).fold(0.0, f64::max));
        if low > high { (1.0, 10.0) } else { (low, high) }
    }

    /// Returns the place of an error of 0: a power of ten, which the axis labels.
    fn floor(&self) -> f64 {
        10f64.powf(self.ends(|p| p.1).0.log10().floor() - 1.0)
    }

    fn ranges(&self) -> (Range<f64>, Range<f64>) {
        let (x, y) = (self.ends(|p| p.0), self.ends(|p| p.1));
        // Whole decades, or an axis could be without a label.
        let decade = |x: f64, round: fn(f64) -> f64| 10f64.powf(round(x.log10()));
        let times = decade(x.0 / 1.1, f64::floor)..decade(x.1 * 1.1, f64::ceil);
        (times, self.floor() / 2.0..y.1 * 2.0)
    }

    fn draw(&self, path: &Path) -> Done {
        let root = SVGBackend::new(path, (1100, 540)).into_drawing_area();
        root.fill(&WHITE)?;
        let (plot, legend) = root.split_horizontally(1100 - LEGEND);
        self.draw_plot(&plot)?;
        self.draw_legend(&legend)?;
        root.present().map_err(owned)
    }

    fn draw_plot(&self, area: &Area<'_>) -> Done {
        let (times, errors) = self.ranges();
        let floor = self.floor();
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, ("sans-serif", 20))
            .margin(12)
            .x_label_area_size(40)
            .y_label_area_size(80)
            .build_cartesian_2d(times.clone().log_scale(), errors.log_scale())
            .map_err(owned)?;
        let time = |value: &f64| format!("{value}");
        let error = |value: &f64| if *value < floor * 1.01 { "0".to_owned() } else { format!("{value:e}") };
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(self.x).y_desc(self.y).x_label_formatter(&time).y_label_formatter(&error);
        mesh.light_line_style(WHITE).draw().map_err(owned)?;
        let zero = [(times.start, floor), (times.end, floor)];
        chart.draw_series(LineSeries::new(zero, BLACK.mix(0.6).stroke_width(2))).map_err(owned)?;
        for (k, line) in self.lines.iter().enumerate() {
            let points: Vec<_> = drawn(line).map(|(x, y)| (x, y.max(floor))).collect();
            let colour = colour(k);
            if self.joined {
                chart.draw_series(LineSeries::new(points.clone(), colour.mix(0.5))).map_err(owned)?;
            }
            chart.draw_series(points.into_iter().map(|at| mark(k, at))).map_err(owned)?;
        }
        Ok(())
    }

    fn draw_legend(&self, area: &Area<'_>) -> Done {
        for (k, line) in self.lines.iter().enumerate() {
            let y = 50 + 20 * k as i32;
            area.draw(&mark(k, (12, y))).map_err(owned)?;
            let text = Text::new(line.name.clone(), (26, y - 7), ("sans-serif", 14).into_font());
            area.draw(&text).map_err(owned)?;
        }
        Ok(())
    }
}

fn colour(k: usize) -> RGBColor {
    COLOURS[k % COLOURS.len()]
}

/// Colours come again after the last: as rings, then as larger ones.
fn mark<C>(k: usize, at: C) -> Circle<C, u32> {
    let round = k / COLOURS.len();
    let style = if round == 0 { colour(k).filled() } else { colour(k).stroke_width(2) };
    Circle::new(at, 4 + 2 * round as u32, style)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: &[(f64, f64)]) -> Pareto {
        let lines = vec![Line { name: "a line".into(), points: points.to_vec() }];
        Pareto {
            name: "chart".into(),
            title: "time and error".into(),
            x: "ns",
            y: "wrong, %",
            lines,
            joined: true,
        }
    }

    #[test]
    fn an_error_of_zero_lies_a_decade_or_more_below_the_smallest() {
        let with_zero = chart(&[(1.0, 0.0), (2.0, 3e-4), (3.0, 50.0)]);
        assert!((with_zero.floor() / 1e-5 - 1.0).abs() < 1e-9, "{}", with_zero.floor());
        let (times, errors) = with_zero.ranges();
        assert!(times.contains(&1.0) && times.contains(&3.0));
        assert!(errors.contains(&with_zero.floor()) && errors.contains(&50.0));
    }

    #[test]
    fn zeros_alone_have_a_chart_and_what_is_not_finite_is_left_out() {
        let folder = tempfile::tempdir().expect("a folder");
        for points in [&[(1.0, 0.0)][..], &[], &[(0.0, 1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)]] {
            let path = folder.path().join("chart.svg");
            chart(points).write(&path).expect("written");
            let text = std::fs::read_to_string(&path).expect("text");
            // The mark in the legend, and one for each point that can be drawn.
            let marks = 1 + points.iter().filter(|p| p.0 > 0.0 && p.1.is_finite()).count();
            assert_eq!(text.matches("<circle").count(), marks, "{points:?}");
            assert!(text.contains("time and error") && text.contains("a line"));
        }
        let nowhere = chart(&[]).write(&folder.path().join("no/such/folder.svg"));
        assert!(nowhere.is_err_and(|error| error.contains("folder.svg")));
    }
}
